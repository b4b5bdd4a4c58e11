"""One session as an aggregate: turns measurements and changes into rows of its log."""

from __future__ import annotations

import logging
from collections import deque
from collections.abc import Iterable
from datetime import datetime
from typing import Any, NamedTuple

from rehab.people.models import User
from rehab.sessions.alarms import FOLDED_KINDS, OpenAlarms
from rehab.sessions.log import (
    PartEntry,
    Remark,
    RobotEntry,
    RuleEntry,
    SessionEvent,
    SessionMetric,
)
from rehab.sessions.log_fold import fold_log
from rehab.sessions.models import TrainingSession
from rehab.sessions.noted_conditions import CONDITIONS, planned_conditions
from rehab.sessions.state_messages import change_mark
from rehab.training.changes import ENDED_STATES, Change, ChangeKind, ChangeValue, State
from rehab.training.controls import CONTROLS, marked_kinds
from rehab.training.fold import SessionFold
from rehab.training.fold.checkpoints import fold_from_json, fold_to_json
from rehab.training.steps import Measurement, ScoredStep
from rehab.training.summary.metrics import compute_metrics

log = logging.getLogger(__name__)


class StepRow(NamedTuple):
    """A scored stride on its way into the log."""

    session_id: int
    step: ScoredStep
    received_at: datetime
    late: bool = False  # not shown as live


Row = StepRow | SessionEvent | SessionMetric
CHECKPOINT_STEPS = 100
MARKS = 100  # the newest; more would hide the strides
Summary = dict[str, Any]


def kinds_with_marks() -> set[str]:
    """Return the kinds of events that leave a mark on a therapist's chart."""
    return {*marked_kinds(), *Remark, RuleEntry.GOAL_FOLLOWED}


class SessionAggregate:
    """Folds one session. Its rows count only once a writer has committed them.

    After a failed commit the aggregate is ahead of the log and must be dropped; ``load`` rebuilds
    it from what was committed.
    """

    def __init__(self, session: TrainingSession) -> None:
        self.session = session
        self.id: int = session.pk
        self.fold = SessionFold(session.to_plan())
        if session.legacy_id is not None:
            self.fold.state = State.FINISHED  # imported, without a log
        self.marks: deque[dict[str, Any]] = deque(maxlen=MARKS)  # what a PT's chart points out
        self.alarms = OpenAlarms()
        self.conditions = planned_conditions(session)  # how the patient walks now, by kind

    @classmethod
    def load(cls, session: TrainingSession) -> SessionAggregate:
        """Return the aggregate of a session, rebuilt from its log."""
        aggregate = cls.from_checkpoint(session)
        aggregate.fold = fold_log(aggregate.fold, session)
        marked = SessionEvent.everywhere.filter(session=session, kind__in=kinds_with_marks())
        aggregate.add_marks(reversed(marked.order_by("-pk")[:MARKS]))
        alarms = SessionEvent.everywhere.filter(session=session, kind__in=FOLDED_KINDS)
        aggregate.alarms = OpenAlarms(alarms.select_related("by").order_by("pk"))
        noted = SessionEvent.everywhere.filter(session=session, kind__in=CONDITIONS)
        for kind, value in noted.order_by("pk").values_list("kind", "value"):
            if value is not None:
                aggregate.conditions[kind] = value
        return aggregate

    @classmethod
    def from_checkpoint(cls, session: TrainingSession) -> SessionAggregate:
        """Return the aggregate of the first steps of a session, or before them."""
        aggregate = cls(session)
        aggregate.fold = aggregate.restore_checkpoint() or aggregate.fold
        return aggregate

    def restore_checkpoint(self) -> SessionFold | None:
        """Return the fold of the session's checkpoint, if there is one that can be used."""
        stored = self.session.checkpoint
        if not stored or stored["last_number"] > self.session.last_number:
            return None
        return fold_from_json(self.fold.plan, stored)

    @property
    def is_checkpoint_due(self) -> bool:
        """Whether a checkpoint is worth its place after the last step."""
        return self.fold.last_number % CHECKPOINT_STEPS == 0

    def add_marks(self, events: Iterable[SessionEvent]) -> None:
        """Add the marks among a log's events, in their order."""
        for event in events:
            self._add_mark(event)

    def _add_mark(self, event: SessionEvent) -> None:
        """Add an event to the snapshots of later subscribers, if charts point it out."""
        kind, value = event.kind, event.data.get("value", event.value)
        if kind in marked_kinds():
            self.marks.append(change_mark(event.after_number, kind, value))
        elif kind == RuleEntry.GOAL_FOLLOWED:
            self.marks.append(change_mark(event.after_number, ChangeKind.GOAL, value))
        elif kind in list(Remark):
            self.marks.append({"after": event.after_number, "kind": kind, "value": value})

    def record_step(
        self, measurement: Measurement, received_at: datetime, *, late: bool = False
    ) -> StepRow:
        """Score one stride and return its row. Raises what ``SessionFold.step`` raises."""
        return StepRow(self.id, self.fold.step(measurement), received_at, late)

    def change(self, change: Change, by: User | None, at: datetime) -> list[Row]:
        """Apply a change from the next step on and return the rows that record it.

        Raises what ``SessionFold.change`` raises, and NotAllowed for what a study fixes or while
        nobody has seen to a fall (a log that has it all the same is read as it is); the session is
        then as it was.
        """
        control = CONTROLS[change.kind]
        control.check_lock(self.fold.plan, change.value)
        if control.leads_to is State.RUNNING:
            self.alarms.check_seen_to_fall()
        old = control.value_for_log(self.fold)
        self.fold.change(change)
        event = SessionEvent(
            session=self.session,
            after_number=self.fold.last_number,
            kind=str(change.kind),
            by=by,
            at=at,
            **_to_columns(old, change.value),
        )
        self._add_mark(event)
        self.alarms.apply(event)
        rows: list[Row] = [event]
        if change.kind == ChangeKind.START:
            self.session.started_at = at
        if self.fold.state in ENDED_STATES:
            self.session.ended_at = at
        if self.fold.state is State.FINISHED:
            rows += [
                SessionMetric(session=self.session, slug=slug, value=value)
                for slug, value in compute_metrics(self.fold).items()
            ]
        return rows

    def log_event(
        self,
        kind: PartEntry | RobotEntry | Remark | RuleEntry,
        by: User | None,
        at: datetime,
        data: dict[str, Any],
        value: float | None = None,
        old: float | None = None,
    ) -> SessionEvent:
        """Return the row that records a remark, an act of the plan or what became of the robot."""
        event = SessionEvent(
            session=self.session,
            after_number=self.fold.last_number,
            kind=kind.value,
            old=old,
            value=value,
            by=by,
            at=at,
            data=data,
        )
        self._add_mark(event)
        self.alarms.apply(event)
        if kind in CONDITIONS and value is not None:
            self.conditions[kind.value] = value
        return event

    def summary(self, *, with_checkpoint: bool = False) -> Summary:
        """Return the session's columns as they follow from the log, to be written with its rows.

        ``with_checkpoint``: only right after a step, so that its number marks what is folded.
        """
        checkpoint: Summary = {"checkpoint": fold_to_json(self.fold)} if with_checkpoint else {}
        if self.fold.state in ENDED_STATES:
            checkpoint = {"checkpoint": None}
        return {
            **checkpoint,
            "state": self.fold.state.value,
            "goal": self.fold.goal,
            "active_s": self.fold.active_s,
            "started_at": self.session.started_at,
            "ended_at": self.session.ended_at,
            "changed_to": ",".join(self.fold.valences.changed_to),
            "simulated": self.session.simulated,
        }


def _to_columns(old: ChangeValue, value: ChangeValue) -> dict[str, Any]:
    """Return a change's values as the log has them: numbers in columns, all else in ``data``."""
    if value is None or isinstance(value, int | float):
        return {"old": old, "value": value}
    return {"data": {"value": value} if old is None else {"value": value, "old": old}}
