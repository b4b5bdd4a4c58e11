"""The insight page: weeks, feedback types and patients compared at equal goals."""

from __future__ import annotations

from typing import Any

from django.http import HttpRequest, HttpResponse
from django.shortcuts import render
from django.utils import timezone
from django.views.decorators.http import require_safe

from rehab.people.access import for_roles, user_of
from rehab.people.roles import Role
from rehab.sessions.formatting import format_change, format_number, format_rate
from rehab.sessions.reports.insight import ANY_GOAL, KEYS, PERIODS, Group, compare, read_view
from rehab.sessions.reports.insight_summary import summarize_groups
from rehab.sessions.reports.replay import start_of

LISTED = 40  # events and notes, the newest


@for_roles(Role.LEAD, Role.PT)
@require_safe
def show_insight(request: HttpRequest) -> HttpResponse:
    """Compare the clinic's sessions of patients; a simulated patient's are never among them."""
    user = user_of(request)
    view = read_view(user, request.GET, timezone.now())
    events = [
        (adverse, one, max(0.0, (adverse.at - start_of(one.session)).total_seconds()))
        for one in view.shown
        for adverse in one.adverse
    ]
    events.sort(key=lambda entry: entry[0].at, reverse=True)
    found = compare(view.shown, view.by)
    groups = [_to_row(group) for group in found]
    context = {
        "view": view,
        "any_goal": ANY_GOAL,
        "keys": {key: label for key, (label, *_functions) in KEYS.items()},
        "periods": PERIODS,
        "groups": groups,
        "summary": summarize_groups(found),
        "compared": KEYS[view.by][0],
        "period": PERIODS[view.weeks],
        "goals": {key: label for key, label, _count in view.bands}.get(view.band),
        "has_interval": any("width" in row["drawn"] for row in groups),
        "events": events[:LISTED],
        "noted": [one for one in view.shown if one.note][:LISTED],
    }
    return render(request, "sessions/insight.html", context)


def _to_row(group: Group) -> dict[str, Any]:
    """Return a group as text, and its interval in percent for the drawing."""
    rate = group.hit_rate
    drawn: dict[str, float] = {}
    words = format_rate(rate.mean if rate else None)
    if rate is not None:
        drawn["mean"] = 100 * rate.mean
        if rate.low is not None and rate.high is not None:
            drawn |= {"low": 100 * rate.low, "width": 100 * (rate.high - rate.low)}
            low, high = format_number(100 * rate.low, 0), format_rate(rate.high)
            words += f" ({low}–{high})"
    return {
        "group": group,
        "rate": words,
        "drawn": drawn,
        "improvement": format_change(group.improvement.mean / 100 if group.improvement else None),
        "minutes": format_number(group.minutes, 0),
        "exertion": format_number(group.exertion.mean if group.exertion else None, 1),
    }
