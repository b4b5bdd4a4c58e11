"""How sessions change their owner: recovered at a start, taken over, given up, lost."""

from __future__ import annotations

import asyncio
import logging
from typing import Protocol

from asgiref.sync import sync_to_async
from django.utils import timezone

from rehab.sessions.live import sources
from rehab.sessions.live.database import owners
from rehab.sessions.live.database.owners import OwnedElsewhere
from rehab.sessions.live.session.commits import Fenced
from rehab.sessions.live.session.live_session import LiveSession
from rehab.sessions.live.supervisor import Supervisor
from rehab.sessions.models import TrainingSession
from rehab.training.changes import Change, ChangeKind, PauseReason
from robot.wire.close_codes import CloseCode

log = logging.getLogger(__name__)


class Keeping(Protocol):
    """What a runtime does with the sessions that it keeps in memory."""

    sessions: dict[int, LiveSession]
    supervisor: Supervisor
    draining: bool

    async def session(self, session_id: int) -> LiveSession: ...
    def drop(self, live: LiveSession, problem: Exception) -> None: ...
    def close_pages(self, live: LiveSession) -> None: ...


class Handover:
    """Sessions that come from an earlier owner, and those that go to another one."""

    def __init__(self, keeping: Keeping) -> None:
        self._keeping = keeping
        self._orphaned: set[int] = set()  # sessions of dead processes: paused if they run
        self._left_before: set[int] = set()  # sessions without an owner, a beat ago

    async def recover(self) -> int:
        """Pause the sessions whose process died while they ran; return how many.

        Sessions that a process handed on when it was stopped go on as they are.
        """
        orphaned, handed_on = await sync_to_async(owners.find_ownerless)()
        self._orphaned.update(orphaned)
        await asyncio.gather(*map(self._recover, (*orphaned, *handed_on)))
        return len(orphaned)

    async def take_over_left(self) -> None:
        """Take over sessions that run and have had no owner for a beat, or whose owner is gone.

        Those that a server has just handed on are left to the device that asks for them.
        """
        orphaned, handed_on = await sync_to_async(owners.find_ownerless)()
        left = {*orphaned, *handed_on}
        again, self._left_before = left & self._left_before, left
        self._orphaned.update(again.intersection(orphaned))
        if not self._keeping.draining:
            await asyncio.gather(*(self._recover(session_id) for session_id in sorted(again)))

    async def _recover(self, session_id: int) -> None:
        try:
            await self.pause_orphaned(await self._keeping.session(session_id))
        except OwnedElsewhere:
            self._orphaned.discard(session_id)  # another server was faster
        except Exception:  # one broken session must not keep the server from starting
            log.exception("Session %s could not be recovered", session_id)

    async def pause_orphaned(self, live: LiveSession, owned_before: str | None = None) -> None:
        """Pause a session whose process died while it ran.

        If that cannot be stored, it is tried again when the session is loaded next.
        ``owned_before``: of one that was just loaded, by whom.
        """
        if owned_before in ("", owners.HANDED_ON):  # another server recovered it meanwhile
            self._orphaned.discard(live.id)
        elif owned_before not in (None, live.aggregate.session.owner):
            self._orphaned.add(live.id)
        if live.id in self._orphaned:
            if live.is_running:
                pause = Change(ChangeKind.PAUSE, PauseReason.RESTART.value)
                await live.change(pause, None, timezone.now())
                log.warning("Session %s was left running; it is paused now.", live.id)
            self._orphaned.discard(live.id)

    async def give_up(self, session_id: int, slot: str) -> bool:
        """Release a session for a device that waits at another server; return whether that is so.

        It goes where its source is, and without one where its robot is. Nothing is lost: what
        is queued is committed first.
        """
        keeping = self._keeping
        live = keeping.sessions.get(session_id)
        is_needed = live is None or live.source is not None or keeping.draining
        if live is None or is_needed or (slot == "robot" and live.robot is not None):
            return False
        if sources.child_name(session_id) in keeping.supervisor.children:
            return False  # its source dials in here
        del keeping.sessions[session_id]  # from here on nobody gets it
        try:
            await live.wait_until_committed()
            epoch = live.aggregate.session.epoch
            return await sync_to_async(owners.hand_on)(session_id, epoch)
        finally:
            if live.robot is not None:
                moved = "The session moved. Connect again."
                live.robot.evict(CloseCode.ELSEWHERE, "elsewhere", moved)
            keeping.close_pages(live)

    async def drop_taken(self) -> None:
        """Drop the sessions that another server has claimed while this one's lease had expired."""
        sessions = self._keeping.sessions
        there = TrainingSession.everywhere.filter(pk__in=list(sessions))
        epochs = dict([row async for row in there.values_list("pk", "epoch")])
        for live in list(sessions.values()):
            if epochs.get(live.id, live.aggregate.session.epoch) != live.aggregate.session.epoch:
                self._keeping.drop(live, Fenced("Another server has taken the session over."))
                await self._keeping.supervisor.stop(sources.child_name(live.id))
