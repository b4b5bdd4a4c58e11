"""The page of a patient's past sessions."""

from __future__ import annotations

from datetime import datetime, timedelta
from typing import Any

from django.core.paginator import Paginator
from django.db.models import Count, Sum
from django.http import HttpRequest, HttpResponse
from django.shortcuts import get_object_or_404, render
from django.utils import timezone
from django.utils.formats import date_format
from django.utils.text import capfirst
from django.utils.translation import gettext
from django.utils.translation import gettext_lazy as _
from django.views.decorators.http import require_safe

from rehab.people.access import for_roles, user_of
from rehab.people.models import Patient
from rehab.people.roles import Role
from rehab.sessions.alarms import find_incidents
from rehab.sessions.assessment_results import load_courses
from rehab.sessions.formatting import (
    clinic_time,
    format_day,
    format_duration,
    format_number,
    format_rate,
    format_state,
)
from rehab.sessions.models import TrainingSession
from rehab.sessions.reports.patient_summary import compare_last_sessions
from rehab.sessions.reports.remarks import describe_noted
from rehab.sessions.reports.trend import (
    load_trend,
    metrics_by_session,
    summarize_trend,
    trend_chart_data,
)
from rehab.training.valences import VALENCES

PAGE_SIZE = 20
PERIODS = {"4": _("4 weeks"), "12": _("12 weeks"), "52": _("a year")}  # by how many weeks


@for_roles(Role.LEAD, Role.PT)
@require_safe
def list_sessions(request: HttpRequest, patient_id: int) -> HttpResponse:
    """List a patient's sessions, newest first, with the trend over the last ones."""
    user = user_of(request)
    patient = get_object_or_404(
        Patient.objects.visible_to(user).select_related("clinic"), pk=patient_id
    )
    mine = TrainingSession.objects.visible_to(user).filter(patient=patient)
    today = clinic_time(timezone.now(), patient.clinic)
    weeks = request.GET.get("weeks", "")
    if weeks in PERIODS:
        mine = mine.filter(created_at__gte=today - timedelta(weeks=int(weeks)))
    else:
        weeks = ""
    groups: list[dict[str, Any]] = [
        dict(group)
        for group in mine.order_by()
        .values("valence", "simulated", "excluded")
        .annotate(Count("pk"), active_s=Sum("active_s"))
    ]
    chosen = request.GET.get("type", "")
    chips = [
        {
            "slug": slug,
            "label": label,
            "count": sum(g["pk__count"] for g in groups if slug in ("", g["valence"])),
        }
        for slug, label in (
            ("", gettext("All types")),
            *((v.slug, v.label) for v in VALENCES.values()),
        )
    ]
    if chosen in VALENCES:
        mine = mine.filter(valence=chosen)
        groups = [group for group in groups if group["valence"] == chosen]
    else:
        chosen = ""
    # Sessions of a person and of a simulated patient share no figure.
    simulated = bool(groups) and all(group["simulated"] for group in groups)
    included = [group for group in groups if not group["excluded"]]
    page = Paginator(mine.select_related("measure").defer("plan"), PAGE_SIZE).get_page(
        request.GET.get("page")
    )
    rows = list(page.object_list)
    figures, noted = metrics_by_session(user, rows), describe_noted(user, rows)
    since = min((row.created_at for row in rows), default=today)
    incidents = [one for one in find_incidents(user, since) if one.was_one]
    marked = {one.raised.session_id: one.raised.kind for one in incidents}
    trend = load_trend(user, mine.filter(simulated=simulated), with_imported=True)
    chart = trend_chart_data(trend, today)
    context = {
        "patient": patient,
        "chips": chips,
        "chosen": chosen,
        "periods": {"": gettext("All time"), **PERIODS},
        "weeks": weeks,
        "page": page,
        "lines": [
            to_row(row, figures.get(row.pk, {}), noted.get(row.pk, ""), patient, today)
            for row in rows
        ],
        "simulated": simulated,
        "sentence": compare_last_sessions(mine.filter(simulated=simulated)),
        "totals": summarize_trend(included, trend, simulated=simulated),
        "corrected": sum(group["pk__count"] for group in groups if group["excluded"]),
        "marked": marked,
        "courses": [course for course in load_courses(user, patient) if course.results],
        "trend": list(zip(chart["hits"]["days"], trend, strict=True)),
        "chart": chart,
        "types": [
            (slug, label)
            for slug, label in [
                *((one.slug, one.label) for one in VALENCES.values()),
                ("", _("changed during the session")),
            ]
            if slug in chart["hits"]["types"]
        ],
    }
    return render(request, "sessions/history.html", context)


def to_row(
    session: TrainingSession,
    figures: dict[str, float],
    noted: str,
    patient: Patient,
    now: datetime,
) -> dict[str, Any]:
    """Return a session as a row of the list."""
    start = clinic_time(session.began_at, patient.clinic)
    monday = start.date() - timedelta(days=start.weekday())
    return {
        "session": session,
        "week": gettext("Week of %(day)s") % {"day": date_format(monday, "DATE_FORMAT")},
        "day": capfirst(format_day(start.date(), now.date())),
        "time": f"{start:%H:%M}",
        "duration": format_duration(session.active_s),
        "goal": format_number(session.goal),
        "score": format_number(figures.get("score"), 0),
        "hit_rate": format_rate(figures.get("hit_rate")),
        "noted": noted,
        "state": gettext("imported")
        if session.legacy_id is not None
        else format_state(session.state),
    }
