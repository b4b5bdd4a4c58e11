"""The sources and robots that are connected to this process, by station."""

from __future__ import annotations

from collections import defaultdict
from typing import Protocol


class ConnectedDevice(Protocol):
    """A source or robot that is connected, with a session or without one."""

    @property
    def device_id(self) -> int | None:
        """The device's key."""

    def on_session_opened(self, session_id: int) -> None:
        """Attach to a session that was just created for its station, unless it has one."""


class Devices:
    """Sources and robots, while they are connected."""

    def __init__(self) -> None:
        self._at: defaultdict[int, set[ConnectedDevice]] = defaultdict(set)

    def add(self, station_id: int, device: ConnectedDevice) -> None:
        """Add a device that has said hello."""
        self._at[station_id].add(device)

    def discard(self, station_id: int, device: ConnectedDevice) -> None:
        """Forget a device that has left."""
        self._at[station_id].discard(device)

    def at(self, station_id: int) -> frozenset[ConnectedDevice]:
        """Return the devices of a station."""
        return frozenset(self._at.get(station_id, ()))

    def announce(self, session_id: int, station_id: int) -> None:
        """Tell a station's devices that a session has opened."""
        for device in self.at(station_id):
            device.on_session_opened(session_id)

    def connected_ids(self) -> set[int | None]:
        """Return the devices' keys. Any thread may ask."""
        return {device.device_id for there in list(self._at.values()) for device in list(there)}
