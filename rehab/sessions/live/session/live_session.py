"""A live session: its aggregate, its subscribers, its source and its robot."""

from __future__ import annotations

import asyncio
import time
from collections import deque
from collections.abc import Awaitable, Callable, Sequence
from datetime import datetime

from rehab.people.models import User
from rehab.sessions.events.change import source_message
from rehab.sessions.events.course import Before, events_of_change, events_of_step
from rehab.sessions.events.event import (
    LiveEvent,
    alarms_event,
    presence_event,
    remark_event,
    robot_state_event,
)
from rehab.sessions.events.snapshot import snapshot
from rehab.sessions.live.database.trouble import WORDS, NotStored, classify_failure
from rehab.sessions.live.devices import ConnectedDevice
from rehab.sessions.live.protocol.messages import Played, SensorState, SensorTrouble
from rehab.sessions.live.session.aggregate import Row, SessionAggregate, StepRow, Summary
from rehab.sessions.live.session.commit_transaction import Job
from rehab.sessions.live.session.delayed_steps import SourceClock
from rehab.sessions.live.session.group_commit import Writer
from rehab.sessions.live.session.robot_orders import RobotOrders
from rehab.sessions.live.session.subscribers import EventFeed, Subscriber, SubscriptionGate
from rehab.sessions.log import (
    ALARM_KINDS,
    RULE_PAUSES,
    PartEntry,
    Remark,
    RuleEntry,
    Step,
)
from rehab.sessions.noted_conditions import find_reported
from rehab.sessions.state_messages import Message, type_mark
from rehab.training.changes import ENDED_STATES, Change, ChangeKind, State
from rehab.training.controls import Audience
from rehab.training.measures import MEASURES
from rehab.training.plans import SessionPlan
from rehab.training.steps import Measurement, ScoredStep
from robot.motion.gestures import GESTURES
from robot.plugins import Plugin

RECENT_STEPS = 60  # strides that a page's chart may begin with


class LiveSession:
    """Applies steps and changes in order, and publishes what is committed.

    All methods run on the event loop; the writer's thread does what waits for the disk.
    """

    def __init__(
        self,
        aggregate: SessionAggregate,
        epoch: int,
        writer: Writer,
        recent: list[Step],
        on_failure: Callable[[LiveSession, Exception], None],
        *,
        robot_stopped: bool = False,
    ) -> None:
        session = aggregate.session
        self.id = session.pk
        self.clinic_id = session.clinic_id
        self.station_id = session.station_id
        # Sessions of one location share its robot.
        here = f"session {self.id}" if self.station_id is None else f"station {self.station_id}"
        self.location = here
        self.aggregate = aggregate
        self.epoch = epoch
        self.feed = EventFeed()
        self.recent: deque[Step | ScoredStep] = deque(recent, maxlen=RECENT_STEPS)
        self.source: ConnectedDevice | None = None
        self.source_clock: SourceClock | None = None  # of its latest run
        self.source_state: SensorState | None = None  # what a worn sensor says of itself
        self.companion: ConnectedDevice | None = None  # a sensor on the leg that is not trained
        self.companion_state: SensorState | None = None
        self.robot: ConnectedDevice | None = None
        self.robot_orders = RobotOrders(self, self._submit, is_stopped=robot_stopped)
        self.tablets = 0  # pages that the patient looks at
        self.tablet_seen_at: datetime | None = None
        self.stride_at: datetime | None = recent[-1].received_at if recent else None
        self.committed = aggregate.fold.last_number
        self.recently_used = True  # since the last sweep of idle sessions
        self.uncommitted = 0
        self.gate = SubscriptionGate()
        self._plugins: list[Message] = []  # that were noted since it was loaded
        self.about: Message = {
            "session": session.pk,
            "nickname": session.patient.nickname,
            "language": session.patient.language,
            "own_goal": session.patient.own_goal,
            "code": session.patient.code,
        }
        self._writer = writer
        self._on_failure = on_failure

    @property
    def next_number(self) -> int:
        """The number that the next step must have."""
        return self.aggregate.fold.last_number + 1

    @property
    def is_idle(self) -> bool:
        """Whether nothing needs it in memory."""
        devices = self.source or self.companion or self.robot
        used = self.feed.subscribers or devices or self.uncommitted
        return self.gate.is_open and not used

    @property
    def is_running(self) -> bool:
        """Whether its state is running."""
        return self.aggregate.fold.state is State.RUNNING

    @property
    def is_open(self) -> bool:
        """Whether it has not ended."""
        return self.aggregate.fold.state not in ENDED_STATES

    @property
    def is_simulated(self) -> bool:
        """Whether nobody walks in it."""
        return self.aggregate.session.simulated

    @property
    def is_watched(self) -> bool:
        """Whether a PT's page is open: a real robot begins no gesture while none is."""
        subscribers = self.feed.subscribers
        return any(one.audience is Audience.MONITOR and one.is_attentive for one in subscribers)

    def record_step(
        self,
        measurement: Measurement,
        received_at: datetime,
        *,
        late: bool = False,
        simulated: bool = False,
    ) -> None:
        """Score a step and queue it for the log. Raises what ``SessionFold.step`` raises.

        ``simulated``: nobody walked it, and so the session counts as no person's.
        """
        fold = self.aggregate.fold
        is_first = simulated and not self.is_simulated
        before = Before.of(fold)
        row = self.aggregate.record_step(measurement, received_at, late=late)
        self.aggregate.session.simulated |= simulated
        events = events_of_step(
            fold, before, row.step, self.feed.audiences, received_at, live=not late
        )
        rows: list[Row] = [row]
        for what, value in find_reported(self.aggregate.conditions, measurement.extra):
            rows.append(self.aggregate.log_event(what, None, received_at, {}, value))
            events.append(remark_event(fold, what.value, value))
        changed = before.changed_by_step(fold)
        if fold.following.moved:
            followed = RuleEntry.GOAL_FOLLOWED
            old = before.goal
            rows.append(self.aggregate.log_event(followed, None, received_at, {}, fold.goal, old))
        if ChangeKind.PAUSE in changed and fold.pause_reason is not None:
            rest = RULE_PAUSES[fold.pause_reason]
            rows.append(self.aggregate.log_event(rest, None, received_at, {}, fold.rest_s))
        summary = None
        if is_first or before.has_moved(fold) or self.aggregate.is_checkpoint_due:
            summary = self.aggregate.summary(with_checkpoint=True)
        self._submit(rows, events, changed, summary, row=row)

    def change(self, change: Change, by: User | None, at: datetime) -> asyncio.Future[None]:
        """Apply a change from the next step on; the future is done when it is committed.

        Raises InvalidSetting if it is refused; the session is then as it was.
        """
        stored: asyncio.Future[None] = asyncio.get_running_loop().create_future()
        fold = self.aggregate.fold
        before = Before.of(fold)
        rows = self.aggregate.change(change, by, at)
        events = events_of_change(fold, before, change)
        if change.kind == ChangeKind.START:
            for plugin in find_plugins(fold.plan):
                rows += self._log_plugin(plugin.describe(), at)
        changed = [change.kind]
        if change.kind == ChangeKind.PHASE and fold.goal != before.goal:
            changed.append(ChangeKind.GOAL)
        self._submit(rows, events, changed, self.aggregate.summary(), stored=stored)
        return stored

    def note_plugin(self, plugin: Message, at: datetime) -> None:
        """Log that a part of another package takes part, unless that is known."""
        if self.is_open and (rows := self._log_plugin(plugin, at)):
            self._submit(rows, [], [])

    def _log_plugin(self, plugin: Message, at: datetime) -> list[Row]:
        if plugin in self._plugins:
            return []
        self._plugins.append(plugin)
        return [self.aggregate.log_event(PartEntry.PLUGIN, None, at, dict(plugin))]

    def remark(
        self, what: Remark, value: float | None, by: User | None, at: datetime
    ) -> asyncio.Future[None]:
        """Log a remark; the future is done when it is committed."""
        stored: asyncio.Future[None] = asyncio.get_running_loop().create_future()
        row = self.aggregate.log_event(what, by, at, {}, value)
        fold, alarms = self.aggregate.fold, self.aggregate.alarms
        events = [remark_event(fold, what.value, value)]
        if what in ALARM_KINDS:
            events.append(alarms_event(fold, alarms))
        self._submit([row], events, [], stored=stored)
        return stored

    def _submit(
        self,
        rows: list[Row],
        events: list[LiveEvent],
        changed: Sequence[str],
        summary: Summary | None = None,
        *,
        row: StepRow | None = None,
        stored: asyncio.Future[None] | None = None,
        on_stored: Callable[[], None] | None = None,
    ) -> None:
        """Queue rows; after their commit, send the source what changed and publish the events."""
        for_source = [
            message
            for kind in changed
            if (message := source_message(self.aggregate.fold, kind)) is not None
        ]

        def done(problem: Exception | None) -> None:
            self.uncommitted -= 1
            if problem is not None:
                if stored is not None and not stored.done():
                    words = WORDS.get(classify_failure(problem))
                    stored.set_exception(NotStored(words or "It could not be stored. Try again."))
                self._on_failure(self, problem)
                return
            if on_stored is not None:
                on_stored()
            if self.source is not None:
                for message in for_source:  # before the ack, which a simulated patient waits for
                    self.source.outbox.queue(message)
                if row is not None:
                    self.source.outbox.acknowledge(row.step.number)
            if row is not None:
                self.recent.append(row.step)
                self.committed = row.step.number
                self.stride_at = row.received_at
            for event in events:
                self.feed.publish(event)
            if stored is not None and not stored.done():
                stored.set_result(None)

        self.uncommitted += 1
        self._writer.submit(
            Job(
                owner=self.aggregate,
                session_id=self.id,
                epoch=self.epoch,
                rows=rows,
                summary=summary,
                done=done,
                came_s=0.0 if row is None else time.monotonic(),
            )
        )

    def presence(self, now: datetime) -> Message:
        """Return who is connected, and how long ago source and tablet last sent something."""
        return {
            "source": self.source is not None,
            "source_trouble": _trouble(self.source, self.source_state),
            "source_plays": _plays(self.source, self.source_state),
            "source_round": self.source_state.round if self.source and self.source_state else 1,
            "source_clock": _clock(self.source, self.source_state),
            "companion": self.companion is not None,
            "companion_trouble": _trouble(self.companion, self.companion_state),
            "companion_clock": _clock(self.companion, self.companion_state),
            "robot": self.robot is not None,
            "tablets": self.tablets,
            "stride_ago_s": _ago_s(self.stride_at, now),
            "tablet_ago_s": _ago_s(self.tablet_seen_at, now) if self.tablets else None,
            "storage": self._writer.trouble.value,
        }

    @property
    def state_for_robot(self) -> str:
        """The state that its robot obeys: it stands still while nothing can be stored."""
        state = State.PAUSED if self.is_running and self._writer.trouble else None
        return (state or self.aggregate.fold.state).value

    def announce_storage(self, now: datetime) -> None:
        """Publish whether steps are stored; the robot stands still while they are not."""
        self.announce_presence(now)
        self.feed.publish(robot_state_event(self.aggregate.fold, self.state_for_robot))

    def announce_presence(self, now: datetime) -> None:
        """Publish who is connected."""
        self.feed.publish(presence_event(self.aggregate.fold, self.presence(now)))

    async def subscribe(
        self,
        audience: Audience,
        send: Callable[[str], Awaitable[None]],
        now: datetime,
        write: Callable[[str], bool] = lambda _: False,
    ) -> tuple[Message, Subscriber]:
        """Add a subscriber; return it with the snapshot that its events continue.

        New steps wait some milliseconds until everything queued is committed, so that a page sees
        nothing uncommitted and nothing twice.
        """
        with self.gate.closed():
            while self.uncommitted:
                await self.wait_until_committed()
            about = self.about if audience is Audience.MONITOR else _for_patient(self.about)
            shown = snapshot(
                audience,
                self.aggregate.fold,
                about,
                self.presence(now),
                self.recent,
                robot=self.robot_orders.reports,
                robot_stopped=self.robot_orders.is_stopped,
                marks=self._marks(),
                alarms=self.aggregate.alarms,
                conditions=self.aggregate.conditions,
            )
            shown["now"] = now.timestamp()
            subscriber = Subscriber(self.feed, audience, send, write)
            self.feed.subscribers.add(subscriber)
            return shown, subscriber

    def _marks(self) -> list[Message]:
        """Return the marks of a PT's chart, in the order of the steps."""
        switches = [type_mark(after, slug) for after, slug in self.aggregate.fold.valences.switches]
        return sorted([*self.aggregate.marks, *switches], key=lambda mark: mark["after"])

    async def wait_until_committed(self) -> None:
        """Wait until everything queued so far is committed. Raises NotStored."""
        stored: asyncio.Future[None] = asyncio.get_running_loop().create_future()
        self._submit([], [], [], stored=stored)
        await stored


def find_plugins(plan: SessionPlan) -> list[Plugin]:
    """Return the parts of other packages that a plan names: its measure, the robot's gestures."""
    cue = plan.valence.cue
    found = [MEASURES.find_plugin(plan.measure.slug)]
    found += [GESTURES.find_plugin(name) for name in (cue.above, cue.below) if name]
    return [one for one in found if one is not None]


def _ago_s(moment: datetime | None, now: datetime) -> float | None:
    return None if moment is None else round(max(0.0, (now - moment).total_seconds()), 1)


def _for_patient(about: Message) -> Message:
    return {name: about[name] for name in ("session", "nickname", "language", "own_goal")}


def _trouble(device: ConnectedDevice | None, state: SensorState | None) -> str:
    is_known = state and (device or state.trouble is SensorTrouble.ENDED)
    return state.trouble.value if state and is_known else ""


def _plays(device: ConnectedDevice | None, state: SensorState | None) -> str:
    """Return what walks instead of a leg; empty where one does."""
    if device is None:
        return ""
    return Played.SIMULATED.value if device.simulated else state.plays.value if state else ""


def _clock(device: ConnectedDevice | None, state: SensorState | None) -> list[float | None] | None:
    """Return a worn sensor's clock less ours, and its error [s]."""
    if device is None or state is None or state.clock_error_s is None:
        return None
    return [state.clock_offset_s, state.clock_error_s]
