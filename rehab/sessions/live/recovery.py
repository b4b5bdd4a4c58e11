"""Pauses the sessions whose process died while they ran, and takes over those left without one."""

from __future__ import annotations

import asyncio
import logging

from asgiref.sync import sync_to_async
from django.utils import timezone

from rehab.sessions.live.database import owners
from rehab.sessions.live.database.owners import OwnedElsewhere
from rehab.sessions.live.host import Host
from rehab.sessions.live.session.live_session import LiveSession
from rehab.training.changes import Change, ChangeKind, PauseReason

log = logging.getLogger(__name__)


class Recovery:
    """What comes back after a crash, of this process or of another server."""

    def __init__(self, host: Host) -> None:
        self._host = host
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
        if not self._host.draining:
            await asyncio.gather(*(self._recover(session_id) for session_id in sorted(again)))

    async def _recover(self, session_id: int) -> None:
        try:
            await self.pause_orphaned(await self._host.session(session_id))
        except OwnedElsewhere:
            self._orphaned.discard(session_id)  # another server was faster
        except Exception:  # one broken session must not prevent the server from starting
            log.exception("Session %s could not be recovered", session_id)

    async def pause_orphaned(self, live: LiveSession, owned_before: str | None = None) -> None:
        """Pause a session whose process died while it ran.

        If the pause cannot be stored, it is tried again when the session is loaded next.
        ``owned_before``: the previous owner of a session that was just loaded.
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
