"""Sessions that another server owns, for the pages that this one has of them.

A follower reads the new rows of the log, once for all its pages, and folds them by the code that
the owner folded them with: its pages get the same events. What no log has comes with the owner's
hints: who is connected, what the robot reports.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from datetime import datetime, timedelta
from typing import NamedTuple

from django.db import connection, transaction
from django.db.models import Max, Q
from django.utils import timezone

from rehab.sessions.events.event import presence_event, robot_report_event
from rehab.sessions.live.database.trouble import Trouble
from rehab.sessions.live.servers.intercom import Data
from rehab.sessions.live.session.aggregate import SessionAggregate
from rehab.sessions.live.session.commits import Job
from rehab.sessions.live.session.hub import Subscriber
from rehab.sessions.live.session.live_session import RECENT_STEPS, LiveSession
from rehab.sessions.live.session.loading import is_robot_stopped
from rehab.sessions.live.session.robot_orders import LOGGED_REPORTS
from rehab.sessions.log import Remark, RobotEntry, SessionEvent, Step
from rehab.sessions.models import TrainingSession
from rehab.sessions.payloads import Message
from rehab.sessions.replay import MEASURED, to_change, to_measurement
from rehab.training.controls import CONTROLS, Audience
from rehab.training.measures import InvalidSetting
from rehab.training.steps import InvalidMeasurement

READ_TOGETHER = 100  # sessions of one query
LATE = timedelta(seconds=2)  # a step that was read so long after it came is not shown as live
WHO = ("source", "source_trouble", "robot", "tablets", "storage")  # of the presence
NO_ONE: Message = {
    "source": False,
    "source_trouble": "",
    "robot": False,
    "tablets": 0,
    "stride_ago_s": None,
    "tablet_ago_s": None,
    "storage": Trouble.NONE.value,
}


class _Reader:
    """Stands where an owner has its writer: what a follower folds is stored already."""

    trouble = Trouble.NONE

    def submit(self, job: Job) -> None:
        """Report the rows as committed."""
        job.done(None)


class NewRows(NamedTuple):
    """What is new in the log of a session since it was read."""

    owner: str
    epoch: int
    steps: list[Step]
    events: list[SessionEvent]


class FollowedSession(LiveSession):
    """A session of another server, as far as its log has been read."""

    def __init__(
        self, aggregate: SessionAggregate, recent: list[Step], last_event: int, robot_stopped: bool
    ) -> None:
        super().__init__(aggregate, _Reader(), recent, lambda *_: None, robot_stopped=robot_stopped)
        self.owner = aggregate.session.owner
        self.last_event = last_event
        self._presence = NO_ONE

    @property
    def viewers(self) -> Data:
        """What the owner has to know of the pages here."""
        subscribers = self.feed.subscribers
        monitors = [one for one in subscribers if one.audience is Audience.MONITOR]
        return {
            "session": self.id,
            "tablets": self.tablets,
            "monitors": len(monitors),
            "watched": any(one.is_attentive for one in monitors),
        }

    def presence(self, now: datetime) -> Message:
        """Return who is connected to the owner, as it reported last."""
        return self._presence

    def announce_presence(self, now: datetime) -> None:
        """Do nothing: the owner gets the pages here reported, and announces them to all."""

    def take_hint(self, hint: Data) -> None:
        """Publish what the owner sends and no log has."""
        before, self._presence = self._presence, hint["presence"]
        if any(before[name] != self._presence[name] for name in WHO):  # ages go with heartbeats
            self.feed.publish(presence_event(self.aggregate.fold, self._presence))
        for kind, report in hint["robot"].items():
            if report is not None and report != self.robot_orders.reports.get(kind):
                self.robot_orders.reports[kind] = report
                if kind not in LOGGED_REPORTS:  # these come with the log
                    self.feed.publish(robot_report_event(self.aggregate.fold, report))

    def fold_rows(self, new: NewRows, now: datetime) -> None:
        """Fold new rows in the order in which they took effect, and publish their events."""
        events = list(reversed(new.events))
        for step in new.steps:
            while events and events[-1].after_number < step.number:
                self._fold_event(events.pop())
            if step.number == self.next_number:
                late = step.late or now - step.received_at > LATE
                measured = to_measurement(*(getattr(step, name) for name in MEASURED))
                try:
                    self.record_step(measured, step.received_at, late=late)
                except (InvalidSetting, InvalidMeasurement):
                    continue  # as `replay.fold_log` does
        while events:
            self._fold_event(events.pop())

    def _fold_event(self, event: SessionEvent) -> None:
        self.last_event = event.pk
        kind = event.kind
        if kind in CONTROLS:
            try:
                self.change(to_change(event), None, event.at)
            except InvalidSetting:
                return
        elif kind in list(Remark):
            self.remark(Remark(kind), event.value, None, event.at)
        elif kind == RobotEntry.STOP:
            self.robot_orders.stop(None, event.at, event.data)
        elif kind == RobotEntry.ARM:
            self.robot_orders.arm(None, event.at)
        elif kind in list(RobotEntry):
            name = next(name for name, entry in LOGGED_REPORTS.items() if entry == kind)
            self.robot_orders.record_report({"kind": name, **event.data}, event.at)
        # What the plan did by itself follows from its step.


class Follower(Subscriber):
    """At the owner: a server that follows a session. It counts as the pages that it has."""

    EXPIRES_S = 3.5  # a follower reports each second

    def __init__(self, live: LiveSession, server: str, send_hint: Callable[[Data], object]) -> None:
        async def send(_: str) -> None:
            """Send nothing: a follower reads the log."""

        super().__init__(live.feed, Audience.PATIENT, send)
        self.live, self.server = live, server
        self._send_hint = send_hint
        self._is_watched = False
        self._updated_s = 0.0

    @property
    def position(self) -> int:
        """Where it is in the feed: a follower needs no event retained."""
        return self.feed.head

    @position.setter
    def position(self, position: int) -> None:
        """Stay where the feed is."""

    @property
    def is_attentive(self) -> bool:
        """Whether a page of the follower's processes what it is sent."""
        return self._is_watched and not self.is_gone(asyncio.get_running_loop().time())

    def update(self, viewers: Data, now_s: float) -> None:
        """Note which pages the follower has."""
        self.tablets = viewers["tablets"]
        self.audience = Audience.MONITOR if viewers["monitors"] else Audience.PATIENT
        self._is_watched = viewers["watched"]
        self._updated_s = now_s

    def is_gone(self, now_s: float) -> bool:
        """Whether it has not reported for long."""
        return now_s - self._updated_s > self.EXPIRES_S

    def queue_heartbeat(self, text: str) -> None:
        """Send a hint, which includes who is connected."""
        self.wake()

    def flush(self) -> None:
        """Send one hint for all that happened in this turn of the event loop."""
        self._is_due = False
        live = self.live
        presence, robot = live.presence(timezone.now()), live.robot_orders.reports
        self._send_hint({"session": live.id, "presence": presence, "robot": robot})


def load_followed(session_id: int) -> FollowedSession:
    """Rebuild a session from its log without becoming its writer.

    Raises TrainingSession.DoesNotExist.
    """
    with _one_moment():
        session = TrainingSession.everywhere.select_related("patient", "measure", "station").get(
            pk=session_id
        )
        events = SessionEvent.everywhere.filter(session=session)
        last_event = events.aggregate(last=Max("pk"))["last"] or 0
        latest = Step.everywhere.filter(session=session).order_by("-number")[:RECENT_STEPS]
        recent = list(reversed(latest))
        aggregate = SessionAggregate.load(session)
        orders = list(events.filter(kind__in=[RobotEntry.STOP, RobotEntry.ARM]).order_by("pk"))
        return FollowedSession(aggregate, recent, last_event, is_robot_stopped(session, orders))


def read_new_rows(followed: Sequence[tuple[int, int, int]]) -> dict[int, NewRows]:
    """Return what is new in logs: of sessions, each with its last number and event."""
    found: dict[int, NewRows] = {}
    for first in range(0, len(followed), READ_TOGETHER):
        found |= _read(followed[first : first + READ_TOGETHER])
    return found


def _read(followed: Sequence[tuple[int, int, int]]) -> dict[int, NewRows]:
    keys = [key for key, _, _ in followed]
    with _one_moment():
        sessions = TrainingSession.everywhere.filter(pk__in=keys).order_by()
        found = {
            key: NewRows(owner, epoch, [], [])
            for key, owner, epoch in sessions.values_list("pk", "owner", "epoch")
        }
        new_steps = _any(Q(session_id=key, number__gt=number) for key, number, _ in followed)
        for step in Step.everywhere.filter(new_steps).order_by("session_id", "number"):
            found[step.session_id].steps.append(step)
        new_events = _any(Q(session_id=key, pk__gt=event) for key, _, event in followed)
        for event in SessionEvent.everywhere.filter(new_events).order_by("pk"):
            found[event.session_id].events.append(event)
    return found


def _any(conditions: Iterable[Q]) -> Q:
    joined = Q()
    for condition in conditions:
        joined |= condition
    return joined


@contextmanager
def _one_moment() -> Iterator[None]:
    """Read the database in this block as it is at one moment."""
    with transaction.atomic():
        if connection.vendor == "postgresql":
            with connection.cursor() as cursor:
                cursor.execute("SET TRANSACTION ISOLATION LEVEL REPEATABLE READ READ ONLY")
        yield
