"""The sessions that run in this process: starts with the server, drains and stops with it."""

from __future__ import annotations

import asyncio
import contextvars
import logging
import threading
from collections import Counter
from collections.abc import Awaitable, Callable, Coroutine
from typing import Any

from asgiref.sync import sync_to_async
from django.conf import settings
from django.db import DatabaseError

from rehab.sessions.live.audit_queue import AuditQueue
from rehab.sessions.live.clinics import OwnedClinics
from rehab.sessions.live.database import clinic_owners, server_lease
from rehab.sessions.live.database.trouble import NotStored, describe_failure
from rehab.sessions.live.devices import Devices
from rehab.sessions.live.orders import Order, carry_out
from rehab.sessions.live.peer_servers import Servers
from rehab.sessions.live.periodic_tasks import Routines
from rehab.sessions.live.recovery import Recovery
from rehab.sessions.live.session.commit_transaction import Fenced
from rehab.sessions.live.session.group_commit import Writer
from rehab.sessions.live.session.live_session import LiveSession
from rehab.sessions.live.session.loading import Loader
from rehab.sessions.live.station_robots import StationRobots
from rehab.sessions.live.supervisor import Supervisor, local_address, run_source, source_name
from robot.wire.close_codes import CloseCode

log = logging.getLogger(__name__)

FINISH_S = 5.0  # in a drain


class Draining(NotStored):
    """The server is stopping and opens no session any more."""


class Runtime:
    """All live sessions of one event loop."""

    def __init__(self) -> None:
        self.loop = asyncio.get_running_loop()
        self.sessions: dict[int, LiveSession] = {}
        self.draining = False
        self.is_ready = False  # the sessions of the last run are back
        self.writer = Writer(self._call)
        self.devices = Devices()
        self.robots = StationRobots(self.sessions)
        self.recovery = Recovery(self)
        self.audit_queue = AuditQueue()
        self.sockets: set[Any] = set()  # closed when the server stops
        self.sockets_of: Counter[int] = Counter()  # clinics
        self.requests: set[asyncio.Task[None]] = set()  # of pages, under way
        self.supervisor = Supervisor(settings.DATA_DIR / "children.json")
        # Where child processes connect.
        self.address = local_address(settings.HOST, settings.PORT)
        self.clinics = OwnedClinics(self.recovery.load)
        self._loader = Loader(self.clinics.own)
        self._opening: dict[int, asyncio.Task[None]] = {}
        own = server_lease.held()
        # The other servers on the database, where there may be any.
        self.servers = Servers(self, self.recovery, own) if own is not None else None
        self.routines = Routines(self)

    @property
    def may_move_robots(self) -> bool:
        """Whether no other server may have taken the clinics."""
        return self.servers is None or self.servers.may_move_robots

    def _call(self, function: Callable[[], None]) -> None:
        self.loop.call_soon_threadsafe(function)

    async def session(self, session_id: int) -> LiveSession:
        """Return a live session, rebuilt from its log where it is not in memory.

        Raises TrainingSession.DoesNotExist, OwnedElsewhere, DamagedLog, Draining, and NotStored
        where a change that it needs could not be committed.
        """
        while (live := self.sessions.get(session_id)) is None:
            if self.draining:
                raise Draining("The server restarts. Try again in a moment.")
            if session_id not in self._opening:
                # Its own context: a request's ends with the request, and others wait for this too.
                self._opening[session_id] = self.loop.create_task(
                    self._open(session_id), context=contextvars.Context()
                )
            try:
                await asyncio.shield(self._opening[session_id])
            finally:
                task = self._opening.get(session_id)
                if task is not None and task.done():
                    del self._opening[session_id]
        live.recently_used = True
        return live

    async def settled_session(self, session_id: int) -> LiveSession:
        """Return a live session while none is subscribing to it. Raises what ``session`` does.

        Until the next ``await`` it is the one in memory: what attaches to it learns of its end.
        """
        while True:
            live = await self.session(session_id)
            await live.gate.wait()
            if self.sessions.get(session_id) is live:
                return live

    async def _open(self, session_id: int) -> None:
        loaded = await self._loader.load(session_id)
        live = LiveSession(
            loaded.aggregate,
            loaded.epoch,
            self.writer,
            loaded.recent,
            self.drop,
            robot_stopped=loaded.robot_stopped,
        )
        await self.recovery.pause_orphaned(live)
        if self.clinics.epochs.get(live.clinic_id) != live.epoch:
            return  # another server may have the clinic by now: who asks for it finds out
        self.robots.restore_stops(live)
        self.sessions[session_id] = live
        if live.is_open and not self.draining:
            await run_source(self.supervisor, live.aggregate.session, self.address)

    def drop(self, live: LiveSession, problem: Exception) -> None:
        """Drop a session that could not be written: its fold is ahead of its log.

        A stop of the robot stays in force. Where another process has the clinic, all of it is lost.
        """
        if isinstance(problem, Fenced) and self.clinics.epochs.get(live.clinic_id) == live.epoch:
            self.lose(live.clinic_id)
            return
        self.robots.pass_stop_on(live)
        if self.sessions.get(live.id) is live:
            log.error("Session %s is rebuilt from its log: %s", live.id, problem)
            del self.sessions[live.id]
        for peer in (live.source, live.robot):
            if peer is not None:
                peer.evict(CloseCode.NOT_STORED, "not_stored", describe_failure(problem))
        for socket in list(self.sockets):
            if getattr(socket, "live", None) is live:
                socket.close_soon(CloseCode.RESTARTING)

    def lose(self, clinic_id: int) -> None:
        """Drop a clinic that another process has taken: its clients connect again, and find it."""
        self.clinics.forget(clinic_id)
        for live in self._sessions_of(clinic_id):
            self.drop(live, Fenced("Another process has taken the clinic over."))
            self.recovery.forget(live.id)
            self._run(self.supervisor.stop(source_name(live.id)))
        for socket in list(self.sockets):
            if socket.clinic_id == clinic_id:
                socket.close_soon(CloseCode.RESTARTING)

    async def give_up(self, clinic_id: int) -> None:
        """Release a clinic without an open session, so that it moves to where it belongs."""
        lives = self._sessions_of(clinic_id)
        if any(live.is_open for live in lives):
            return
        for live in lives:
            del self.sessions[live.id]  # from here on it is closed to everyone
        there = [socket for socket in self.sockets if socket.clinic_id == clinic_id]
        await self.clinics.release(
            clinic_id,
            _finish(*(self.supervisor.stop(source_name(live.id)) for live in lives)),
            _finish(*(socket.close_now(CloseCode.RESTARTING) for socket in there)),
            _finish(*(live.wait_until_committed() for live in lives)),
        )

    def _sessions_of(self, clinic_id: int) -> list[LiveSession]:
        return [live for live in self.sessions.values() if live.clinic_id == clinic_id]

    def _run(self, work: Coroutine[Any, Any, None]) -> None:
        task = self.loop.create_task(work, context=contextvars.Context())
        self.requests.add(task)
        task.add_done_callback(self.requests.discard)

    async def order(self, session_id: int, order: Order) -> None:
        """Carry out an order; it is committed when this returns.

        Raises InvalidSetting if it is refused, NotStored if it could not be committed, and
        OwnedElsewhere where the clinic lives in another process.
        """
        await carry_out(self, session_id, order)

    def announce(self, session_id: int, station_id: int | None) -> None:
        """Notify a station's devices of a session that has opened."""
        if station_id is not None:
            self.devices.announce(session_id, station_id)

    async def recover(self) -> int:
        """Pause the sessions whose process died while they ran; return how many.

        Sessions of clinics that a process released when it was stopped go on as they are.
        """
        paused = await self.recovery.recover()
        self.is_ready = True
        if (own := server_lease.held()) is not None:
            own.is_ready = True
        return paused

    async def close(self, live: LiveSession) -> None:
        """Unload a session that is not in use; it can be rebuilt from its log."""
        if live.is_running:
            return  # its source may reconnect
        self.sessions.pop(live.id, None)
        await sync_to_async(clinic_owners.note_ends)([live.id])

    async def close_unused_clinics(self) -> None:
        """Release the clinics of which nobody is here."""
        used = {live.clinic_id for live in self.sessions.values()}
        used |= {socket.clinic_id for socket in self.sockets}
        for clinic_id in self.clinics.find_unused() - used:
            await self.clinics.release(clinic_id)

    async def drain(self) -> None:
        """Close every socket so that clients reconnect, commit everything, stop."""
        self.draining = True
        if (own := server_lease.held()) is not None:
            own.is_ready = False
        await self.supervisor.stop_all()
        await self.routines.stop()
        closing = [socket.close_now(CloseCode.RESTARTING) for socket in list(self.sockets)]
        await _finish(*closing, self.audit_queue.join())
        await _finish(*self._opening.values())
        await _finish(*self.requests)
        await self.loop.run_in_executor(None, self.writer.close)
        await asyncio.sleep(0)  # the writer's last reports
        if self.servers is not None:
            await self.servers.close()
        left = list(self.sessions)
        self.sessions.clear()
        try:
            await sync_to_async(clinic_owners.note_ends)(left)
            await self.clinics.release_all()
        except DatabaseError:
            log.exception("Clinics could not be released; their sessions come back paused")


async def _finish(*work: Awaitable[Any]) -> None:
    """Wait until work is done, for FINISH_S at most.

    An unresponsive client or a hanging query must not prevent sessions from being handed on.
    """
    await asyncio.wait([asyncio.gather(*work, return_exceptions=True)], timeout=FINISH_S)


_current: Runtime | None = None
_lock = threading.Lock()


def current() -> Runtime:
    """Return the running loop's runtime, created on first use."""
    global _current  # noqa: PLW0603 (one runtime a process is the point)
    loop = asyncio.get_running_loop()
    with _lock:
        if _current is None or _current.loop is not loop:
            _current = Runtime()
        return _current


def peek() -> Runtime | None:
    """Return the process's runtime, or None; callable from any thread."""
    return _current if _current is not None and not _current.draining else None
