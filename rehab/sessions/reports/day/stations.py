"""The status of a clinic's stations: devices, open session, connections."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass
from datetime import datetime

from rehab.people.models import User
from rehab.sessions.live import runtime
from rehab.sessions.live.session.live_session import LiveSession
from rehab.sessions.models import TrainingSession
from rehab.stations.models import Device, Station
from rehab.stations.presence import format_device_states


@dataclass(frozen=True, slots=True)
class StationStatus:
    """A station, its devices with their states, its open session and what is connected to it."""

    station: Station
    devices: list[tuple[Device, str]]
    session: TrainingSession | None
    connected: dict[str, bool]


def station_statuses(
    user: User, open_sessions: list[TrainingSession], now: datetime
) -> Iterator[StationStatus]:
    """Yield the status of each station that a user sees."""
    devices: defaultdict[int, list[tuple[Device, str]]] = defaultdict(list)
    own = list(Device.objects.visible_to(user).order_by("kind", "name"))
    for device, state in format_device_states(own, now):
        devices[device.station_id].append((device, state))
    at_station = {session.station_id: session for session in reversed(open_sessions)}
    for station in Station.objects.visible_to(user):
        session = at_station.get(station.pk)
        yield StationStatus(
            station,
            devices[station.pk],
            session,
            connected_devices(session, now) if session else {},
        )


def connected_devices(session: TrainingSession, now: datetime) -> dict[str, bool]:
    """Return which kinds of device are connected to a session; {} if another process runs it."""
    live = find_live_session(session)
    if live is None:
        return {}
    presence = live.presence(now)
    return {
        "source": presence["source"],
        "tablet": bool(presence["tablets"]),
        "robot": presence["robot"],
    }


def find_live_session(session: TrainingSession) -> LiveSession | None:
    """Return the live session, where this process runs or follows it."""
    running = runtime.peek()
    return running.find(session.pk) if running else None
