"""The sessions that run in this process: starts with the server, drains and stops with it."""

from __future__ import annotations

import asyncio
import contextvars
import logging
import threading
from collections.abc import Awaitable, Callable
from typing import Any

from asgiref.sync import sync_to_async
from django.conf import settings
from django.db import DatabaseError

from rehab.people.models import User
from rehab.sessions.live.audit_queue import AuditQueue
from rehab.sessions.live.database import lease, owners
from rehab.sessions.live.database.owners import OwnedElsewhere
from rehab.sessions.live.database.trouble import NotStored, describe_failure
from rehab.sessions.live.devices import Devices
from rehab.sessions.live.orders import Order, carry_out
from rehab.sessions.live.recovery import Recovery
from rehab.sessions.live.routines import Routines
from rehab.sessions.live.servers.servers import Servers
from rehab.sessions.live.session.group_commit import Writer
from rehab.sessions.live.session.live_session import LiveSession
from rehab.sessions.live.session.loading import Loader
from rehab.sessions.live.station_robots import StationRobots
from rehab.sessions.live.supervisor import Supervisor, local_address, run_source
from rehab.sessions.payloads import Message
from rehab.training.changes import OPEN_STATES, State
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
        self.requests: set[asyncio.Task[None]] = set()  # of pages, under way
        self.supervisor = Supervisor(settings.DATA_DIR / "children.json")
        # Where child processes connect.
        self.address = local_address(settings.HOST, settings.PORT)
        self._loader = Loader()
        self._opening: dict[int, asyncio.Task[None]] = {}
        self._held: set[int] = set()  # sessions that this process may be the owner of
        own = lease.held()
        # The other servers on the database, where there may be any.
        self.servers = Servers(self, self.recovery, own) if own is not None and own.shares else None
        self.routines = Routines(self, self.servers)

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

    async def viewed_session(self, session_id: int) -> LiveSession:
        """Return a live session for a page: one that another server owns is followed.

        Raises what ``session`` does.
        """
        if self.servers is not None and session_id in self.servers.followed.sessions:
            return await self.servers.followed.follow(session_id)
        try:
            return await self.session(session_id)
        except OwnedElsewhere:
            if self.servers is None:
                raise
        return await self.servers.followed.follow(session_id)

    def find(self, session_id: int) -> LiveSession | None:
        """Return a session if it is in memory: this process's own, or one that it follows."""
        followed = {} if self.servers is None else self.servers.followed.sessions
        return self.sessions.get(session_id) or followed.get(session_id)

    async def session_for_device(self, session_id: int, slot: str) -> LiveSession:
        """Return a live session for a source or robot, asking another owner to give it up.

        Raises what ``session`` does.
        """
        try:
            return await self.settled_session(session_id)
        except OwnedElsewhere as problem:
            owner = problem.owner
            if self.servers is None or not await self.servers.ask_for(owner, session_id, slot):
                raise
        return await self.settled_session(session_id)

    async def _open(self, session_id: int) -> None:
        self._held.add(session_id)
        loaded = await self._loader.load(session_id)
        aggregate, stopped = loaded.aggregate, loaded.robot_stopped
        live = LiveSession(aggregate, self.writer, loaded.recent, self.drop, robot_stopped=stopped)
        await self.recovery.pause_orphaned(live, loaded.owned_before)
        self.robots.restore_stops(live)
        self.sessions[session_id] = live
        if self.servers is not None:
            self.servers.followed.leave(session_id)  # it was another's
        if live.aggregate.fold.state in OPEN_STATES and not self.draining:
            await run_source(self.supervisor, aggregate.session, self.address)

    def drop(self, live: LiveSession, problem: Exception) -> None:
        """Drop a session that could not be written: its fold is ahead of its log.

        A stop of the robot stays in force.
        """
        self.robots.pass_stop_on(live)
        if self.sessions.get(live.id) is live:
            log.error("Session %s is rebuilt from its log: %s", live.id, problem)
            del self.sessions[live.id]
        for peer in (live.source, live.robot):
            if peer is not None:
                peer.evict(CloseCode.NOT_STORED, "not_stored", describe_failure(problem))
        self.close_pages(live)

    def close_pages(self, live: LiveSession) -> None:
        """Close a session's sockets: their clients connect again, and find who has it now."""
        for socket in list(self.sockets):
            if getattr(socket, "live", None) is live:
                socket.close_soon(CloseCode.RESTARTING)

    async def order(self, session_id: int, order: Order) -> None:
        """Carry out an order, here or where the session is; committed when this returns.

        Raises InvalidSetting if it is refused and NotStored if it could not be committed.
        """
        try:
            await carry_out(self, session_id, order)
        except OwnedElsewhere as problem:
            if self.servers is None:
                raise
            await self.servers.order(problem.owner, session_id, order)

    def stop_robots(self, live: LiveSession, by: User | None, details: Message) -> None:
        """Stop the robot of a session of this process, and of the others there, on any server.

        ``details``: which device stopped it, if it was no person.
        """
        self.robots.stop(live, by, details, again=self.servers is not None)
        if self.servers is not None and live.station_id is not None:
            self.servers.announce_stop(live.station_id, by, details)

    def announce(self, session_id: int, station_id: int | None) -> None:
        """Notify a station's devices, at any server, of a session that has opened."""
        if station_id is None:
            return
        self.devices.announce(session_id, station_id)
        if self.servers is not None:
            self.servers.announce(session_id, station_id)

    async def recover(self) -> int:
        """Pause the sessions whose process died while they ran; return how many.

        Sessions that a process handed on when it was stopped go on as they are.
        """
        paused = await self.recovery.recover()
        self.is_ready = True
        return paused

    async def close(self, live: LiveSession) -> None:
        """Unload a session that is not in use; it can be rebuilt from its log."""
        if live.aggregate.fold.state is State.RUNNING:
            return  # its source may reconnect
        self.sessions.pop(live.id, None)
        self._held.discard(live.id)  # at once: it may open again before it is released
        try:
            await sync_to_async(owners.release)(live.id, live.aggregate.session.epoch)
        except DatabaseError:
            self._held.add(live.id)
            log.exception("Session %s could not be released", live.id)  # go on with the others

    async def drain(self) -> None:
        """Close every socket so that clients reconnect, commit everything, stop."""
        self.draining = True
        await self.supervisor.stop_all()
        await self.routines.stop()
        closing = [socket.close_now(CloseCode.RESTARTING) for socket in list(self.sockets)]
        await _finish(*closing, self.audit_queue.join())
        await _finish(*self._opening.values())
        await _finish(*self.requests)
        await self.loop.run_in_executor(None, self.writer.close)
        await asyncio.sleep(0)  # the writer's last reports
        self.sessions.clear()
        try:
            await sync_to_async(owners.release_all)(self._held)
        except DatabaseError:
            log.exception("Sessions could not be released; they come back paused")
        if self.servers is not None:
            await self.servers.close()


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
