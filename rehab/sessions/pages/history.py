"""Past sessions of a patient, and one session in detail."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime
from typing import Any

from django.contrib import messages
from django.core.paginator import Paginator
from django.db.models import Count, Sum
from django.http import HttpRequest, HttpResponse
from django.shortcuts import get_object_or_404, redirect, render
from django.utils import timezone
from django.utils.translation import gettext
from django.utils.translation import gettext_lazy as _
from django.views.decorators.http import require_http_methods, require_safe

from rehab.people.access import for_roles, person
from rehab.people.models import Patient
from rehab.people.roles import Role
from rehab.sessions.corrections import CorrectionForm, Part, may_correct, tell_corrections
from rehab.sessions.formatting import at_clinic, say_day, say_duration, say_number, say_rate
from rehab.sessions.models import TrainingSession
from rehab.sessions.reports.review import review_session, sum_up
from rehab.sessions.reports.trend import draw_trend, figures_of, read_trend, sum_up_all
from rehab.training.changes import OPEN_STATES, State
from rehab.training.valences import VALENCES

A_PAGE = 20
STATES = {
    State.READY: _("not started"),
    State.RUNNING: _("running"),
    State.PAUSED: _("paused"),
    State.FINISHED: "",
    State.ABORTED: _("ended early"),
}


@dataclass(frozen=True)
class Line:
    """A session in the list."""

    session: TrainingSession
    day: str
    time: str
    duration: str
    goal: str
    score: str
    hit_rate: str
    state: str


@dataclass(frozen=True)
class Chip:
    """A choice of feedback type."""

    slug: str
    label: str
    count: int


@for_roles(Role.LEAD, Role.PT)
@require_safe
def list_sessions(request: HttpRequest, patient_id: int) -> HttpResponse:
    """List a patient's sessions, newest first, with the trend over the last ones."""
    user = person(request)
    patient = get_object_or_404(
        Patient.objects.visible_to(user).select_related("clinic"), pk=patient_id
    )
    mine = TrainingSession.objects.visible_to(user).filter(patient=patient)
    groups: list[dict[str, Any]] = [
        dict(group)
        for group in mine.order_by()
        .values("valence", "simulated", "left_out")
        .annotate(Count("pk"), walked=Sum("active_s"))
    ]
    chosen = request.GET.get("type", "")
    chips = [
        Chip(slug, label, sum(g["pk__count"] for g in groups if slug in ("", g["valence"])))
        for slug, label in (("", gettext("All")), *((v.slug, v.label) for v in VALENCES.values()))
    ]
    if chosen in VALENCES:
        mine = mine.filter(valence=chosen)
        groups = [group for group in groups if group["valence"] == chosen]
    else:
        chosen = ""
    # What a person walked and what a simulated patient walked share no figure.
    simulated = bool(groups) and all(group["simulated"] for group in groups)
    counted = [group for group in groups if not group["left_out"]]
    page = Paginator(mine.select_related("measure").defer("plan"), A_PAGE).get_page(
        request.GET.get("page")
    )
    rows = list(page.object_list)
    figures = figures_of(user, rows)
    trend = read_trend(user, mine.filter(simulated=simulated))
    today = at_clinic(timezone.now(), patient.clinic)
    chart = draw_trend(trend, today)
    context = {
        "patient": patient,
        "chips": chips,
        "chosen": chosen,
        "page": page,
        "lines": [write_line(row, figures.get(row.pk, {}), patient, today) for row in rows],
        "simulated": simulated,
        "totals": sum_up_all(counted, trend, simulated=simulated),
        "corrected": sum(group["pk__count"] for group in groups if group["left_out"]),
        "trend": list(zip(chart["hits"]["days"], trend, strict=True)),
        "chart": chart,
    }
    return render(request, "sessions/history.html", context)


def write_line(
    session: TrainingSession, figures: dict[str, float], patient: Patient, now: datetime
) -> Line:
    """Put a session into words."""
    start = at_clinic(session.started_at or session.created_at, patient.clinic)
    return Line(
        session=session,
        day=say_day(start.date(), now.date()).capitalize(),
        time=f"{start:%H:%M}",
        duration=say_duration(session.active_s),
        goal=say_number(session.goal),
        score=say_number(figures.get("score"), 0),
        hit_rate=say_rate(figures.get("hit_rate")),
        state=gettext("imported")
        if session.original_id is not None
        else str(STATES[State(session.state)]),
    )


@for_roles(Role.LEAD, Role.PT, Role.RESEARCHER)
@require_safe
def show_session(request: HttpRequest, session_id: int) -> HttpResponse:
    """Show one session with every stride, phase and event; researchers see a pseudonym."""
    user = person(request)
    session = get_object_or_404(
        TrainingSession.objects.visible_to(user).select_related("patient", "clinic", "measure"),
        pk=session_id,
    )
    review = review_session(user, session)
    corrections = tell_corrections(session, user)
    by_name = user.role != Role.RESEARCHER
    start = at_clinic(session.started_at or session.created_at, session.clinic)
    now = at_clinic(timezone.now(), session.clinic)
    context = {
        "session": session,
        "by_name": by_name,
        "who": session.patient.nickname if by_name else session.patient.pseudonym,
        "day": say_day(start.date(), now.date()).capitalize(),
        "time": f"{start:%H:%M}",
        "state": STATES[State(session.state)],
        "open": State(session.state) in OPEN_STATES,
        "may_correct": by_name and may_correct(session),
        "corrections": [
            told | {"at": at_clinic(told["row"].at, session.clinic)} for told in corrections
        ],
        "note": next((told["new"] for told in corrections if told["row"].part == Part.NOTE), ""),
        "review": review,
        "totals": sum_up(session.to_plan(), review),
        "phases": [
            phase
            | {
                "hit_rate_words": say_rate(phase["hit_rate"]),
                "mean_words": say_number(phase["mean"]),
                "performance_words": say_rate(phase["mean_performance"]),
                "type_words": gettext(VALENCES[phase["valence"]].label) if phase["valence"] else "",
            }
            for phase in review.figures["phases"]
        ],
        "moments": [
            (moment, f"{at_clinic(moment.event.at, session.clinic):%H:%M:%S}")
            for moment in review.moments
        ],
    }
    return render(request, "sessions/session.html", context)


@for_roles(Role.LEAD, Role.PT)
@require_http_methods(["GET", "HEAD", "POST"])
def correct(request: HttpRequest, session_id: int) -> HttpResponse:
    """Correct an ended session: who walked, whether it counts, a note. The log stays as it is."""
    user = person(request)
    session = get_object_or_404(
        TrainingSession.objects.visible_to(user).select_related("patient", "clinic"), pk=session_id
    )
    if not may_correct(session):
        messages.error(request, gettext("This session still runs. End it before you correct it."))
        return redirect("session", session_id=session.pk)
    form = CorrectionForm(request.POST or None, session=session, by=user)
    if request.method == "POST" and form.create(timezone.now()):
        messages.success(request, gettext("Corrected. Figures, boards and trends follow it."))
        return redirect("session", session_id=session.pk)
    return render(request, "sessions/correct.html", {"session": session, "form": form})
