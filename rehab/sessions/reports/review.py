"""One session told from its log: every stride, its phases, what was done and when."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby
from typing import Any

from django.utils.translation import gettext, ngettext
from django.utils.translation import gettext_lazy as _

from rehab.people.models import User
from rehab.sessions.formatting import LEVELS, say_duration, say_number, say_quantity, say_rate
from rehab.sessions.log import Remark, RobotEntry, SessionEvent, Step
from rehab.sessions.models import TrainingSession
from rehab.sessions.payloads import MARKED_CHANGES
from rehab.sessions.replay import fold_log
from rehab.sessions.reports.trend import figures_of
from rehab.training.changes import ChangeKind, PauseReason
from rehab.training.fold import SessionFold
from rehab.training.plans import SessionPlan, name_robot_level
from rehab.training.summary import summarize_session
from rehab.training.valences import VALENCES

# What a robot did is counted; in the list it would hide what people did.
COUNTED = (RobotEntry.DECISION.value, RobotEntry.GESTURE.value)
STYLES = {"points": _("points"), "line": _("line")}
PAUSED_BY = {
    PauseReason.THERAPIST.value: _("by the therapist"),
    PauseReason.PATIENT.value: _("on the patient’s page"),
    PauseReason.RESTART.value: _("by a restart of the server"),
}
NAMES = {
    ChangeKind.START: _("Started"),
    ChangeKind.PAUSE: _("Paused"),
    ChangeKind.RESUME: _("Resumed"),
    ChangeKind.FINISH: _("Finished"),
    ChangeKind.ABORT: _("Ended early"),
    ChangeKind.GOAL: _("Goal"),
    ChangeKind.GAIN: _("Gain"),
    ChangeKind.PHASE: _("Phase"),
    ChangeKind.ACTIVATION_THRESHOLD: _("Robot threshold"),
    ChangeKind.ROBOT_INTENSITY: _("Robot"),
    ChangeKind.VALENCE: _("Next feedback type"),
    ChangeKind.FEEDBACK_TEXT: _("Words edited"),
    ChangeKind.WORDS_SHOWN: _("Words"),
    ChangeKind.CHART_STYLE: _("Chart"),
    RobotEntry.STOP: _("Robot stopped"),
    RobotEntry.ARM: _("Robot armed"),
    Remark.BORG: _("Exertion (Borg)"),
}


@dataclass(frozen=True, slots=True)
class Moment:
    """An event in words."""

    event: SessionEvent
    words: str


@dataclass(frozen=True, slots=True)
class Review:
    """A session with its figures (``training.figures``), its events and the data of its chart."""

    figures: dict[str, Any]
    moments: list[Moment]
    gestures: int
    chart: dict[str, Any]


def review_session(user: User, session: TrainingSession) -> Review:
    """Tell a session. Its figures are folded from the log, its strides are the stored verdicts."""
    plan = session.to_plan()
    fold = fold_log(SessionFold(plan), session)
    events = list(
        SessionEvent.objects.visible_to(user)
        .filter(session=session)
        .select_related("by")
        .order_by("pk")
    )
    moments = [
        Moment(event, say_event(event, plan)) for event in events if event.kind not in COUNTED
    ]
    gestures = sum(
        event.kind == RobotEntry.GESTURE.value and event.data.get("phase") == "started"
        for event in events
    )
    figures = summarize_session(fold)
    if session.original_id is not None:  # no log: what the original added up is all there is
        stored = figures_of(user, [session]).get(session.pk, {})
        figures |= {"score": stored.get("score"), "active_s": session.active_s}
    return Review(figures, moments, gestures, draw(user, session, fold, moments))


def say_event(event: SessionEvent, plan: SessionPlan) -> str:
    """Put an event into words: what it was, and from what to what."""
    name = NAMES.get(event.kind, event.get_kind_display().capitalize())  # type: ignore[call-overload]
    match event.kind:
        case ChangeKind.GOAL:
            old, new = event.old, say_quantity(event.value, plan.measure.unit)
            return f"{name} {new}" if old is None else f"{name} {say_number(old)} → {new}"
        case ChangeKind.GAIN:
            return f"{name} {say_number(event.old)} → {say_number(event.value)}"
        case ChangeKind.ACTIVATION_THRESHOLD:
            return f"{name} {say_rate(event.old)} → {say_rate(event.value)}"
        case ChangeKind.ROBOT_INTENSITY:
            levels = [LEVELS[name_robot_level(each)] for each in (event.old, event.value)]
            return f"{name} {levels[0]} → {levels[1]}"
        case Remark.BORG:
            return f"{name} {say_number(event.value, 0)}"
        case ChangeKind.PHASE:
            return f"{name}: {gettext(plan.phases[int(event.value or 0)].name)}"
        case ChangeKind.VALENCE:
            return f"{name}: {_name_type(event.data.get('value'))}"
        case ChangeKind.FEEDBACK_TEXT:
            return f"{name}: {_name_type(event.data.get('value', {}).get('valence'))}"
        case ChangeKind.WORDS_SHOWN:
            return f"{name}: {gettext('on') if event.value else gettext('off')}"
        case ChangeKind.CHART_STYLE:
            return f"{name}: {STYLES.get(event.data.get('value', ''), '')}"
        case ChangeKind.PAUSE if event.data.get("value") in PAUSED_BY:
            return f"{name} {PAUSED_BY[event.data['value']]}"
    return str(name)


def _name_type(slug: Any) -> str:
    return gettext(VALENCES[slug].label) if slug in VALENCES else str(slug or "")


def sum_up(plan: SessionPlan, review: Review) -> list[dict[str, str]]:
    """Give the figures above the chart: label, value, and what stands beside it."""
    figures, target = review.figures, plan.target
    changes = sum(moment.event.kind == ChangeKind.GOAL for moment in review.moments)
    lost = figures["missing"] + figures["invalid"]
    entries = [
        (
            gettext("Hit rate"),
            say_rate(figures["hit_rate"]),
            gettext("wanted %(rate)s") % {"rate": say_rate(target.hit_rate)}
            if target.hit_rate
            else "",
        ),
        (
            gettext("Score"),
            say_number(figures["score"], 0),
            gettext("points")
            if plan.valence.has_points or figures["score"] is not None
            else gettext("this type has no points"),
        ),
        (
            gettext("Goal"),
            say_number(figures["goal"]),
            plan.measure.unit
            + (gettext(", changed %(count)s ×") % {"count": changes} if changes else ""),
        ),
        (
            gettext("Walked"),
            say_duration(figures["active_s"]),
            gettext("planned %(time)s") % {"time": say_duration(target.duration_s)}
            if target.duration_s
            else "",
        ),
        (
            gettext("Strides"),
            say_number(figures["strides"], 0),
            ngettext("%(count)s does not count", "%(count)s do not count", lost) % {"count": lost}
            if lost
            else "",
        ),
    ]
    return [{"label": label, "value": value, "beside": beside} for label, value, beside in entries]


def draw(
    user: User, session: TrainingSession, fold: SessionFold, moments: list[Moment]
) -> dict[str, Any]:
    """Give the chart's data: strides of the trained leg by column, phases, and what was changed.

    ``shown`` is gain × value, also where no goal was known yet; ``hit`` is None where nothing was
    judged. A stride that does not count has no value, only its reasons.
    """
    plan = fold.plan
    steps = (
        Step.objects.visible_to(user)
        .filter(session=session, side=session.trained_side)
        .order_by("number")
        .values_list("number", "valid", "value", "gain", "shown", "goal", "hit", "phase", "reasons")
    )
    columns: dict[str, list[Any]] = {
        name: [] for name in ("number", "shown", "goal", "hit", "phase", "why")
    }
    for number, valid, value, gain, shown, goal, hit, phase, reasons in steps.iterator():
        seen = shown if shown is not None else value * gain if valid and value is not None else None
        row = (number, _short(seen), _short(goal), hit, phase, ", ".join(reasons))
        for column, entry in zip(columns.values(), row, strict=True):
            column.append(entry)
    runs = groupby(zip(columns.pop("phase"), columns["number"], strict=True), lambda pair: pair[0])
    phases = [(plan.phases[index], [number for _, number in run]) for index, run in runs]
    types = _types_by_run(fold, [run for _, run in phases])
    return {
        "unit": plan.measure.unit,
        "strides": columns,
        "phases": [
            {
                "name": gettext(phase.name) + changed,
                "feedback": phase.feedback,
                "from": run[0],
                "to": run[-1],
            }
            for (phase, run), changed in zip(phases, types, strict=True)
        ],
        "marks": [
            {"after": moment.event.after_number, "kind": moment.event.kind, "words": moment.words}
            for moment in moments
            if moment.event.kind in MARKED_CHANGES
        ],
    }


def _types_by_run(fold: SessionFold, runs: Sequence[list[int]]) -> list[str]:
    """Give the feedback type that begins with each run of strides, to stand behind its name."""
    ends = [0, *(run[-1] for run in runs)]
    return [
        "".join(f" · {_name_type(slug)}" for after, slug in fold.switches if end <= after < run[0])
        for end, run in zip(ends, runs, strict=False)
    ]


def _short(value: float | None) -> float | None:
    """Give a value to four places: more would only lengthen the page."""
    return None if value is None else round(value, 4)
