"""One session on one page of paper, for the therapist's records."""

from __future__ import annotations

import math
from collections import defaultdict
from datetime import datetime
from itertools import groupby
from typing import Any

from django.utils.translation import gettext as _
from django.utils.translation import ngettext

from rehab.people.models import User
from rehab.sessions.formatting import (
    clinic_time,
    format_duration,
    format_number,
    format_quantity,
    format_rate,
)
from rehab.sessions.log import Remark, RobotEntry, SessionEvent
from rehab.sessions.models import TrainingSession
from rehab.sessions.reports.review import Review, review_session
from rehab.sessions.reports.trend import Point, read_trend
from rehab.training.changes import ChangeKind
from rehab.training.plans import SessionPlan

# What one page has room for; what is left out is counted, and stands in the session's details.
PHASES, GOALS, TIMES = 9, 6, 6
ADVERSE = (Remark.FALL, Remark.NEAR_FALL, Remark.PAIN, Remark.DIZZINESS)
REMARKS = {kind.value for kind in Remark}
# The chart, in units of its view box.
WIDE, HIGH, SPACE = 1000.0, 250.0, 18.0
DOT, RING = 3.2, 2.6


def write_report(user: User, session: TrainingSession) -> dict[str, Any]:
    """Give everything that the page says of a session."""
    plan = session.to_plan()
    review = review_session(user, session)
    ended = read_trend(user, TrainingSession.objects.visible_to(user).filter(pk=session.pk))
    point = ended[0] if ended else None
    events = list(SessionEvent.objects.visible_to(user).filter(session=session).order_by("pk"))
    phases = review.figures["phases"]
    return {
        "figures": _sum_up(plan, review, point),
        "goals": _tell_goals(plan, review, session),
        "phases": [_tell_phase(phase) for phase in phases[:PHASES]],
        "more_phases": max(0, len(phases) - PHASES),
        "remarks": _tell_remarks(events, session),
        "robot": _tell_robot(events),
        "chart": draw_chart(review.chart),
        "unit": plan.measure.unit,
    }


def _sum_up(plan: SessionPlan, review: Review, point: Point | None) -> list[tuple[str, str, str]]:
    """Give the main figures: label, value, and what stands beside it."""
    figures, target = review.figures, plan.target
    walked, baseline = (point.walked, point.baseline) if point else (None, None)
    unit, lost = plan.measure.unit, figures["missing"] + figures["invalid"]
    scored = plan.valence.has_points or figures["score"] is not None
    wanted = (
        _("wanted %(rate)s") % {"rate": format_rate(target.hit_rate)} if target.hit_rate else ""
    )
    planned = ""
    if target.duration_s:
        planned = _("planned %(time)s") % {"time": format_duration(target.duration_s)}
    against = _("no baseline")
    if baseline and point:
        gain = point.gain
        change = format_rate(gain) if gain is None or gain <= 0 else f"+{format_rate(gain)}"
        said = {"mean": format_quantity(baseline.mean, unit), "change": change}
        against = _("baseline %(mean)s, %(change)s") % said
    left_out = ngettext("%(count)s does not count", "%(count)s do not count", lost)
    return [
        (_("Hit rate"), format_rate(figures["hit_rate"]), wanted),
        (
            _("Mean with feedback"),
            format_quantity(walked.mean if walked else None, unit),
            against,
        ),
        (
            _("Strides, trained leg"),
            format_number(figures["strides"], 0),
            left_out % {"count": format_number(lost, 0)} if lost else "",
        ),
        (_("Walked"), format_duration(figures["active_s"]), planned),
        (
            _("Score"),
            format_number(figures["score"], 0) if scored else "–",
            _("points") if scored else _("this type has no points"),
        ),
    ]


def _tell_goals(plan: SessionPlan, review: Review, session: TrainingSession) -> list[str]:
    """Tell the goal as it began and each change of it."""
    changes = [moment for moment in review.moments if moment.event.kind == ChangeKind.GOAL]
    first = plan.goal.value
    if changes and changes[0].event.old is not None:
        first = changes[0].event.old
    unit = plan.measure.unit
    if first is not None:
        told = [format_quantity(first, unit)]
    elif plan.goal.percent_of_baseline:
        percent = {"percent": format_number(plan.goal.percent_of_baseline, 0)}
        told = [_("%(percent)s %% of baseline") % percent]
    else:
        told = []
    for moment in changes[:GOALS]:
        at = clinic_time(moment.event.at, session.clinic)
        told.append(f"{format_quantity(moment.event.value, unit)} ({at:%H:%M})")
    left = len(changes) - GOALS
    if left > 0:
        more = ngettext("%(count)s change more", "%(count)s changes more", left)
        told += [f"… {more % {'count': left}} …", format_quantity(review.figures["goal"], unit)]
    return told


def _tell_phase(phase: dict[str, Any]) -> dict[str, Any]:
    return phase | {
        "hit_rate_words": format_rate(phase["hit_rate"]),
        "mean_words": format_number(phase["mean"]),
        "performance_words": format_rate(phase["mean_performance"]),
    }


def _tell_remarks(events: list[SessionEvent], session: TrainingSession) -> list[dict[str, Any]]:
    """Tell each kind of remark with its times, adverse ones first; Borg with its values."""
    times: defaultdict[Remark, list[str]] = defaultdict(list)
    for event in events:
        if event.kind in REMARKS:
            words = f"{clinic_time(event.at, session.clinic):%H:%M}"
            if event.kind == Remark.BORG:
                words = f"{format_number(event.value, 0)} ({words})"
            times[Remark(event.kind)].append(words)
    order = sorted(times, key=lambda kind: (kind not in ADVERSE, list(Remark).index(kind)))
    return [
        {
            "name": _("Exertion (Borg)") if kind == Remark.BORG else _(say_kind(kind)),
            "count": 0 if kind == Remark.BORG else len(times[kind]),
            "times": _shorten(times[kind]),
            "adverse": kind in ADVERSE,
        }
        for kind in order
    ]


def say_kind(kind: Remark) -> str:
    """Name a remark as its button does."""
    return kind.value.replace("_", " ").capitalize()


def _shorten(entries: list[str]) -> str:
    """Join entries; of many the first ones, how many are left out, and the last."""
    if len(entries) <= TIMES:
        return ", ".join(entries)
    more = _("%(count)s more") % {"count": len(entries) - TIMES}
    return ", ".join([*entries[: TIMES - 1], f"… {more} …", entries[-1]])


def _tell_robot(events: list[SessionEvent]) -> str:
    """Tell what the robot did: gestures, how many windows it answered, its stops."""
    kinds: defaultdict[str, list[SessionEvent]] = defaultdict(list)
    for event in events:
        kinds[event.kind].append(event)
    begun = [row for row in kinds[RobotEntry.GESTURE] if row.data.get("phase") == "started"]
    windows, stops = len(kinds[RobotEntry.DECISION]), len(kinds[RobotEntry.STOP])
    if not (begun or windows or stops):
        return _("No robot.")
    told = [ngettext("%(count)s gesture", "%(count)s gestures", len(begun)) % {"count": len(begun)}]
    if windows:
        above = sum(bool(row.data.get("above")) for row in kinds[RobotEntry.DECISION])
        words = _("%(above)s of %(count)s windows of five seconds at or above its threshold")
        told.append(words % {"above": above, "count": windows})
    if stops:
        told.append(ngettext("stopped once", "stopped %(count)s times", stops) % {"count": stops})
    return ", ".join(told) + "."


def draw_chart(chart: dict[str, Any]) -> dict[str, Any]:
    """Draw all strides of the trained leg against the goal, as paths that print in gray.

    At or above the goal is a disc, below a ring, without a goal a cross; what does not count is a
    mark at the foot. The goal is a line, phases without feedback are shaded.
    """
    strides = chart["strides"]
    numbers, shown, goals = strides["number"], strides["shown"], strides["goal"]
    if not numbers:
        return {}
    known = [value for value in (*shown, *goals) if value is not None]
    highest: float = max(known, default=1.0)
    top = 1.08 * highest if highest > 0 else 1.0
    first: int = numbers[0]
    span: int = max(1, numbers[-1] - first)

    def x(number: float) -> float:
        return SPACE + (WIDE - 2 * SPACE) * (number - first) / span

    def y(value: float) -> float:
        return HIGH - HIGH * max(value, 0.0) / top

    paths: defaultdict[str, list[str]] = defaultdict(list)
    for number, value, hit in zip(numbers, shown, strides["hit"], strict=True):
        at = x(number)
        if value is None:
            paths["lost"].append(f"M{at:.1f} {HIGH:.0f}v6")
        elif hit is None:
            paths["free"].append(f"M{at - 2.4:.1f} {y(value):.1f}h4.8m-2.4 -2.4v4.8")
        elif hit:
            paths["hit"].append(f"M{at:.1f} {y(value):.1f}h0")
        else:
            up = y(value)
            paths["miss"].append(
                f"M{at - RING:.1f} {up:.1f}a{RING} {RING} 0 1 0 {2 * RING} 0"
                f"a{RING} {RING} 0 1 0 {-2 * RING} 0"
            )
    runs = [
        (goal, [number for number, _same in run])
        for goal, run in groupby(zip(numbers, goals, strict=True), lambda pair: pair[1])
    ]
    line = ""
    for before, (goal, run) in zip([(None, [0]), *runs], runs, strict=False):
        if goal is not None:
            line += f"V{y(goal):.1f}" if before[0] else f"M{x(run[0]):.1f} {y(goal):.1f}"
            line += f"H{x(run[-1] + 1 if run[-1] != numbers[-1] else run[-1]):.1f}"
    return {
        **{name: "".join(parts) for name, parts in paths.items()},
        "goal": line,
        "phases": [
            {
                "name": phase["name"],
                "x": round(x(phase["from"]), 1),
                "width": round(max(1.0, x(phase["to"]) - x(phase["from"])), 1),
                "quiet": not phase["feedback"],
            }
            for phase in chart["phases"]
        ],
        "levels": [{"y": round(y(value), 1), "words": f"{value:g}"} for value in _even_values(top)],
        "first": numbers[0],
        "last": numbers[-1],
        "strides": len(numbers),
    }


def _even_values(top: float) -> list[float]:
    """Give values that are easy to say, three to seven of them below the top."""
    size = 10.0 ** math.floor(math.log10(top))
    step = next(step for step in (size / 5, size / 2, size, 2 * size) if top / step < 8)
    return [round(step * count, 10) for count in range(1, math.ceil(top / step))]


def moment_of(session: TrainingSession) -> datetime:
    """Give when a session began, by the clinic's clock."""
    return clinic_time(session.started_at or session.created_at, session.clinic)
