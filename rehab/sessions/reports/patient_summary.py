"""What a patient and the family read about the training: at a session's end, on paper, by a link.

One summary for the three pages, so that they cannot contradict each other: the same sessions count,
the same figures are read of them, and one threshold decides what is more, the same or less. Fewer
is never blamed, and where the goal was moved that is said in place of how many steps reached it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import date, datetime, timedelta
from statistics import fmean
from typing import Any

from django.db.models import Count, F, Max, Q, QuerySet, Sum
from django.utils.translation import gettext as _
from django.utils.translation import ngettext

from rehab.people.models import Patient
from rehab.sessions.formatting import (
    format_day,
    format_duration,
    format_number,
    format_quantity,
    format_rate,
)
from rehab.sessions.log import SessionMetric, Step
from rehab.sessions.models import TrainingSession
from rehab.sessions.reports.better_or_worse import (
    Change,
    Result,
    find_comparable,
    find_counted,
    judge,
    load_results,
)
from rehab.sessions.reports.earned_number import find_earned
from rehab.training.measures import A2

MILESTONES = (5, 10, 25, 50)  # sessions, and each further hundred
FAMILY_WEEKS = 6  # of sessions that a family sees
FAMILY_COMPARED = 3  # sessions on either side of "before"


@dataclass(frozen=True, slots=True)
class Bar:
    """A session's figure as a bar; ``percent`` of its room, None where nothing compares with it."""

    label: str
    value: str
    percent: float | None


# --- at a session's end ---------------------------------------------------------------------------


def describe_ending(session: TrainingSession) -> dict[str, Any]:
    """Return what the page at a session's end shows its patient, of this patient alone.

    It follows the feedback type: a row of steps at the goal only where hits earn points, and under
    the explicit type the value without a verdict or a milestone. Without judged steps, and in a
    blinded study, there is no figure: `title` is empty.
    """
    plan = session.to_plan()
    before = find_comparable(TrainingSession.everywhere.filter(patient=session.patient_id), session)
    last = before.last()
    is_counted = find_counted(TrainingSession.everywhere.filter(pk=session.pk)).exists()
    if session.patient.blinded or not is_counted:
        return {"title": "", "bars": [], "facts": [], "sentence": "", "earned": None}
    results = load_results(*([last] if last else []), session)
    earned = find_earned(session, before, plan.valence)
    labels = [_("Today"), _("Last time")]
    labeled = list(zip(labels, reversed(results), strict=False))
    if not plan.valence.has_points:
        is_push = plan.measure.slug == A2.slug
        title = _("Your push, on average") if is_push else _("Your value, on average")
        bars = draw_means(labeled, plan.measure.unit)
        if bars and session.goal is not None:
            bars.append(Bar(_("Goal"), format_quantity(session.goal, plan.measure.unit), None))
        meaning = _("How strongly your foot pushed off, on average over the steps with feedback.")
        return {
            "title": title,
            "meaning": meaning if is_push else "",
            "bars": bars,
            "facts": [],
            "sentence": "",
            "earned": earned,
        }
    return {
        "title": _("Steps at the goal"),
        "bars": [
            Bar(
                label,
                _("%(hits)s of 10") % {"hits": out_of_ten(one.hit_rate)},
                10 * out_of_ten(one.hit_rate),  # as long as its words say
            )
            for label, one in labeled
        ],
        "facts": _find_facts(session, before, rewards=plan.valence.rewards),
        "sentence": describe_today(results[-1], results[0] if len(results) > 1 else None),
        "earned": earned,
    }


def describe_today(today: Result, last: Result | None) -> str:
    """Return a sentence that is true of today and last time and blames nobody; may be empty."""
    if last is None:
        return _("Next time you can compare it with today.")
    match today.compare_goal(last), today.compare_hits(last):
        case Change.MORE, Change.LESS:
            return _("The goal was higher than last time.")
        case Change.MORE, _hits:
            return _("The goal was higher than last time, and you reached it just as often.")
        case Change.LESS, _hits:
            return ""  # beside a best value it would take that back; the therapist's report has it
        case _goal, Change.LESS:
            return _("Less often at the goal than last time. Every day is different.")
        case _goal, Change.MORE:
            return _("More often at the goal than last time.")
        case _:
            return _("As often at the goal as last time.")


def is_milestone(sessions: int) -> bool:
    """Return whether so many sessions are a round number, which the page names."""
    return sessions in MILESTONES or (sessions > 0 and sessions % 100 == 0)


def _find_facts(
    session: TrainingSession, before: QuerySet[TrainingSession], *, rewards: bool
) -> list[tuple[str, str]]:
    """Return the longest row of hits where hits earn points, and a round number of sessions."""
    facts = []
    rows = SessionMetric.everywhere.filter(slug="best_streak")
    row = rows.filter(session=session).values_list("value", flat=True).first()
    if rewards and row and row > 1:
        earlier = rows.filter(session__in=before.values("pk")).aggregate(most=Max("value"))["most"]
        words = ngettext("%(count)s step at the goal", "%(count)s steps at the goal", round(row))
        label = _("Most in a row so far") if earlier and row > earlier else _("Most in a row")
        facts.append((label, words % {"count": format_number(row, 0)}))
    count = before.count() + 1
    if is_milestone(count):
        facts.append((_("Sessions so far"), format_number(count, 0)))
    return facts


# --- by a link, for the family --------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class FamilyWalk:
    """A session, as the family's page has it."""

    day: date
    minutes: int
    hits: int  # of ten steps
    percent: float  # of all steps, for its bar
    points: str  # empty where none were won


def describe_for_family(patient: Patient, now: datetime) -> dict[str, Any]:
    """Return the last weeks' sessions, newest first, and a sentence on them.

    ``now`` is in the clinic's time zone.
    """
    mine = TrainingSession.everywhere.filter(
        patient=patient,
        simulated=patient.simulated,
        created_at__gte=now - timedelta(weeks=FAMILY_WEEKS),
    )
    rate, score = (
        Max("metrics__value", filter=Q(metrics__slug=slug)) for slug in ("hit_rate", "score")
    )
    rows = mine.filter(excluded=False).annotate(rate=rate, points=score)
    sessions = list(rows.filter(rate__isnull=False).order_by("-created_at", "-pk"))
    walks = [
        FamilyWalk(
            session.began_at.astimezone(now.tzinfo).date(),
            max(1, round(session.active_s / 60)),
            out_of_ten(session.rate),
            round(100 * session.rate, 1),
            # Some types only take points: what is below nothing would be read as a failure.
            format_number(session.points, 0) if (session.points or 0) > 0 else "",
        )
        for session in sessions
    ]
    return {"walks": walks, "sentence": compare_last_sessions(mine)}


def compare_last_sessions(sessions: QuerySet[TrainingSession]) -> str:
    """Return how a patient's last sessions compare with those before; empty for few."""
    last = find_counted(sessions).last()
    before = find_comparable(sessions, last).reverse()[: 2 * FAMILY_COMPARED - 1] if last else []
    return describe_weeks(load_results(*([last] if last else []), *before))


def describe_weeks(results: Sequence[Result]) -> str:
    """Return how the last sessions compare with those before; empty for few. Oldest first."""
    if len(results) < 2 * FAMILY_COMPARED:
        return ""
    late = _average(results[-FAMILY_COMPARED:])
    early = _average(results[-2 * FAMILY_COMPARED : -FAMILY_COMPARED])
    match late.compare_goal(early), late.compare_hits(early):
        case Change.MORE, _hits:
            return _(
                "On average the goal of the last three sessions was higher than that of the three "
                "before."
            )
        case Change.LESS, _hits:
            return _(
                "On average the goal of the last three sessions was lower than that of the three "
                "before."
            )
        case _goal, Change.SAME:
            return _(
                "In the last three sessions as many steps reached the goal as in the three before."
            )
        case _goal, Change.MORE:
            return _(
                "In the last three sessions more steps reached the goal than in the three before."
            )
        case _:
            return _(
                "In the last three sessions fewer steps reached the goal than in the three before."
            )


def _average(results: Sequence[Result]) -> Result:
    goals = [one.goal for one in results if one.goal is not None]
    return Result(fmean(one.hit_rate for one in results), None, fmean(goals) if goals else None)


# --- on paper, to take home -----------------------------------------------------------------------


def describe_take_home(sessions: QuerySet[TrainingSession], now: datetime) -> dict[str, Any]:
    """Return the texts and figures of a patient's sessions that may be seen.

    ``now`` is in the clinic's time zone.
    """
    counted = find_counted(sessions)
    last = counted.last()
    first = find_comparable(sessions, last).first() if last else None
    results = load_results(*(one for one in (first, last) if one))
    totals = counted.order_by().aggregate(Sum("active_s"), Count("pk"))
    keys = counted.order_by().values("pk")
    steps = Step.everywhere.filter(session__in=keys, valid=True, side=F("session__trained_side"))
    streaks = SessionMetric.everywhere.filter(session__in=keys, slug="best_streak")
    streak = streaks.aggregate(most=Max("value"))["most"]
    bars, development = [], ""
    if last and len(results) == 2 and all(one.mean for one in results):
        names = (_("First session"), _("Last session"))
        labels = [
            f"{name}, {format_day(one.began_at.astimezone(now.tzinfo).date(), now.date())}"
            for name, one in zip(names, results, strict=True)
            if one.began_at
        ]
        bars = draw_means(list(zip(labels, results, strict=True)), last.measure.unit)
        development = _describe_mean(results[0], results[1], last)
    return {
        "count": totals["pk__count"],
        "minutes": format_duration(totals["active_s__sum"] or 0.0),
        "steps": format_number(steps.count(), 0),
        "bars": bars,
        "development": development,
        "last_hits": out_of_ten(results[-1].hit_rate) if results else None,
        "streak": format_number(streak, 0) if streak else "",
        "measure": last.measure if last else None,
    }


def _describe_mean(before: Result, after: Result, session: TrainingSession) -> str:
    """Return how the mean has changed. A decrease is stated without a judgment."""
    if before.mean is None or after.mean is None or before.mean <= 0:
        return ""
    measure, change = session.measure, after.mean / before.mean - 1
    is_push = measure.slug == A2.slug
    values = {
        "what": _("Your push-off")
        if is_push
        else _("Your %(measure)s") % {"measure": measure.name},
        "change": format_rate(abs(change)),
    }
    match judge(change):
        case Change.SAME:
            text = _("%(what)s is about as in your first session.")
        case Change.MORE if is_push:
            text = _("%(what)s was %(change)s stronger than in your first session.")
        case Change.MORE:
            text = _("%(what)s was %(change)s more than in your first session.")
        case _:
            text = _("%(what)s was %(change)s less than in your first session.")
    return text % values


# --- figures --------------------------------------------------------------------------------------


def out_of_ten(rate: float) -> int:
    """Return a share of steps as so many of ten."""
    return round(10 * rate)


def draw_means(labeled: Sequence[tuple[str, Result]], unit: str) -> list[Bar]:
    """Return labeled means as bars, the longest over all the room; a single one has no length."""
    known = [(label, one.mean) for label, one in labeled if one.mean is not None]
    longest = max((mean for _label, mean in known), default=0.0)
    return [
        Bar(
            label,
            format_quantity(mean, unit),
            round(100 * max(mean, 0.0) / longest, 1) if len(known) > 1 else None,
        )
        for label, mean in known
        if longest > 0
    ]
