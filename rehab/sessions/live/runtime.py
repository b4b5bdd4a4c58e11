"""The sessions that run in this process: starts with the server, drains and stops with it."""

from __future__ import annotations

import asyncio
import contextvars
import logging
import threading
import time
from collections import defaultdict
from collections.abc import Callable, Mapping
from typing import Any, Protocol

from asgiref.sync import sync_to_async
from django.conf import settings
from django.db import DatabaseError
from django.utils import timezone

from rehab.people.models import User
from rehab.sessions.live import lease, owners, sources
from rehab.sessions.live.audit_queue import AuditQueue
from rehab.sessions.live.commits import Fenced
from rehab.sessions.live.loading import Loader, find_newest_open
from rehab.sessions.live.owners import OwnedElsewhere
from rehab.sessions.live.routines import Routines
from rehab.sessions.live.servers import Servers
from rehab.sessions.live.session import LiveSession, NotStored, RobotStop
from rehab.sessions.live.supervisor import Supervisor
from rehab.sessions.live.trouble import describe_failure
from rehab.sessions.live.writer import Writer
from rehab.sessions.log import Remark
from rehab.sessions.models import TrainingSession
from rehab.sessions.payloads import Message
from rehab.training.changes import (
    ENDED_STATES,
    OPEN_STATES,
    Change,
    ChangeKind,
    ChangeValue,
    NotAllowed,
    PauseReason,
    State,
)
from rehab.training.controls import CONTROLS
from robot.wire.close_codes import CloseCode

log = logging.getLogger(__name__)


class Draining(NotStored):
    """The server is stopping and opens no session any more."""


class ConnectedDevice(Protocol):
    """A source or robot that is connected, with a session or without one."""

    @property
    def device_id(self) -> int | None:
        """The device's key."""

    def on_session_opened(self, session_id: int) -> None:
        """Attach to a session that was just created for its station, unless it has one."""


class Runtime:
    """All live sessions of one event loop."""

    def __init__(self) -> None:
        self.loop = asyncio.get_running_loop()
        self.sessions: dict[int, LiveSession] = {}
        self.draining = False
        self.is_ready = False  # the sessions of the last run are back
        self.writer = Writer(self._call)
        self.devices: dict[int, set[ConnectedDevice]] = defaultdict(set)  # by station
        self.audit_queue = AuditQueue()
        self.sockets: set[Any] = set()  # closed when the server stops
        self.requests: set[asyncio.Task[None]] = set()  # of pages, under way
        self.supervisor = Supervisor(settings.DATA_DIR / "children.json")
        # Where child processes connect.
        self.address = sources.local_address(settings.HOST, settings.PORT)
        self._loader = Loader()
        self._opening: dict[int, asyncio.Task[None]] = {}
        self._held: set[int] = set()  # sessions that this process may be the owner of
        self._orphaned: set[int] = set()  # sessions of dead processes: paused if they run
        # At locations whose sessions were all dropped.
        self._unlogged_stops: dict[str, RobotStop] = {}
        own = lease.held()
        # The other servers on the database, where there may be any.
        self.servers = Servers(self, own) if own is not None and own.shares else None
        self._left_before: set[int] = set()  # sessions without an owner, a beat ago
        self.routines = Routines(self)

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
        """Return a live session while nobody is subscribing. Raises what ``session`` does.

        Until the next ``await`` it is the one in memory: what is attached to it hears of its end.
        """
        while True:
            live = await self.session(session_id)
            await live.wait_for_subscriptions()
            if self.sessions.get(session_id) is live:
                return live

    async def viewed_session(self, session_id: int) -> LiveSession:
        """Return a live session for a page: one that another server owns is followed.

        Raises what ``session`` does.
        """
        if self.servers is not None and session_id in self.servers.followed:
            return await self.servers.follow(session_id)
        try:
            return await self.session(session_id)
        except OwnedElsewhere:
            if self.servers is None:
                raise
        return await self.servers.follow(session_id)

    def find(self, session_id: int) -> LiveSession | None:
        """Return a session that is in memory, if it is: this process's, or one that it follows."""
        followed = {} if self.servers is None else self.servers.followed
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

    async def give_up(self, session_id: int, slot: str) -> bool:
        """Release a session for a device that waits at another server; return whether that is so.

        It goes where its source is, and without one where its robot is. Nothing is lost: what
        is queued is committed first.
        """
        live = self.sessions.get(session_id)
        is_needed = live is None or live.source is not None or self.draining
        if live is None or is_needed or (slot == "robot" and live.robot is not None):
            return False
        if sources.child_name(session_id) in self.supervisor.children:
            return False  # its source dials in here
        del self.sessions[session_id]  # from here on nobody gets it
        try:
            await live.wait_until_committed()
            epoch = live.aggregate.session.epoch
            return await sync_to_async(owners.hand_on)(session_id, epoch)
        finally:
            if live.robot is not None:
                moved = "The session moved. Connect again."
                live.robot.evict(CloseCode.ELSEWHERE, "elsewhere", moved)
            self.close_pages(live)

    async def drop_taken(self) -> None:
        """Drop the sessions that another server has claimed while this one's lease had expired."""
        there = TrainingSession.everywhere.filter(pk__in=list(self.sessions))
        epochs = dict([row async for row in there.values_list("pk", "epoch")])
        for live in list(self.sessions.values()):
            if epochs.get(live.id, live.aggregate.session.epoch) != live.aggregate.session.epoch:
                self._drop(live, Fenced("Another server has taken the session over."))
                await self.supervisor.stop(sources.child_name(live.id))

    async def _open(self, session_id: int) -> None:
        self._held.add(session_id)
        loaded = await self._loader.load(session_id)
        aggregate, stopped = loaded.aggregate, loaded.robot_stopped
        live = LiveSession(aggregate, self.writer, loaded.recent, self._drop, robot_stopped=stopped)
        if loaded.was_orphaned:
            self._orphaned.add(session_id)
        await self._pause_orphaned(live)
        self._inherit_stops(live)
        self.sessions[session_id] = live
        if self.servers is not None:
            self.servers.leave(session_id)  # it was another's
        if live.aggregate.fold.state in OPEN_STATES and not self.draining:
            await sources.run_source(self.supervisor, aggregate.session, self.address)

    async def _pause_orphaned(self, live: LiveSession) -> None:
        """Pause a session whose process died while it ran.

        If that cannot be stored, it is tried again when the session is loaded next.
        """
        if live.id in self._orphaned:
            if live.is_running:
                pause = Change(ChangeKind.PAUSE, PauseReason.RESTART.value)
                await live.change(pause, None, timezone.now())
                log.warning("Session %s was left running; it is paused now.", live.id)
            self._orphaned.discard(live.id)

    def _inherit_stops(self, live: LiveSession) -> None:
        """Keep robot stops that are not logged yet in force in a session that was just loaded."""
        kept = self._unlogged_stops.pop(live.location, None)
        if kept is not None:
            live.stop_robot(*kept)
        for other in self._others_at_location_of(live):
            if other.robot_stopped and other.unlogged_stop is not None:
                live.stop_robot(*other.unlogged_stop)
            elif other.robot_stopped:  # committed since the log was read
                live.robot_stopped = True

    def _drop(self, live: LiveSession, problem: Exception) -> None:
        """Drop a session that could not be written: its fold is ahead of its log.

        A stop of the robot stays in force: another session of the location keeps it, or the next
        one that is loaded.
        """
        stop, live.unlogged_stop = live.unlogged_stop, None
        if stop is not None:
            heirs = self._others_at_location_of(live)
            for heir in heirs:
                heir.stop_robot(*stop)
            if not heirs:
                self._unlogged_stops[live.location] = stop
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

    async def change(self, session_id: int, kind: str, value: ChangeValue, by: User | None) -> None:
        """Apply a change, here or where the session is; committed when this returns.

        Raises InvalidSetting if it is refused and NotStored if it could not be committed.
        """
        try:
            await self.change_own(session_id, kind, value, by)
        except OwnedElsewhere as problem:
            if self.servers is None:
                raise
            await self.servers.change(problem.owner, session_id, kind, value, by)

    async def change_own(
        self, session_id: int, kind: str, value: ChangeValue, by: User | None
    ) -> None:
        """Apply a change to a session of this process. Raises OwnedElsewhere, too."""
        live = await self.settled_session(session_id)
        if live.source_clock is not None and CONTROLS[kind].leads_to is State.RUNNING:
            live.source_clock.resume(time.monotonic())
        await live.change(Change(kind, value), by, timezone.now())
        if live.aggregate.fold.state not in ENDED_STATES:
            return
        await self.supervisor.stop(sources.child_name(live.id))
        if live.station_id is not None:
            waiting = await sync_to_async(find_newest_open)(live.station_id)
            if waiting is not None:
                self.announce(waiting, live.station_id)

    async def remark(self, session_id: int, what: Remark, value: float | None, by: User) -> None:
        """Log a remark; committed when this returns. Raises what ``change`` raises."""
        try:
            await self.remark_own(session_id, what, value, by)
        except OwnedElsewhere as problem:
            if self.servers is None:
                raise
            await self.servers.remark(problem.owner, session_id, what, value, by)

    async def remark_own(
        self, session_id: int, what: Remark, value: float | None, by: User
    ) -> None:
        """Log a remark of a session of this process. Raises OwnedElsewhere, too."""
        live = await self.settled_session(session_id)
        if live.aggregate.fold.state in ENDED_STATES:
            raise NotAllowed("The session has ended.")
        await live.remark(what, value, by, timezone.now())

    def stop_robots(self, live: LiveSession, by: User | None, told: Message) -> None:
        """Stop the robot of a session of this process, and of the others there, on any server.

        ``told``: which device stopped it, if it was no person.
        """
        for session in self.sessions_at_station_of(live):
            session.stop_robot(by, timezone.now(), told)
        if self.servers is not None and live.station_id is not None:
            self.servers.tell_of_stop(live.station_id, by, told)

    def stop_at(self, station_id: int, by: User | None, told: Message) -> None:
        """Stop the robot of a station, as another server says."""
        for session in list(self.sessions.values()):
            if session.station_id == station_id:
                session.stop_robot(by, timezone.now(), told)

    async def arm_robots(self, live: LiveSession, by: User) -> None:
        """Let the robot of a session of this process move again, once that is committed."""
        there = self.sessions_at_station_of(live)
        await asyncio.gather(*(session.arm_robot(by, timezone.now()) for session in there))

    async def order_own_robot(
        self, session_id: int, order: str, by: User | None, device_id: int | None
    ) -> None:
        """Do what a page at another server orders. Raises what ``session`` raises."""
        live = self.sessions.get(session_id) or await self.session(session_id)
        if order == "stop":
            self.stop_robots(live, by, {} if device_id is None else {"device": device_id})
        elif by is not None:
            await self.arm_robots(live, by)

    def drive_own_robot(self, session_id: int, drive: Mapping[str, float]) -> None:
        """Pass on that a person holds a button to drive the robot to its mark."""
        live = self.sessions.get(session_id)
        if live is not None and live.robot is not None:
            live.robot.tell({"type": "drive", **drive})

    def sessions_at_station_of(self, live: LiveSession) -> list[LiveSession]:
        """Return a session and the other live ones of its station, which share its robot."""
        return [live, *self._others_at_location_of(live)]

    def _others_at_location_of(self, live: LiveSession) -> list[LiveSession]:
        there = self.sessions.values()
        return [one for one in there if one.location == live.location and one is not live]

    def announce(self, session_id: int, station_id: int | None) -> None:
        """Tell a station's devices, wherever they are, that a session has opened."""
        if station_id is None:
            return
        self.announce_here(session_id, station_id)
        if self.servers is not None:
            self.servers.announce(session_id, station_id)

    def announce_here(self, session_id: int, station_id: int) -> None:
        """Tell a station's devices that are connected to this process."""
        for device in list(self.devices.get(station_id, ())):
            device.on_session_opened(session_id)

    def connected_device_ids(self) -> set[int | None]:
        """Return the keys of the sources and robots that are connected. Any thread may ask."""
        return {device.device_id for there in list(self.devices.values()) for device in list(there)}

    async def take_over_left(self) -> None:
        """Take over sessions that run and have had no owner for a beat, or whose owner is gone.

        Those that a server has just handed on are left to the device that asks for them.
        """
        orphaned, handed_on = await sync_to_async(owners.find_ownerless)()
        left = {*orphaned, *handed_on}
        again, self._left_before = left & self._left_before, left
        self._orphaned.update(again.intersection(orphaned))
        if not self.draining:
            await asyncio.gather(*(self._recover(session_id) for session_id in sorted(again)))

    async def recover(self) -> int:
        """Pause the sessions whose process died while they ran; return how many.

        Sessions that a process handed on when it was stopped go on as they are.
        """
        orphaned, handed_on = await sync_to_async(owners.find_ownerless)()
        self._orphaned.update(orphaned)
        await asyncio.gather(*map(self._recover, (*orphaned, *handed_on)))
        self.is_ready = True
        return len(orphaned)

    async def _recover(self, session_id: int) -> None:
        try:
            await self._pause_orphaned(await self.session(session_id))
        except OwnedElsewhere:
            self._orphaned.discard(session_id)  # another server was faster
        except Exception:  # one broken session must not keep the server from starting
            log.exception("Session %s could not be recovered", session_id)

    async def close(self, live: LiveSession) -> None:
        """Unload a session that nobody uses; it can be rebuilt from its log."""
        if live.aggregate.fold.state is State.RUNNING:
            return  # its source may reconnect
        self.sessions.pop(live.id, None)
        try:
            await sync_to_async(owners.release)(live.id, live.aggregate.session.epoch)
            self._held.discard(live.id)
        except DatabaseError:
            log.exception("Session %s could not be released", live.id)  # go on with the others

    async def drain(self) -> None:
        """Close every socket so that clients reconnect, commit everything, stop."""
        self.draining = True
        await self.supervisor.stop_all()
        await self.routines.stop()
        closing = [socket.close_now(CloseCode.RESTARTING) for socket in list(self.sockets)]
        await asyncio.gather(*closing, self.audit_queue.join(), return_exceptions=True)
        await asyncio.gather(*self._opening.values(), return_exceptions=True)
        await asyncio.gather(*self.requests, return_exceptions=True)
        await self.loop.run_in_executor(None, self.writer.close)
        await asyncio.sleep(0)  # the writer's last reports
        self.sessions.clear()
        try:
            await sync_to_async(owners.release_all)(self._held)
        except DatabaseError:
            log.exception("Sessions could not be released; they come back paused")
        if self.servers is not None:
            await self.servers.close()


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
