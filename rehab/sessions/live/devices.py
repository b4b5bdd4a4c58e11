"""Sources and robots that are connected to this process."""

from __future__ import annotations

from collections import defaultdict
from typing import Protocol

from rehab.sessions.live.protocol.outgoing import Outbox


class ConnectedDevice(Protocol):
    """A connected source or robot, with a session or without one."""

    outbox: Outbox
    simulated: bool  # nobody walks, by what it said of itself

    @property
    def device_id(self) -> int | None:
        """The device's key."""

    def evict(self, code: int, error: str, message: str) -> None:
        """Close its connection with an error."""

    def on_session_opened(self, session_id: int) -> None:
        """Attach to a session that was just created for its station, unless it has one."""


class Devices:
    """The connected sources and robots, by station."""

    def __init__(self) -> None:
        self._at: defaultdict[int, set[ConnectedDevice]] = defaultdict(set)

    def add(self, station_id: int, device: ConnectedDevice) -> None:
        """Add a device that has said hello."""
        self._at[station_id].add(device)

    def discard(self, station_id: int, device: ConnectedDevice) -> None:
        """Remove a device that has left."""
        self._at[station_id].discard(device)

    def at(self, station_id: int) -> frozenset[ConnectedDevice]:
        """Return the devices of a station."""
        return frozenset(self._at.get(station_id, ()))

    def announce(self, session_id: int, station_id: int) -> None:
        """Notify a station's devices of a session that has opened."""
        for device in self.at(station_id):
            device.on_session_opened(session_id)

    def connected_ids(self) -> set[int | None]:
        """Return the devices' keys. Any thread may call this."""
        return {device.device_id for there in list(self._at.values()) for device in list(there)}
