"""The sessions of other servers that pages here look at: opened, read on, left."""

from __future__ import annotations

import asyncio
import contextvars
import logging
from collections.abc import Callable

from django.utils import timezone

from rehab.sessions.live.database.own_connection import DatabaseThread
from rehab.sessions.live.servers.following import FollowedSession, load_followed, read_new_rows
from rehab.sessions.live.session.live_session import LiveSession

log = logging.getLogger(__name__)

READ_PAUSE_S = 0.005  # between two reads: hints that come meanwhile are read together
UNUSED_BEATS = 3  # after so many without a page a session is not followed any more


class FollowedSessions:
    """What this server follows, by id.

    Parameters
    ----------
    database
        The connection that the logs are read by.
    notify_owner
        Reports to a session's owner which pages are here.
    close_pages
        Closes a session's pages, which then connect again.
    """

    def __init__(
        self,
        database: DatabaseThread,
        notify_owner: Callable[[FollowedSession], None],
        close_pages: Callable[[LiveSession], None],
    ) -> None:
        self.sessions: dict[int, FollowedSession] = {}
        self._notify_owner = notify_owner
        self._close_pages = close_pages
        self._opening: dict[int, asyncio.Task[None]] = {}
        self._unused: dict[int, int] = {}  # beats
        self._hinted: set[int] = set()
        self._read_due = asyncio.Event()
        self._database = database

    async def follow(self, session_id: int) -> FollowedSession:
        """Return a session of another server, as far as it is known here.

        Raises TrainingSession.DoesNotExist.
        """
        while (live := self.sessions.get(session_id)) is None:
            if session_id not in self._opening:
                self._opening[session_id] = asyncio.get_running_loop().create_task(
                    self._open(session_id), context=contextvars.Context()
                )
            task = self._opening[session_id]
            try:
                await asyncio.shield(task)
            finally:
                if task.done():
                    self._opening.pop(session_id, None)
        self._unused[session_id] = 0
        return live

    async def _open(self, session_id: int) -> None:
        live = await self._database.run(load_followed, session_id)
        self.sessions[session_id] = live
        self._unused[session_id] = 0
        self._notify_owner(live)
        self.read_soon(session_id)

    def leave(self, session_id: int) -> None:
        """Follow a session no more; its pages connect again, and find who has it now."""
        live = self.sessions.pop(session_id, None)
        self._unused.pop(session_id, None)
        if live is not None:
            self._close_pages(live)

    def read_soon(self, session_id: int) -> None:
        """Have the log of a session read: there is more of it, or may be."""
        self._hinted.add(session_id)
        self._read_due.set()

    async def read(self) -> None:
        """Read what is new in the logs of followed sessions, of all at once."""
        await self._read_due.wait()
        self._read_due.clear()
        hinted, self._hinted = self._hinted, set()
        wanted = [self.sessions[key] for key in sorted(hinted) if key in self.sessions]
        if not wanted:
            return
        ends = [(live.id, live.aggregate.fold.last_number, live.last_event) for live in wanted]
        found = await self._database.run(read_new_rows, ends)
        for live in wanted:
            new = found.get(live.id)
            if self.sessions.get(live.id) is not live:
                continue
            if new is None or new.owner != live.owner:
                self.leave(live.id)
                continue
            try:
                live.fold_rows(new, timezone.now())
            except Exception:  # it is rebuilt from its log
                log.exception("Session %s could not be followed", live.id)
                self.leave(live.id)
        await asyncio.sleep(READ_PAUSE_S)

    def beat(self, is_gone: Callable[[str], bool]) -> None:
        """Each second: report to owners which pages are here, read logs where no hint came.

        Left are those whose owner is gone, and those that no page looks at any more.
        """
        for live in list(self.sessions.values()):
            self._unused[live.id] = 0 if live.feed.subscribers else self._unused[live.id] + 1
            if is_gone(live.owner) or self._unused[live.id] > UNUSED_BEATS:
                self.leave(live.id)
            else:
                self._notify_owner(live)
                self.read_soon(live.id)
