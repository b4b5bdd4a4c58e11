"""The runtime as its parts see it: the sessions of this process, and what they share."""

from __future__ import annotations

from typing import Any, Protocol

from rehab.sessions.live.clinics import OwnedClinics
from rehab.sessions.live.devices import Devices
from rehab.sessions.live.session.group_commit import Writer
from rehab.sessions.live.session.live_session import LiveSession
from rehab.sessions.live.station_robots import StationRobots
from rehab.sessions.live.supervisor import Supervisor


class Host(Protocol):
    """What orders, recovery, routines and the watch over other servers need (runtime.py)."""

    clinics: OwnedClinics
    sessions: dict[int, LiveSession]
    sockets: set[Any]
    draining: bool
    devices: Devices
    robots: StationRobots
    supervisor: Supervisor
    writer: Writer

    @property
    def may_move_robots(self) -> bool: ...
    async def session(self, session_id: int) -> LiveSession: ...
    async def settled_session(self, session_id: int) -> LiveSession: ...
    def drop(self, live: LiveSession, problem: Exception) -> None: ...
    async def close(self, live: LiveSession) -> None: ...
    async def close_unused_clinics(self) -> None: ...
    async def give_up(self, clinic_id: int) -> None: ...
    def lose(self, clinic_id: int) -> None: ...
    def announce(self, session_id: int, station_id: int | None) -> None: ...
