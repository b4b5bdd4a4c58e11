"""The runtime as its parts see it: the sessions of this process, and what they share."""

from __future__ import annotations

from typing import Any, Protocol

from rehab.people.models import User
from rehab.sessions.live.devices import Devices
from rehab.sessions.live.session.group_commit import Writer
from rehab.sessions.live.session.live_session import LiveSession
from rehab.sessions.live.station_robots import StationRobots
from rehab.sessions.live.supervisor import Supervisor
from rehab.sessions.payloads import Message


class Host(Protocol):
    """What orders, recovery, routines and other servers' requests need (runtime.py)."""

    sessions: dict[int, LiveSession]
    sockets: set[Any]
    draining: bool
    devices: Devices
    robots: StationRobots
    supervisor: Supervisor
    writer: Writer

    async def session(self, session_id: int) -> LiveSession: ...
    async def settled_session(self, session_id: int) -> LiveSession: ...
    def drop(self, live: LiveSession, problem: Exception) -> None: ...
    async def close(self, live: LiveSession) -> None: ...
    def close_pages(self, live: LiveSession) -> None: ...
    def announce(self, session_id: int, station_id: int | None) -> None: ...
    def stop_robots(self, live: LiveSession, by: User | None, details: Message) -> None: ...
