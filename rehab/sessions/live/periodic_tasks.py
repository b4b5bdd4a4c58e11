"""The periodic tasks of a runtime: heartbeats, sweeps, checkpoints, seals."""

from __future__ import annotations

import asyncio
import contextvars
import logging
from collections.abc import Awaitable, Callable, Sequence
from typing import Any

from channels.db import database_sync_to_async
from django.db.models import Q
from django.utils import timezone

from rehab.outbox.delivery import deliver_due, is_due
from rehab.people.audit.seals import seal_logs
from rehab.people.upkeep_runs import record_tasks
from rehab.sessions.events.event import to_text
from rehab.sessions.live.auth import extend_sign_ins, find_unauthorized, note_heard
from rehab.sessions.live.database import clinic_owners
from rehab.sessions.live.database.trouble import WORDS, Trouble
from rehab.sessions.live.host import Host
from rehab.sessions.live.process import end_tasks, move_database_log
from rehab.sessions.live.session.prometheus_metrics import LOOP_LATE_S, TASK_FAILURES
from rehab.sessions.ownership import ClinicOwner
from rehab.sessions.seals import PAUSE_S, seal_sessions
from rehab.stations.models import Device
from rehab.training.controls import Audience
from robot.wire.limits import PAGE_HEARTBEAT_S, ROBOT_HEARTBEAT_S

log = logging.getLogger(__name__)

# Robot heartbeats between those of pages, sweeps of idle sessions and checks of sign-ins.
PAGE_BEATS = round(PAGE_HEARTBEAT_S / ROBOT_HEARTBEAT_S)
SWEEP = 5 * PAGE_BEATS
CHECKPOINT = 8  # heartbeats
OUTBOX = round(5 / ROBOT_HEARTBEAT_S)
SEAL = round(600 / ROBOT_HEARTBEAT_S)
# Of the robots, one after the other: a thousand at once hold up steps (docs/performance.md).
PARTS = 3
CHECKED_SOCKETS = 100  # sign-ins that are checked at once
CHECK_PAUSE_S = 0.1  # between these: 4,000 sockets within 4 s
HEARTBEAT = to_text({"type": "heartbeat"})
# By whether a PT's page is open.
ROBOT_HEARTBEATS = [to_text({"type": "heartbeat", "watched": one}) for one in (False, True)]


class Routines:
    """One task each: robots stop without heartbeats, so none may wait for the disk."""

    def __init__(self, host: Host) -> None:
        self._host = host
        self._loop = asyncio.get_running_loop()
        self._beat = 0
        self._part = 0
        self._trouble = Trouble.NONE  # as it was announced last
        self._problems: dict[str, str] = {}  # of each task's last run; "" where there was none
        self._recorded: dict[str, str] = {}
        self.tasks = [
            self._loop.create_task(self._repeat(beats, work), context=contextvars.Context())
            for beats, work in (
                (1 / PARTS, self._send_robot_heartbeats),
                (1, self._watch_storage),
                (1, self._send_page_heartbeats),
                (SWEEP, self._close_idle),
                (SWEEP, self.check_sign_ins),
                (CHECKPOINT, self._checkpoint_log),
                (SEAL, self._seal_logs),
                (OUTBOX, self._deliver),
                (OUTBOX, self._record_problems),
            )
        ]

    async def stop(self) -> None:
        """End all of them."""
        await end_tasks(self.tasks)

    async def _repeat(self, beats: float, work: Callable[[], Awaitable[None]]) -> None:
        """Call a function periodically; log and count its failures and go on."""
        name = work.__name__.strip("_")
        failures = TASK_FAILURES.labels(name)  # 0 until one fails
        while True:
            due_s = self._loop.time() + beats * ROBOT_HEARTBEAT_S
            await asyncio.sleep(beats * ROBOT_HEARTBEAT_S)
            LOOP_LATE_S.observe(self._loop.time() - due_s)
            try:
                await work()
                self._problems[name] = ""
            except Exception as problem:
                failures.inc()
                self._problems[name] = repr(problem)
                log.exception("A periodic task (every %.2f s) failed", beats * ROBOT_HEARTBEAT_S)

    async def _send_robot_heartbeats(self) -> None:
        """Send heartbeats to a part of the robots: to all of them within an interval.

        None where another server may have taken the clinics: then robots stand still.
        """
        if not self._host.may_move_robots:
            return
        self._part = (self._part + 1) % PARTS
        for live in self._host.sessions.values():
            if live.id % PARTS == self._part and live.robot is not None:
                live.robot.outbox.queue_text(ROBOT_HEARTBEATS[live.is_watched])

    async def _watch_storage(self) -> None:
        """Report to monitors, robots and the log when steps cannot be stored, and when they can."""
        trouble = self._host.writer.trouble
        if trouble == self._trouble:
            return
        self._trouble = trouble
        log.error("%s", WORDS.get(trouble, "Steps are stored again."))
        for live in self._host.sessions.values():
            live.announce_storage(timezone.now())

    async def _send_page_heartbeats(self) -> None:
        """Send heartbeats to the pages of some sessions: of all of them within an interval.

        Who is connected, and how long ago it was heard, goes along once a sweep.
        """
        self._beat = (self._beat + 1) % SWEEP
        for live in self._host.sessions.values():
            if (live.id - self._beat) % PAGE_BEATS or not live.feed.subscribers:
                continue
            quality = HEARTBEAT
            if live.id % SWEEP == self._beat:
                presence = live.presence(timezone.now())
                quality = to_text({"type": "heartbeat", "presence": presence})
            for subscriber in live.feed.subscribers:
                if subscriber.audience is Audience.ROBOT:
                    continue  # robots have their own
                text = quality if subscriber.audience is Audience.MONITOR else HEARTBEAT
                is_silent = not subscriber.was_sent_something(within_s=PAGE_HEARTBEAT_S / 2)
                if text is not HEARTBEAT or is_silent:
                    subscriber.queue_heartbeat(text)

    async def _close_idle(self) -> None:
        for live in list(self._host.sessions.values()):
            if self._host.sessions.get(live.id) is live and live.is_idle and not live.recently_used:
                await self._host.close(live)
            live.recently_used = False  # who gets it now has until the next sweep to subscribe
        await self._host.close_unused_clinics()

    async def _checkpoint_log(self) -> None:
        await self._loop.run_in_executor(None, move_database_log)

    async def _seal_logs(self) -> None:
        await database_sync_to_async(seal_logs)(timezone.now())
        own = ClinicOwner.everywhere.filter(owner__in=("", clinic_owners.own_name()))
        mine = Q(clinic__in=own.values("clinic"))
        # In a thread apart: it pauses between batches, and pages must not wait for it.
        seal = database_sync_to_async(seal_sessions, thread_sensitive=False)
        await seal(timezone.now(), mine, PAUSE_S)

    async def _deliver(self) -> None:
        if not await database_sync_to_async(is_due)(timezone.now()):
            return
        # In a thread apart: a receiver may take seconds to answer, and pages must not wait for it.
        await database_sync_to_async(deliver_due, thread_sensitive=False)(timezone.now())

    async def _record_problems(self) -> None:
        """Store which tasks fail, and which no longer do, where `doctor` finds it."""
        changed = dict(self._problems.items() - self._recorded.items())
        if changed:
            await database_sync_to_async(record_tasks)(changed, timezone.now())
            self._recorded |= changed

    async def check_sign_ins(self) -> None:
        """Extend sign-ins at a running session; close sockets that are no longer authorized.

        A few sockets at a time: steps wait while another thread has the interpreter.
        """
        sockets = [socket for socket in self._host.sockets if socket.actor is not None]
        heard = {one.actor.pk for one in sockets if isinstance(one.actor, Device)}
        if heard:
            await note_heard(heard, timezone.now())
        for first in range(0, len(sockets), CHECKED_SOCKETS):
            if first:
                await asyncio.sleep(CHECK_PAUSE_S)
            await self._check_sign_ins(sockets[first : first + CHECKED_SOCKETS])

    async def _check_sign_ins(self, sockets: Sequence[Any]) -> None:
        running = [one.scope for one in sockets if one.live is not None and one.live.is_running]
        await extend_sign_ins(running, timezone.now())
        admitted = [(one.actor, one.scope) for one in sockets]
        for index in await find_unauthorized(admitted, timezone.now()):
            sockets[index].revoke()
