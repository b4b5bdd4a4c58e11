"""A session that is live in this process: its fold, its subscribers, its source and its robot."""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Awaitable, Callable, Sequence
from datetime import datetime
from typing import NamedTuple, Protocol

from rehab.people.models import User
from rehab.sessions.events import (
    LiveEvent,
    Told,
    change_event,
    phase_event,
    presence_event,
    remark_event,
    report_event,
    robot_stopped_event,
    snapshot,
    source_message,
    step_event,
)
from rehab.sessions.live.actor import Row, SessionActor
from rehab.sessions.live.hub import EventFeed, Subscriber
from rehab.sessions.live.lateness import Lateness
from rehab.sessions.live.writer import Job, Writer
from rehab.sessions.log import Remark, RobotEntry, Step
from rehab.sessions.payloads import Message, type_mark
from rehab.training.changes import Change, ChangeKind, State
from rehab.training.controls import Audience
from rehab.training.steps import Measurement, ScoredStep

RECENT = 60  # strides that a page's chart may begin with
LOGGED = {"decision": RobotEntry.DECISION, "gesture": RobotEntry.GESTURE}  # of a robot's reports


class NotStored(RuntimeError):
    """A change or step that could not be committed; the session is rebuilt from its log."""


class Peer(Protocol):
    """A source or robot, as its session knows it."""

    @property
    def device_id(self) -> int | None:
        """Which device it is."""

    def tell(self, message: Message) -> None:
        """Send it a message soon."""

    def acknowledge(self, number: int) -> None:
        """Tell it that steps up to this one are stored."""

    def send_away(self, code: int, error: str, message: str) -> None:
        """Send it away."""


class Stop(NamedTuple):
    """A stop of the robot: by whom, when, and which device did it where that was no person."""

    by: User | None
    at: datetime
    data: Message


class LiveSession:
    """Takes steps and changes in order; what is committed goes to everyone who listens.

    All methods run on the event loop. Nothing here waits: writing is the writer's.
    """

    def __init__(
        self,
        actor: SessionActor,
        writer: Writer,
        recent: list[Step],
        on_failure: Callable[[LiveSession, Exception], None],
        *,
        robot_stopped: bool = False,
    ) -> None:
        session = actor.session
        self.id = session.pk
        self.station_id = session.station_id
        # Where its robot is: sessions of one station share it.
        here = f"session {self.id}" if self.station_id is None else f"station {self.station_id}"
        self.place = here
        self.actor = actor
        self.feed = EventFeed()
        self.recent: deque[Step | ScoredStep] = deque(recent, maxlen=RECENT)
        self.source: Peer | None = None
        self.source_clock: Lateness | None = None  # of its latest run
        self.robot: Peer | None = None
        self.robot_stopped = robot_stopped  # until a person arms it again
        self.unlogged_stop: Stop | None = None  # holds, though it is not committed yet
        self.robot_reports: Message = {"status": None, "decision": None}  # the latest
        self.tablets = 0
        self.tablet_heard_at: datetime | None = None
        self.stride_at: datetime | None = recent[-1].received_at if recent else None
        self.committed = actor.fold.last_number
        self.asked_for = True  # since the last sweep of idle sessions
        self.unwritten = 0
        self.about: Message = {
            "session": session.pk,
            "nickname": session.patient.nickname,
            "language": session.patient.language,
            "code": session.patient.code,
        }
        self._writer = writer
        self._on_failure = on_failure
        self._joining = 0
        self._admits = asyncio.Event()
        self._queue = asyncio.Lock()  # fair: who asks for it first has it first

    @property
    def next_number(self) -> int:
        """The number that the next step must have."""
        return self.actor.fold.last_number + 1

    @property
    def is_idle(self) -> bool:
        """Whether nobody and nothing needs it in memory."""
        return not (self.feed.subscribers or self.source or self.robot or self.unwritten)

    @property
    def is_running(self) -> bool:
        """Whether somebody walks."""
        return self.actor.fold.state is State.RUNNING

    @property
    def is_watched(self) -> bool:
        """Whether a PT's page is open: a real robot begins no gesture while none is."""
        subscribers = self.feed.subscribers
        return any(one.audience is Audience.MONITOR and one.is_attentive for one in subscribers)

    def take(self, measurement: Measurement, received_at: datetime, *, late: bool = False) -> None:
        """Score a stride and queue it for the log. Raises what ``SessionFold.step`` raises."""
        fold = self.actor.fold
        index, goal, had_obstacle = fold.phase_index, fold.goal, fold.obstacle
        told_by, switches = Told.now(fold), len(fold.switches)
        row = self.actor.take(measurement, received_at)
        self.stride_at = received_at
        events = [step_event(fold, told_by, row.step, live=not late)]
        moved = (fold.phase_index, fold.goal, fold.obstacle) != (index, goal, had_obstacle)
        if moved:
            events.append(phase_event(fold, switched=len(fold.switches) > switches))
        changed: list[str] = []
        if fold.phase_index != index:
            changed.append(ChangeKind.PHASE)
        if fold.goal != goal:
            events.append(change_event(fold, ChangeKind.GOAL))
            changed.append(ChangeKind.GOAL)
        self._submit([row], events, changed, summarize=moved, step=row.step)

    def change(self, change: Change, by: User | None, at: datetime) -> asyncio.Future[None]:
        """Apply a change from the next step on; done when the future is.

        Raises InvalidSetting where it is refused; nothing has then happened.
        """
        stored: asyncio.Future[None] = asyncio.get_running_loop().create_future()
        fold = self.actor.fold
        goal, switches = fold.goal, len(fold.switches)
        rows = self.actor.change(change, by, at)
        if len(fold.switches) > switches:
            events = [phase_event(fold, switched=True)]
        else:
            events = [change_event(fold, change.kind, change.value)]
        changed = [change.kind]
        if change.kind == ChangeKind.PHASE and fold.goal != goal:
            changed.append(ChangeKind.GOAL)
        self._submit(rows, events, changed, summarize=True, stored=stored)
        return stored

    def remark(
        self, what: Remark, value: float | None, by: User, at: datetime
    ) -> asyncio.Future[None]:
        """Note something of the session as it is now; done when the future is."""
        stored: asyncio.Future[None] = asyncio.get_running_loop().create_future()
        row = self.actor.note(what, by, at, {}, value)
        event = remark_event(self.actor.fold, what.value, value)
        self._submit([row], [event], [], summarize=False, stored=stored)
        return stored

    def stop_robot(self, by: User | None, at: datetime, data: Message) -> None:
        """Stop the robot, before anything else; it stays so until a person arms it.

        ``data`` says which device stopped it, where it was no person.
        """
        if self.robot is not None:
            self.robot.tell({"type": "stop"})
        if not self.robot_stopped:
            self.robot_stopped = True
            self.unlogged_stop = stop = Stop(by, at, data)
            row = self.actor.note(RobotEntry.STOP, by, at, data)
            event = robot_stopped_event(self.actor.fold, True)
            self._submit([row], [event], [], summarize=False, stop=stop)

    def arm_robot(self, by: User, at: datetime) -> asyncio.Future[None]:
        """Let the robot move again once that is in the log; done when the future is."""
        stored: asyncio.Future[None] = asyncio.get_running_loop().create_future()
        self.robot_stopped = False

        def tell(result: asyncio.Future[None]) -> None:
            failed = result.cancelled() or result.exception() is not None
            if not failed and not self.robot_stopped and self.robot is not None:
                self.robot.tell({"type": "arm"})

        stored.add_done_callback(tell)
        row = self.actor.note(RobotEntry.ARM, by, at, {})
        event = robot_stopped_event(self.actor.fold, False)
        self._submit([row], [event], [], summarize=False, stored=stored)
        return stored

    def heard_robot(self, report: Message, at: datetime) -> None:
        """Tell the PT what the robot reports; decisions and gestures go into the log first."""
        event = report_event(self.actor.fold, report)
        kind = report.get("kind")
        if kind in self.robot_reports:
            self.robot_reports[kind] = report
        if kind in LOGGED:
            data = {name: value for name, value in report.items() if name != "kind"}
            row = self.actor.note(LOGGED[kind], None, at, data)
            self._submit([row], [event], [], summarize=False)
        else:
            self.feed.publish(event)

    def _submit(
        self,
        rows: list[Row],
        events: list[LiveEvent],
        changed: Sequence[str],
        *,
        summarize: bool,
        step: ScoredStep | None = None,
        stored: asyncio.Future[None] | None = None,
        stop: Stop | None = None,
    ) -> None:
        """Queue rows; after their commit tell the source what changed, and everyone the events."""
        for_source = [
            message
            for kind in changed
            if (message := source_message(self.actor.fold, kind)) is not None
        ]

        def done(problem: Exception | None) -> None:
            self.unwritten -= 1
            if problem is not None:
                if stored is not None and not stored.done():
                    stored.set_exception(NotStored("It could not be stored. Try again."))
                self._on_failure(self, problem)
                return
            if stop is not None and self.unlogged_stop is stop:
                self.unlogged_stop = None
            if self.source is not None:
                for message in for_source:  # before the ack: a simulated patient waits for that
                    self.source.tell(message)
                if step is not None:
                    self.source.acknowledge(step.number)
            if step is not None:
                self.recent.append(step)
                self.committed = step.number
            for event in events:
                self.feed.publish(event)
            if stored is not None and not stored.done():
                stored.set_result(None)

        self.unwritten += 1
        self._writer.submit(
            Job(
                owner=self.actor,
                session_id=self.id,
                epoch=self.actor.session.epoch,
                rows=rows,
                summary=self.actor.summary() if summarize else None,
                done=done,
            )
        )

    def presence(self, now: datetime) -> Message:
        """Say who is there, and how long ago the sensor and a tablet were last heard."""
        return {
            "source": self.source is not None,
            "robot": self.robot is not None,
            "tablets": self.tablets,
            "stride_ago_s": _ago_s(self.stride_at, now),
            "tablet_ago_s": _ago_s(self.tablet_heard_at, now) if self.tablets else None,
        }

    def announce_presence(self, now: datetime) -> None:
        """Tell the subscribers who is there."""
        self.feed.publish(presence_event(self.actor.fold, self.presence(now)))

    async def join(
        self, audience: Audience, send: Callable[[str], Awaitable[None]], now: datetime
    ) -> tuple[Message, Subscriber]:
        """Add a subscriber. Give all that its page shows as of now; events follow from there.

        New steps wait for the few milliseconds until what is under way has been committed, so that
        a page is never shown what may not have happened, and nothing twice.
        """
        self._joining += 1
        self._admits.clear()
        try:
            while self.unwritten:
                await self.settled()
            about = self.about if audience is Audience.MONITOR else _for_patient(self.about)
            shown = snapshot(
                audience,
                self.actor.fold,
                about,
                self.presence(now),
                self.recent,
                robot=self.robot_reports,
                robot_stopped=self.robot_stopped,
                marks=self._marks(),
            )
            subscriber = Subscriber(self.feed, audience, send)
            self.feed.subscribers.add(subscriber)
            return shown, subscriber
        finally:
            self._joining -= 1
            if not self._joining:
                self._admits.set()

    def _marks(self) -> list[Message]:
        """Give what a PT's chart points out, in the order of the steps."""
        switches = [type_mark(after, slug) for after, slug in self.actor.fold.switches]
        return sorted([*self.actor.marks, *switches], key=lambda mark: mark["after"])

    async def admission(self) -> None:
        """Wait while a subscriber joins. Whoever takes steps or changes asks first.

        Those who wait go on in the order in which they came.
        """
        async with self._queue:
            while self._joining:
                await self._admits.wait()

    async def settled(self) -> None:
        """Wait until everything taken so far is committed. Raises NotStored."""
        stored: asyncio.Future[None] = asyncio.get_running_loop().create_future()
        self._submit([], [], [], summarize=False, stored=stored)
        await stored


def _ago_s(moment: datetime | None, now: datetime) -> float | None:
    return None if moment is None else round(max(0.0, (now - moment).total_seconds()), 1)


def _for_patient(about: Message) -> Message:
    return {name: about[name] for name in ("session", "nickname", "language")}
