"""What people order of the sessions of this process: changes, remarks, their robot's stop."""

from __future__ import annotations

import time
from typing import Protocol

from asgiref.sync import sync_to_async
from django.utils import timezone

from rehab.people.models import User
from rehab.sessions.live import sources
from rehab.sessions.live.session.live_session import LiveSession
from rehab.sessions.live.session.loading import find_newest_open
from rehab.sessions.live.station_robots import StationRobots
from rehab.sessions.live.supervisor import Supervisor
from rehab.sessions.log import Remark
from rehab.sessions.payloads import Message
from rehab.training.changes import ENDED_STATES, Change, ChangeValue, NotAllowed, State
from rehab.training.controls import CONTROLS


class Obeying(Protocol):
    """What a runtime does to obey."""

    sessions: dict[int, LiveSession]
    supervisor: Supervisor
    robots: StationRobots

    async def session(self, session_id: int) -> LiveSession: ...
    async def settled_session(self, session_id: int) -> LiveSession: ...
    def stop_robots(self, live: LiveSession, by: User | None, told: Message) -> None: ...
    def announce(self, session_id: int, station_id: int | None) -> None: ...


class SessionOrders:
    """Each raises OwnedElsewhere where the session is another server's."""

    def __init__(self, obeying: Obeying) -> None:
        self._obeying = obeying

    async def change(self, session_id: int, kind: str, value: ChangeValue, by: User | None) -> None:
        """Apply a change; committed when this returns.

        Raises InvalidSetting if it is refused and NotStored if it could not be committed.
        """
        live = await self._obeying.settled_session(session_id)
        if live.source_clock is not None and CONTROLS[kind].leads_to is State.RUNNING:
            live.source_clock.resume(time.monotonic())
        await live.change(Change(kind, value), by, timezone.now())
        if live.aggregate.fold.state not in ENDED_STATES:
            return
        await self._obeying.supervisor.stop(sources.child_name(live.id))
        if live.station_id is not None:
            waiting = await sync_to_async(find_newest_open)(live.station_id)
            if waiting is not None:
                self._obeying.announce(waiting, live.station_id)

    async def remark(self, session_id: int, what: Remark, value: float | None, by: User) -> None:
        """Log a remark; committed when this returns. Raises what ``change`` raises."""
        live = await self._obeying.settled_session(session_id)
        if live.aggregate.fold.state in ENDED_STATES:
            raise NotAllowed("The session has ended.")
        await live.remark(what, value, by, timezone.now())

    async def order_robot(
        self, session_id: int, order: str, by: User | None, device_id: int | None
    ) -> None:
        """Stop the robot, or let it move again, for a page at another server."""
        obeying = self._obeying
        live = obeying.sessions.get(session_id) or await obeying.session(session_id)
        if order == "stop":
            obeying.stop_robots(live, by, {} if device_id is None else {"device": device_id})
        elif by is not None:
            await obeying.robots.arm(live, by)
