"""One session on one page of paper, for the therapist's records."""

from __future__ import annotations

from collections import Counter, defaultdict
from dataclasses import replace
from typing import Any

from django.utils.formats import date_format
from django.utils.text import capfirst
from django.utils.translation import gettext as _
from django.utils.translation import ngettext

from rehab.people.models import User
from rehab.sessions.formatting import (
    clinic_time,
    format_number,
    format_quantity,
    format_rate,
    format_significant,
)
from rehab.sessions.log import EVENTS, Remark, RobotEntry, SessionEvent, Step
from rehab.sessions.models import TrainingSession
from rehab.sessions.noted_conditions import (
    CONDITIONS,
    RATED,
    format_noted,
    summarize_conditions,
)
from rehab.sessions.reports.answers import list_answers
from rehab.sessions.reports.better_or_worse import Change, judge
from rehab.sessions.reports.remarks import read_noted
from rehab.sessions.reports.report_chart import PAPER, PHONE, draw_chart
from rehab.sessions.reports.review import SessionReview, review_session
from rehab.sessions.reports.summary import (
    Figure,
    SessionSummary,
    format_incidents,
    format_mean,
    format_phases,
    format_summary,
    load_point,
)
from rehab.sessions.reports.trend import TrendPoint, load_trend
from rehab.training.changes import ChangeKind
from rehab.training.measures import WORN
from rehab.training.plans import SessionPlan
from rehab.training.steps import SENT_VALUE

# What one page has room for; omitted entries are counted, and are on the session's own page.
MAX_PHASES, MAX_GOALS, MAX_TIMES = 9, 6, 5
# A line of the page of paper has room for so many.
MAX_EXTRAS = 8
# Moments and marks of single strides, of which a mean says nothing.
WITHOUT_MEAN = ("initial_contact_s", SENT_VALUE, *WORN.values())


def report_context(user: User, session: TrainingSession) -> dict[str, Any]:
    """Return everything that the report shows of a session."""
    plan = session.to_plan()
    review = review_session(user, session)
    phases, remarks = format_phases(review), _summarize_remarks(review.rows, session)
    point = load_point(user, session)
    return {
        "told": _sum_up(session, review, point),
        "figures": _list_figures(format_summary(plan, review), format_mean(session, point)),
        "incidents": format_incidents(review, session),
        "goals": _describe_goals(plan, review),
        "phases": phases[:MAX_PHASES],
        "more_phases": max(0, len(phases) - MAX_PHASES),
        "adverse": [remark for remark in remarks if remark["adverse"]],
        "remarks": [remark for remark in remarks if not remark["adverse"]],
        "extras": mean_extras(user, session),
        "answers": list_answers(user, session),
        "robot": _describe_robot(review.rows),
        "charts": [draw_chart(review.chart, size) for size in (PAPER, PHONE)],
        "gains": review.chart["gains"],
        "last_time": _describe_last_time(user, session),
        "has_close": bool(review.figures["close"]),
        "unit": plan.measure.unit,
    }


def _sum_up(session: TrainingSession, review: SessionReview, point: TrendPoint | None) -> list[str]:
    """Return what a session came to, in a few sentences; none before it has figures.

    ``session``: with its measure; ``point``: its point of the trend.
    """
    if point is None or point.hit_rate is None:
        return []
    rates = {"rate": format_rate(point.hit_rate), "wanted": format_rate(point.target_hit_rate)}
    told = [
        _("%(rate)s of the steps reached the goal; the target was %(wanted)s.") % rates
        if point.target_hit_rate
        else _("%(rate)s of the steps reached the goal.") % rates
    ]
    if point.with_feedback and point.baseline and point.baseline.mean > 0:
        ratio = point.with_feedback.mean / point.baseline.mean - 1
        sentences = {
            Change.MORE: _("%(measure)s was %(change)s above the baseline."),
            Change.SAME: _("%(measure)s was about as at the baseline."),
            Change.LESS: _("%(measure)s was %(change)s below the baseline."),
        }
        words = {"measure": capfirst(_(session.measure.name)), "change": format_rate(abs(ratio))}
        told.append(sentences[judge(ratio)] % words)
    goals = [entry.event for entry in review.events if entry.event.kind == ChangeKind.GOAL]
    if goals and goals[0].old is not None and goals[0].old != review.figures["goal"]:
        unit = session.measure.unit
        ends = {
            "first": format_number(goals[0].old),
            "last": format_quantity(review.figures["goal"], unit),
        }
        told.append(_("The goal went from %(first)s to %(last)s.") % ends)
    rated = summarize_conditions(session, review.rows)
    most = [f"{EVENTS[kind]} {format_noted(kind, rated[kind])}" for kind in RATED if kind in rated]
    if most:
        told.append(_("The patient’s highest ratings: %(noted)s.") % {"noted": ", ".join(most)})
    return told


def _list_figures(summary: SessionSummary, mean: Figure) -> list[Figure]:
    """Return the main figures in the order of the page."""
    return [
        summary.hit_rate,
        mean,
        replace(summary.strides, label=_("Strides, trained leg")),
        summary.duration,
        summary.score,
    ]


def _describe_last_time(user: User, session: TrainingSession) -> list[str]:
    """Return how the patient's session before this one went, which trained the same measure."""
    before = TrainingSession.objects.visible_to(user).filter(
        patient=session.patient_id,
        measure=session.measure_id,
        simulated=session.simulated,
        created_at__lt=session.created_at,
    )
    points = load_trend(user, before, most=1)
    if not points:
        return []
    (last,) = points
    unit = session.measure.unit
    mean = last.with_feedback.mean if last.with_feedback else None
    day = date_format(clinic_time(last.session.began_at, session.clinic), "DATE_FORMAT")
    figures = {
        _("Hit rate"): format_rate(last.hit_rate),
        _("Mean"): format_quantity(mean, unit),
        _("Goal"): format_quantity(last.session.goal, unit),
    }
    told = [f"{label} {figure}" for label, figure in figures.items()]
    return [day, last.session.valences_label, *told]


def _describe_goals(plan: SessionPlan, review: SessionReview) -> list[str]:
    """Return the first goal and each change of it."""
    changes = [entry for entry in review.events if entry.event.kind == ChangeKind.GOAL]
    first = plan.goal.value
    if changes and changes[0].event.old is not None:
        first = changes[0].event.old
    unit = plan.measure.unit
    if first is not None:
        goals = [format_quantity(first, unit)]
    elif plan.goal.percent_of_baseline:
        percent = {"percent": format_number(plan.goal.percent_of_baseline, 0)}
        goals = [_("%(percent)s %% of baseline") % percent]
    else:
        goals = []
    for entry in changes[:MAX_GOALS]:
        goals.append(f"{format_quantity(entry.event.value, unit)} ({entry.at:%H:%M})")
    omitted = len(changes) - MAX_GOALS
    if omitted > 0:
        more = ngettext("%(count)s change more", "%(count)s changes more", omitted)
        goals += [f"… {more % {'count': omitted}} …", format_quantity(review.figures["goal"], unit)]
    return goals


def _summarize_remarks(
    events: list[SessionEvent], session: TrainingSession
) -> list[dict[str, Any]]:
    """Return each kind of remark with its times and values; falls are among the incidents."""
    times: defaultdict[Remark, list[str]] = defaultdict(list)
    with_value: set[Remark] = set()
    noted = [one for one in read_noted(events) if one.kind != Remark.FALL]
    for one in noted:
        text = f"{clinic_time(one.at, session.clinic):%H:%M}"
        if value := format_noted(one.kind, one.value):
            with_value.add(one.kind)
            text = f"{value} ({text})"
        times[one.kind].append(text)
    adverse = {one.kind for one in noted if one.is_adverse}
    return [
        {
            "name": capfirst(EVENTS[kind]),
            "count": 0 if kind in with_value else len(times[kind]),
            "times": _join(times[kind], 2 if kind in CONDITIONS else MAX_TIMES),
            "adverse": kind in adverse,
        }
        for kind in sorted(times, key=list(Remark).index)
    ]


def _join(entries: list[str], most: int) -> str:
    """Join entries; of more than so many, the first ones, how many are omitted, and the last."""
    if len(entries) <= most:
        return ", ".join(entries)
    more = _("%(count)s more") % {"count": len(entries) - most}
    return ", ".join([*entries[: most - 1], f"… {more} …", entries[-1]])


def _describe_robot(events: list[SessionEvent]) -> str:
    """Return what the robot did as text: gestures, windows at or above its threshold, stops."""
    kinds: defaultdict[str, list[SessionEvent]] = defaultdict(list)
    for event in events:
        kinds[event.kind].append(event)
    started = [row for row in kinds[RobotEntry.GESTURE] if row.data.get("phase") == "started"]
    windows, stops = len(kinds[RobotEntry.DECISION]), len(kinds[RobotEntry.STOP])
    if not (started or windows or stops):
        return _("No robot.")
    count = len(started)
    parts = [ngettext("%(count)s gesture", "%(count)s gestures", count) % {"count": count}]
    if windows:
        above = sum(bool(row.data.get("above")) for row in kinds[RobotEntry.DECISION])
        text = _("%(above)s of %(count)s decisions at or above its threshold")
        parts.append(text % {"above": above, "count": windows})
    if stops:
        parts.append(ngettext("stopped once", "stopped %(count)s times", stops) % {"count": stops})
    return ", ".join(parts) + "."


def mean_extras(user: User, session: TrainingSession) -> list[str]:
    """Return "name mean" of the trained leg's valid strides, for what most of them have.

    Names are those that the source sent.
    """
    sums: defaultdict[str, float] = defaultdict(float)
    counts: Counter[str] = Counter()
    extras = Step.objects.visible_to(user).filter(
        session=session, side=session.trained_side, valid=True
    )
    for extra in extras.order_by("number").values_list("extra", flat=True).iterator():
        for name, value in extra.items():
            sums[name] += value
            counts[name] += 1
    names = [
        name
        for name, _count in counts.most_common()
        if name not in WITHOUT_MEAN and not name.startswith("flag_")
    ]
    places = {"foot": _("foot"), "shank": _("shin")}
    worn = [
        _("sensor on the %(place)s, algorithm %(version)g, %(count)s strides")
        % {"place": places[place], "version": sums[name] / counts[name], "count": counts[name]}
        for place, name in WORN.items()
        if counts[name]
    ]
    return worn + [
        f"{name} {format_significant(sums[name] / counts[name])}" for name in names[:MAX_EXTRAS]
    ]
