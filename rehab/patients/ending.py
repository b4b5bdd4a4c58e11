"""The end of a session in the patient's words: today beside last time, and one honest sentence.

What is told follows the rules of the feedback type: a row of steps at the goal only where hits earn
points, and under the explicit type the value without a verdict or a milestone. Fewer is never
blamed, and a goal that was moved is said before steps at the goal are compared.
"""

from __future__ import annotations

from dataclasses import dataclass
from datetime import date
from typing import Any

from django.db.models import Max, QuerySet
from django.utils.translation import gettext as _

from rehab.patients.visits import Visit
from rehab.sessions.formatting import format_number, format_quantity
from rehab.sessions.log import SessionMetric, Step
from rehab.sessions.models import TrainingSession
from rehab.sessions.reports.trend import load_own_trend
from rehab.training.changes import State

SAME_RATE = 0.05  # hit rates of sessions that differ by less are called as many steps
SAME_GOAL = 0.02  # of the goal
MILESTONES = (5, 10, 25, 50)  # sessions, and each further hundred


@dataclass(frozen=True, slots=True)
class SessionResult:
    """What one session came to: hit rate, mean value with feedback, and goal at its end."""

    hit_rate: float
    mean: float | None
    goal: float | None


@dataclass(frozen=True, slots=True)
class Fact:
    """A figure that is told by itself."""

    label: str
    value: str


@dataclass(frozen=True, slots=True)
class Bar:
    """A session's figure as a bar; ``percent`` of the bar's room."""

    label: str
    value: str
    percent: float


def describe_ending(session: TrainingSession) -> dict[str, Any]:
    """Return what the page at a session's end tells its patient, of this patient alone.

    A paired tablet sees no earlier session and no visit, and yet tells the patient of them: the
    caller has checked that this session may be seen.
    Without judged steps, and in a blinded study, there is no figure to tell: `title` is empty.
    """
    plan = session.to_plan()
    today, last = _find_walked(session)
    if session.patient.blinded or today is None:
        return {"title": "", "bars": [], "facts": [], "sentence": ""}
    facts: list[Fact] = []
    if not plan.valence.has_points:
        title, bars = _("Your push, on average"), _mean_bars(today, last, plan.measure.unit)
        if plan.measure.slug != "a2":
            title = _("Your value, on average")
        sentence = ""
    else:
        title, bars = _("Steps at the goal"), _hit_bars(today, last)
        sentence = describe_change(today, last)
        facts = _find_facts(session, rewards=plan.valence.rewards)
    return {"title": title, "bars": bars, "facts": facts, "sentence": sentence}


def describe_change(today: SessionResult, last: SessionResult | None) -> str:
    """Return one sentence that is true of today and last time, and blames nobody."""
    if last is None:
        return _("Next time you can compare with today.")
    raised = (today.goal or 0) - (last.goal or 0)
    fewer = today.hit_rate < last.hit_rate - SAME_RATE
    if last.goal and raised > SAME_GOAL * last.goal:
        if fewer:
            return _("The goal was higher than last time.")
        return _("The goal was higher than last time, and you reached it as often.")
    if last.goal and raised < -SAME_GOAL * last.goal:
        return _("The goal was lower than last time.")
    if fewer:
        return _("Fewer steps at the goal than last time. Days differ.")
    if today.hit_rate > last.hit_rate + SAME_RATE:
        return _("More steps at the goal than last time.")
    return _("As many steps at the goal as last time.")


def is_milestone(sessions: int) -> bool:
    """Return whether so many sessions are a number to be told."""
    return sessions in MILESTONES or (sessions > 0 and sessions % 100 == 0)


def next_visit(session: TrainingSession, today: date) -> Visit | None:
    """Return the visit that the patient is expected for next, after today."""
    visits = Visit.everywhere.filter(patient=session.patient_id, day__gt=today)
    return visits.order_by("day").first()


def _sessions_before(session: TrainingSession) -> QuerySet[TrainingSession]:
    """Return the earlier sessions that compare: same measure, walked alike, counted."""
    return TrainingSession.everywhere.filter(
        patient=session.patient_id,
        measure=session.measure_id,
        trained_side=session.trained_side,
        simulated=session.simulated,
        state=State.FINISHED,
        excluded=False,
        created_at__lt=session.created_at,
        metrics__slug="hit_rate",
    )


def _find_facts(session: TrainingSession, *, rewards: bool) -> list[Fact]:
    """Return the longest row of hits where hits earn points, and a round number of sessions."""
    before = _sessions_before(session)
    facts = []
    rows = SessionMetric.everywhere.filter(slug="best_streak")
    row = rows.filter(session=session).values_list("value", flat=True).first()
    if rewards and row:
        earlier = rows.filter(session__in=before.values("pk")).aggregate(most=Max("value"))["most"]
        label = _("Most in a row so far") if earlier and row > earlier else _("Most in a row")
        facts.append(Fact(label, format_number(row, 0)))
    count = before.count() + 1
    if is_milestone(count):
        facts.append(Fact(_("Sessions so far"), format_number(count, 0)))
    return facts


def _find_walked(
    session: TrainingSession,
) -> tuple[SessionResult | None, SessionResult | None]:
    """Return this session and the newest one before that compares."""
    before = _sessions_before(session).order_by("-created_at", "-pk")
    wanted = [session.pk, *before.values_list("pk", flat=True)[:1]]
    found: dict[int, SessionResult] = {}
    for point in load_own_trend(TrainingSession.everywhere.filter(pk__in=wanted)):
        if point.hit_rate is None:  # nobody counted hits there
            continue
        steps = Step.everywhere.filter(session=point.session, goal__isnull=False)
        goal = steps.order_by("-number").values_list("goal", flat=True).first()
        mean = point.with_feedback.mean if point.with_feedback else None
        found[point.session.pk] = SessionResult(point.hit_rate, mean, goal)
    return found.get(session.pk), found.get(wanted[-1]) if len(wanted) > 1 else None


def _hit_bars(today: SessionResult, last: SessionResult | None) -> list[Bar]:
    return [
        Bar(
            label,
            _("%(hits)s of 10") % {"hits": round(10 * walked.hit_rate)},
            round(100 * walked.hit_rate, 1),
        )
        for label, walked in _labeled(today, last)
    ]


def _mean_bars(today: SessionResult, last: SessionResult | None, unit: str) -> list[Bar]:
    known = [(label, one.mean) for label, one in _labeled(today, last) if one.mean is not None]
    longest = max((mean for _label, mean in known), default=0.0)
    return [
        Bar(label, format_quantity(mean, unit), round(100 * max(mean, 0.0) / longest, 1))
        for label, mean in known
        if longest > 0
    ]


def _labeled(today: SessionResult, last: SessionResult | None) -> list[tuple[str, SessionResult]]:
    return [(_("Today"), today), *([(_("Last time"), last)] if last else [])]
