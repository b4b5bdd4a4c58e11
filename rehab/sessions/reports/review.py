"""One session from its log: every stride, its phases, and its events as text."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from datetime import datetime
from itertools import groupby
from typing import Any

from django.utils.translation import gettext
from django.utils.translation import gettext_lazy as _

from rehab.people.models import User
from rehab.sessions.control_text import describe_change
from rehab.sessions.formatting import NBSP, clinic_time, format_number, format_rate
from rehab.sessions.log import FallSeverity, PartEntry, Remark, RobotEntry, SessionEvent, Step
from rehab.sessions.log_fold import fold_log
from rehab.sessions.models import TrainingSession
from rehab.sessions.noted_conditions import format_noted
from rehab.sessions.reports.remarks import read_noted
from rehab.sessions.reports.trend import metrics_by_session
from rehab.training.changes import ChangeKind
from rehab.training.controls import CONTROLS, marked_kinds
from rehab.training.fold import SessionFold
from rehab.training.plans import SessionPlan
from rehab.training.summary.summary import summarize_session
from rehab.training.valences import VALENCES

# Only counted: in a list they would hide what people did.
ROBOT_ACTIVITY = (RobotEntry.DECISION.value, RobotEntry.GESTURE.value)
# Of what is no change; those that are not here have the log's own label.
EVENT_LABELS = {
    RobotEntry.STOP: _("Robot stopped"),
    RobotEntry.ARM: _("Robot armed"),
}


@dataclass(frozen=True, slots=True)
class DescribedEvent:
    """An event with its description and its local time."""

    event: SessionEvent
    text: str
    at: datetime

    @property
    def time(self) -> str:
        """Its time of day, to the second."""
        return f"{self.at:%H:%M:%S}"


@dataclass(frozen=True, slots=True)
class SessionReview:
    """A session with its figures (``training.summary``), its events and the data of its chart.

    ``rows`` are all events of its log, ``events`` those without gestures and decisions of the
    robot by time, ``gestures`` is the number of gestures that the robot began.
    """

    figures: dict[str, Any]
    rows: list[SessionEvent]
    events: list[DescribedEvent]
    gestures: int
    chart: dict[str, Any]


def review_session(user: User, session: TrainingSession) -> SessionReview:
    """Return a session's review: figures are folded from the log, strides are as stored.

    ``session``: with its clinic.
    """
    plan = session.to_plan()
    fold = fold_log(SessionFold(plan), session)
    rows = list(
        SessionEvent.objects.visible_to(user)
        .filter(session=session)
        .select_related("by")
        .order_by("pk")
    )
    events = [
        DescribedEvent(row, describe_event(row, plan), clinic_time(row.at, session.clinic))
        for row in rows
        if row.kind not in ROBOT_ACTIVITY
    ]
    events.sort(key=lambda entry: entry.at)  # what was noted afterwards stands where it happened
    gestures = sum(
        event.kind == RobotEntry.GESTURE.value and event.data.get("phase") == "started"
        for event in rows
    )
    figures = summarize_session(fold)
    if session.legacy_id is not None:  # imported without a log: its stored figures are all there is
        stored = metrics_by_session(user, [session]).get(session.pk, {})
        figures |= {"score": stored.get("score"), "active_s": session.active_s}
    return SessionReview(figures, rows, events, gestures, stride_chart(user, session, fold, events))


def describe_event(event: SessionEvent, plan: SessionPlan) -> str:
    """Return an event as text: what it was, and from which value to which."""
    control = CONTROLS.get(event.kind)
    if control is not None:
        old, value = event.data.get("old", event.old), event.data.get("value", event.value)
        return describe_change(control, old, value, plan)
    if event.kind == Remark.FALL_SEVERITY:
        return str(FallSeverity(int(event.value or 0)).label).capitalize()
    if event.kind == PartEntry.PLUGIN:
        return "{package} {version}: {name}".format(**event.data)
    label = str(EVENT_LABELS.get(event.kind) or event.get_kind_display().capitalize())  # type: ignore[call-overload]
    return f"{label} {format_noted(event.kind, event.value)}".rstrip()


def _valence_label(slug: Any) -> str:
    return gettext(VALENCES[slug].label) if slug in VALENCES else str(slug or "")


def _describe_gain(plan: SessionPlan, phase: int, gain: float, goals: set[float]) -> str:
    """Return what steps of a phase needed to be shown as its goals."""
    ends = sorted({min(goals), max(goals)})

    def name(values: Iterable[float]) -> str:
        return f"{'–'.join(map(format_number, values))}{NBSP}{plan.measure.unit}"

    return gettext(
        "%(phase)s: the patient saw %(gain)s of each value, so a step needed %(needed)s for the "
        "goal of %(goal)s."
    ) % {
        "phase": gettext(plan.phases[phase].name),
        "gain": format_rate(gain),
        "needed": name(goal / gain for goal in ends),
        "goal": name(ends),
    }


def stride_chart(
    user: User, session: TrainingSession, fold: SessionFold, events: list[DescribedEvent]
) -> dict[str, Any]:
    """Return the chart's data: strides of the trained leg by column, phases, changes and remarks.

    Values are as measured, so that means of them agree; ``goal`` is what a value had to reach, the
    goal by the gain. ``hit`` is None where nothing was judged. An invalid stride has no value, only
    its reasons.
    """
    plan = fold.plan
    steps = (
        Step.objects.visible_to(user)
        .filter(session=session, side=session.trained_side)
        .order_by("number")
        .values_list("number", "valid", "value", "gain", "goal", "hit", "close", "phase", "reasons")
    )
    columns: dict[str, list[Any]] = {
        name: [] for name in ("number", "value", "goal", "hit", "close", "phase", "why")
    }
    gains: defaultdict[tuple[int, float], set[float]] = defaultdict(set)  # their goals, by phase
    for number, valid, value, gain, goal, hit, close, phase, reasons in steps.iterator():
        measured, needed = value if valid else None, goal and goal / gain
        row = (number, _round(measured), _round(needed), hit, close, phase, ", ".join(reasons))
        if gain != 1 and goal and plan.phases[phase].feedback:
            gains[phase, gain].add(goal)
        for column, entry in zip(columns.values(), row, strict=True):
            column.append(entry)
    runs = groupby(zip(columns.pop("phase"), columns["number"], strict=True), lambda pair: pair[0])
    phases = [(plan.phases[index], [number for _, number in run]) for index, run in runs]
    marked = marked_kinds()
    noted = {one.event.pk for one in read_noted(entry.event for entry in events) if one.is_told}
    valences = _valences_by_run(fold, [run for _, run in phases])
    return {
        "unit": plan.measure.unit,
        "gains": [_describe_gain(plan, *where, goals) for where, goals in gains.items()],
        "strides": columns,
        "phases": [
            {
                "name": gettext(phase.name) + changed,
                "feedback": phase.feedback,
                "from": run[0],
                "to": run[-1],
            }
            for (phase, run), changed in zip(phases, valences, strict=True)
        ],
        "marks": [
            {"after": entry.event.after_number, "kind": entry.event.kind, "words": entry.text}
            for entry in sorted(events, key=lambda entry: entry.event.after_number)
            if entry.event.kind in marked
            or entry.event.pk in noted
            or _is_switch(entry.event, fold)
        ],
    }


def _is_switch(event: SessionEvent, fold: SessionFold) -> bool:
    """Return whether the type changed at once; live, its mark comes with the switch.

    The request may also have taken a scheduled type back, which changes nothing that is walked.
    """
    asked = event.after_number, event.data.get("value")
    return event.kind == ChangeKind.VALENCE_NOW and asked in fold.valences.switches


def _valences_by_run(fold: SessionFold, runs: Sequence[list[int]]) -> list[str]:
    """Return a suffix for each run's name: the valence that begins with it, or nothing."""
    ends = [0, *(run[-1] for run in runs)]
    return [
        "".join(
            f" · {_valence_label(slug)}"
            for after, slug in fold.valences.switches
            if end <= after < run[0]
        )
        for end, run in zip(ends, runs, strict=False)
    ]


def _round(value: float | None) -> float | None:
    """Return a value rounded to four places, so that the page stays small."""
    return None if value is None else round(value, 4)
