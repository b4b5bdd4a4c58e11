"""The sessions that run in this process: starts with the server, drains and stops with it."""

from __future__ import annotations

import asyncio
import contextvars
import gc
import logging
import sys
import threading
import time
from collections import defaultdict
from collections.abc import Awaitable, Callable
from typing import Any

from asgiref.sync import sync_to_async
from django.conf import settings
from django.db import DatabaseError, connection
from django.utils import timezone

from rehab.people.models import User
from rehab.sessions.events import to_text
from rehab.sessions.live import owners, sources
from rehab.sessions.live.audit_queue import Notes
from rehab.sessions.live.auth import find_unwelcome, keep_signed_in
from rehab.sessions.live.loading import find_newest_open, load
from rehab.sessions.live.session import LiveSession, Stop
from rehab.sessions.live.supervisor import Children
from rehab.sessions.live.writer import Writer
from rehab.sessions.log import Remark
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
from rehab.training.controls import CONTROLS, Audience
from robot.wire.close_codes import CloseCode
from robot.wire.limits import PAGE_HEARTBEAT_S, ROBOT_HEARTBEAT_S

log = logging.getLogger(__name__)

# Robot heartbeats between those of pages; then idle sessions go, and sign-ins are looked at.
SWEEP = round(PAGE_HEARTBEAT_S / ROBOT_HEARTBEAT_S)
CHECKPOINT = 8  # heartbeats
HEARTBEAT = to_text({"type": "heartbeat"})
# Python's full collections take 200 ms with 2,000 sockets (docs/reference/stack.md#live-path): make
# them rare.
GC_THRESHOLDS = (50_000, 50, 100)
# How long the event loop may keep the interpreter's lock while the writer wants it (default 5 ms).
SWITCH_S = 0.002


class Runtime:
    """All live sessions of one event loop."""

    def __init__(self) -> None:
        self.loop = asyncio.get_running_loop()
        self.sessions: dict[int, LiveSession] = {}
        self.draining = False
        self.writer = Writer(self._call)
        # Told when a session opens at their station.
        self.waiting: dict[int, set[Callable[[int], None]]] = defaultdict(set)
        self.notes = Notes()
        self.sockets: set[Any] = set()  # whoever must be closed when the server stops
        self.asked: set[asyncio.Task[None]] = set()  # what pages asked for and is under way
        self.children = Children(settings.DATA_DIR / "children.json")
        self.address = sources.local_address(settings.HOST, settings.PORT)  # where children dial in
        self._opening: dict[int, asyncio.Task[None]] = {}
        self._left: set[int] = set()  # by processes that died: to be paused if they run
        self._unlogged_stops: dict[str, Stop] = {}  # at places whose sessions were all dropped
        # Each is a task of its own: robots stop when nothing is heard, so no heartbeat may wait
        # for the disk, whatever else does.
        self.routines = [
            self.loop.create_task(self._repeat(beats, work), context=contextvars.Context())
            for beats, work in (
                (1, self._beat_for_robots),
                (SWEEP, self._beat_for_pages),
                (SWEEP, self._close_idle),
                (SWEEP, self._look_after_sign_ins),
                (CHECKPOINT, self._move_log),
            )
        ]

    def _call(self, function: Callable[[], None]) -> None:
        self.loop.call_soon_threadsafe(function)

    async def session(self, session_id: int) -> LiveSession:
        """Give a live session, rebuilt from its log where it is not in memory.

        Raises TrainingSession.DoesNotExist, OwnedElsewhere, and NotStored where a change that it
        needs could not be committed.
        """
        while (live := self.sessions.get(session_id)) is None:
            if session_id not in self._opening:
                # A context of its own: a request's ends with the request, others wait for this too.
                self._opening[session_id] = self.loop.create_task(
                    self._open(session_id), context=contextvars.Context()
                )
            try:
                await asyncio.shield(self._opening[session_id])
            finally:
                task = self._opening.get(session_id)
                if task is not None and task.done():
                    del self._opening[session_id]
        live.asked_for = True
        return live

    async def admitted(self, session_id: int) -> LiveSession:
        """Give a live session at a moment when no subscriber joins it. Raises what ``session`` does.

        Until the next ``await`` it is the one in memory: what is attached to it is told of its end.
        """
        while True:
            live = await self.session(session_id)
            await live.admission()
            if self.sessions.get(session_id) is live:
                return live

    async def _open(self, session_id: int) -> None:
        loaded = await sync_to_async(load)(session_id)
        actor, stopped = loaded.actor, loaded.robot_stopped
        live = LiveSession(actor, self.writer, loaded.recent, self._drop, robot_stopped=stopped)
        if loaded.was_left:
            self._left.add(session_id)
        await self._pause_left(live)
        self._take_over_stops(live)
        self.sessions[session_id] = live
        if live.actor.fold.state in OPEN_STATES and not self.draining:
            await sources.run_source(self.children, actor.session, self.address)

    async def _pause_left(self, live: LiveSession) -> None:
        """Pause a session that the process before left running when it died.

        What could not be stored is tried again when the session is next loaded.
        """
        if live.id in self._left:
            if live.is_running:
                pause = Change(ChangeKind.PAUSE, PauseReason.RESTART.value)
                await live.change(pause, None, timezone.now())
                log.warning("Session %s was left running; it is paused now.", live.id)
            self._left.discard(live.id)

    def _take_over_stops(self, live: LiveSession) -> None:
        """Let a stop hold in a session that has just been loaded, though no log has it yet."""
        kept = self._unlogged_stops.pop(live.place, None)
        if kept is not None:
            live.stop_robot(*kept)
        for other in self._others_at_place_of(live):
            if other.robot_stopped and other.unlogged_stop is not None:
                live.stop_robot(*other.unlogged_stop)
            elif other.robot_stopped:  # committed since the log was read
                live.robot_stopped = True

    def _drop(self, live: LiveSession, problem: Exception) -> None:
        """Forget a session that could not be written: its log is right, its fold is not.

        But for a stop of the robot, which holds all the same: another session of the place keeps
        it, or the next one that is loaded.
        """
        stop, live.unlogged_stop = live.unlogged_stop, None
        if stop is not None:
            heirs = self._others_at_place_of(live)
            for heir in heirs:
                heir.stop_robot(*stop)
            if not heirs:
                self._unlogged_stops[live.place] = stop
        if self.sessions.get(live.id) is live:
            log.error("Session %s is rebuilt from its log: %s", live.id, problem)
            del self.sessions[live.id]
        for peer in (live.source, live.robot):
            if peer is not None:
                peer.send_away(
                    CloseCode.NOT_STORED, "not_stored", "A step could not be stored. Connect again."
                )
        for socket in list(self.sockets):
            if getattr(socket, "live", None) is live:
                socket.close_soon(CloseCode.RESTARTING)

    async def change(self, session_id: int, kind: str, value: ChangeValue, by: User | None) -> None:
        """Start, pause, steer or end a session; committed when this returns.

        Raises InvalidSetting where it is refused and NotStored where it could not be committed.
        """
        live = await self.admitted(session_id)
        if live.source_clock is not None and CONTROLS[kind].leads_to is State.RUNNING:
            live.source_clock.slacken(time.monotonic())
        await live.change(Change(kind, value), by, timezone.now())
        if live.actor.fold.state not in ENDED_STATES:
            return
        await self.children.stop(sources.child_name(live.id))
        if live.station_id is not None:
            waiting = await sync_to_async(find_newest_open)(live.station_id)
            if waiting is not None:
                self.announce(waiting, live.station_id)

    async def remark(self, session_id: int, what: Remark, value: float | None, by: User) -> None:
        """Note something of a session; committed when this returns. Raises what ``change`` does."""
        live = await self.admitted(session_id)
        if live.actor.fold.state in ENDED_STATES:
            raise NotAllowed("The session has ended.")
        await live.remark(what, value, by, timezone.now())

    def at_station_of(self, live: LiveSession) -> list[LiveSession]:
        """Give a session and the other live ones of its station: the robot may be with them."""
        return [live, *self._others_at_place_of(live)]

    def _others_at_place_of(self, live: LiveSession) -> list[LiveSession]:
        there = self.sessions.values()
        return [one for one in there if one.place == live.place and one is not live]

    def announce(self, session_id: int, station_id: int | None) -> None:
        """Tell the devices of a station that a session is there for them."""
        if station_id is not None:
            for tell in list(self.waiting.get(station_id, ())):
                tell(session_id)

    async def recover(self) -> int:
        """Pause the sessions that a process left running when it died. Give how many."""
        left = await sync_to_async(owners.find_left_running)()
        self._left.update(left)
        for session_id in left:
            try:
                await self._pause_left(await self.session(session_id))
            except Exception:  # one broken session keeps no server from starting
                log.exception("Session %s could not be recovered", session_id)
        return len(left)

    async def _repeat(self, beats: int, work: Callable[[], Awaitable[None]]) -> None:
        """Do something again and again. Where it fails that is logged, and it is tried again."""
        while True:
            await asyncio.sleep(beats * ROBOT_HEARTBEAT_S)
            try:
                await work()
            except Exception:
                log.exception("What is done every %.2f s failed", beats * ROBOT_HEARTBEAT_S)

    async def _beat_for_robots(self) -> None:
        for live in self.sessions.values():
            if live.robot is not None:
                live.robot.tell({"type": "heartbeat", "watched": live.is_watched})

    async def _beat_for_pages(self) -> None:
        for live in self.sessions.values():
            presence = live.presence(timezone.now())
            quality = to_text({"type": "heartbeat", "presence": presence})
            for subscriber in live.feed.subscribers:
                subscriber.queue_heartbeat(
                    quality if subscriber.audience is Audience.MONITOR else HEARTBEAT
                )

    async def _close_idle(self) -> None:
        for live in list(self.sessions.values()):
            if self.sessions.get(live.id) is live and live.is_idle and not live.asked_for:
                await self._close(live)
            live.asked_for = False  # whoever gets it now has until the next sweep to join

    async def _move_log(self) -> None:
        await self.loop.run_in_executor(None, _checkpoint)

    async def _look_after_sign_ins(self) -> None:
        """Keep people signed in while their page shows a training that runs; end the sockets of
        devices and people that would no longer be let in.
        """
        sockets = [socket for socket in self.sockets if socket.actor is not None]
        running = [one.scope for one in sockets if one.live is not None and one.live.is_running]
        await keep_signed_in(running, timezone.now())
        admitted = [(one.actor, one.scope) for one in sockets]
        for index in await find_unwelcome(admitted, timezone.now()):
            sockets[index].send_off()

    async def _close(self, live: LiveSession) -> None:
        """Take a session that nobody needs out of memory; its log brings it back."""
        if live.actor.fold.state is State.RUNNING:
            return  # its source may be back in a moment
        self.sessions.pop(live.id, None)
        try:
            await sync_to_async(owners.release)(live.id, live.actor.session.epoch)
        except DatabaseError:
            log.exception("Session %s could not be given up", live.id)  # others can

    async def drain(self) -> None:
        """Close every socket so that clients come back, commit everything, stop."""
        self.draining = True
        await self.children.stop_all()
        for routine in self.routines:
            routine.cancel()
        await asyncio.gather(*self.routines, return_exceptions=True)
        closing = [socket.shut(CloseCode.RESTARTING) for socket in list(self.sockets)]
        await asyncio.gather(*closing, self.notes.settled(), return_exceptions=True)
        await asyncio.gather(*self.asked, return_exceptions=True)
        await self.loop.run_in_executor(None, self.writer.close)
        await asyncio.sleep(0)  # the writer's last reports
        held = [(live.id, live.actor.session.epoch) for live in self.sessions.values()]
        self.sessions.clear()
        await sync_to_async(owners.release_all)(held)


def _checkpoint() -> None:
    """Move SQLite's log into its file, on a connection of its own: commits go on meanwhile."""
    if connection.vendor != "sqlite":
        return
    try:
        with connection.cursor() as cursor:
            cursor.execute("PRAGMA wal_checkpoint(PASSIVE)")
    except DatabaseError as problem:
        log.warning("The database's log could not be moved: %s", problem)
    finally:
        connection.close()


_current: Runtime | None = None
_lock = threading.Lock()


def current() -> Runtime:
    """Give the running loop's runtime; made on first use, so that any server will do."""
    global _current  # noqa: PLW0603 (one runtime a process is the point)
    loop = asyncio.get_running_loop()
    with _lock:
        if _current is None or _current.loop is not loop:
            _current = Runtime()
        return _current


def peek() -> Runtime | None:
    """Give the process's runtime if there is one, from any thread."""
    return _current if _current is not None and not _current.draining else None


def tune_interpreter() -> None:
    """Make pauses rare: of the garbage collector, and of the writer waiting for the lock."""
    sys.setswitchinterval(SWITCH_S)
    gc.collect()
    gc.freeze()
    gc.set_threshold(*GC_THRESHOLDS)
