"""Pauses the sessions whose process died while they ran, and takes over those left without one."""

from __future__ import annotations

import asyncio
import contextvars
import logging

from asgiref.sync import sync_to_async
from django.utils import timezone

from rehab.sessions.live.database import clinic_owners
from rehab.sessions.live.database.clinic_owners import Claim, OwnedElsewhere
from rehab.sessions.live.host import Host
from rehab.sessions.live.session.live_session import LiveSession
from rehab.training.changes import Change, ChangeKind, PauseReason

log = logging.getLogger(__name__)


class Recovery:
    """What comes back after a crash, of this process or of another server."""

    def __init__(self, host: Host) -> None:
        self._host = host
        self._orphaned: set[int] = set()  # sessions of dead processes: paused if they run
        self._left_before: set[int] = set()  # clinics that nobody had, a beat ago
        self._loading: set[asyncio.Task[None]] = set()

    async def recover(self) -> int:
        """Pause the sessions whose process died while they ran; return how many.

        Sessions of clinics that a process released when it was stopped go on as they are.
        """
        orphaned, released = await sync_to_async(clinic_owners.find_ownerless)()
        await self._take(orphaned)
        paused = len(self._orphaned)
        await self._take(released)
        await asyncio.gather(*self._loading)
        return paused

    async def take_over_left(self, *, thorough: bool) -> None:
        """Take over clinics whose server is gone, or that nobody has had for a beat.

        One that was just released is left to the server that is asked for it. ``thorough``: as of
        ``clinic_owners.find_ownerless``.
        """
        orphaned, released = await sync_to_async(clinic_owners.find_ownerless)(thorough=thorough)
        left = {*orphaned, *released}
        again, self._left_before = left & self._left_before, left
        if not self._host.draining:
            await self._take(sorted(again))

    async def _take(self, clinic_ids: list[int]) -> None:
        for clinic_id in filter(clinic_owners.belongs_here, clinic_ids):
            try:
                await self._host.clinics.own(clinic_id)
            except OwnedElsewhere:
                continue  # another server was faster, or it is that one's

    def load(self, claim: Claim) -> None:
        """Load what runs in a clinic that was just claimed; pause what was orphaned."""
        if claim.is_orphaned:
            self._orphaned.update(claim.running)
        for session_id in () if self._host.draining else claim.running:
            task = asyncio.get_running_loop().create_task(
                self._recover(session_id), context=contextvars.Context()
            )
            self._loading.add(task)
            task.add_done_callback(self._loading.discard)

    async def _recover(self, session_id: int) -> None:
        try:
            await self.pause_orphaned(await self._host.session(session_id))
        except OwnedElsewhere:
            self._orphaned.discard(session_id)  # another server was faster
        except Exception:  # one broken session must not prevent the server from starting
            if not self._host.draining:
                log.exception("Session %s could not be recovered", session_id)

    async def pause_orphaned(self, live: LiveSession) -> None:
        """Pause a session whose process died while it ran.

        If the pause cannot be stored, it is tried again when the session is loaded next.
        """
        if live.id in self._orphaned:
            if live.is_running:
                pause = Change(ChangeKind.PAUSE, PauseReason.RESTART.value)
                await live.change(pause, None, timezone.now())
                log.warning("Session %s was left running; it is paused now.", live.id)
            self._orphaned.discard(live.id)

    def forget(self, session_id: int) -> None:
        """Leave a session to the server that has taken its clinic."""
        self._orphaned.discard(session_id)
