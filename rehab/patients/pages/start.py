"""The start list and a patient's own pages."""

from __future__ import annotations

from datetime import datetime, timedelta
from typing import Any

from django.contrib import messages
from django.db.models import Count, Max, Q, QuerySet
from django.http import HttpRequest, HttpResponse
from django.shortcuts import get_object_or_404, redirect, render
from django.utils import timezone
from django.utils.translation import gettext as _
from django.views.decorators.cache import never_cache
from django.views.decorators.http import require_http_methods, require_POST, require_safe

from rehab.patients.forms import PatientForm, ScreenForm
from rehab.patients.pages.first_steps import list_first_steps
from rehab.patients.screen_check import LETTERS, propose
from rehab.patients.visits import QUICK_VISIT_DAYS, Progress, Visit, patients_today, suggested_time
from rehab.people.access import clinic_of, for_roles, user_of
from rehab.people.consent.services import current_text, is_care_allowed, unasked_purposes
from rehab.people.models import Patient, User
from rehab.people.roles import Role
from rehab.people.simulated import counted
from rehab.sessions.alarms import Alarm, open_alarms
from rehab.sessions.feedback_text_updates import change_language
from rehab.sessions.formatting import (
    clinic_time,
    format_day,
    format_number,
    format_quantity,
    format_rate,
)
from rehab.sessions.forms.initial import initial_choices, last_session
from rehab.sessions.forms.setup import SessionForm
from rehab.sessions.models import TrainingSession
from rehab.sessions.pages.screen_size import screen_of_browser
from rehab.sessions.reports.day.today import IS_OPEN
from rehab.sessions.reports.remarks import load_noted
from rehab.sessions.reports.summary import format_first_goal
from rehab.sessions.reports.trend import load_trend, summarize_trend, with_metrics
from rehab.sessions.spark import draw_spark
from rehab.stations.builtin import first_station
from rehab.stations.tablets import has_tablet
from rehab.training.changes import OPEN_STATES

MAX_PATIENTS = 60  # patients on one page
MAX_LAST_WALKED = 4  # sessions on the start page
MAX_PROGRESS = 10  # sessions in the line on a patient's page
DEMO_CODE = "demo"


def patients_by_last_visit(user: User) -> QuerySet[Patient]:
    """Return a clinic's patients, the most recent session first, simulated ones last."""
    return (
        Patient.objects.visible_to(user)
        .annotate(last_here=Max("sessions__created_at"), count=Count("sessions"))
        .order_by("simulated", "-last_here", "-created_at")
    )


def open_sessions(user: User) -> QuerySet[TrainingSession]:
    """Return the sessions that are ready, running or paused."""
    states = [state.value for state in OPEN_STATES]
    return (
        TrainingSession.objects.visible_to(user)
        .filter(state__in=states)
        .select_related("patient", "station")
    )


def start_context(user: User, query: str = "") -> dict[str, Any]:
    """Return the context of the start page: who is expected today, who fell, and all patients."""
    now = clinic_time(timezone.now(), clinic_of(user))
    patients, alarms = patients_by_last_visit(user), open_alarms(user, now)
    if query:
        patients = patients.filter(Q(nickname__icontains=query) | Q(code__icontains=query))
    else:  # patients whose program has ended are found by name or code only
        patients = patients.filter(ended_at=None)
    shown = list(patients[: MAX_PATIENTS + 1])
    fallen = {one.session.patient_id for one in alarms if one.kind == Alarm.FALL}
    return {
        "now": now,
        "today": sorted(patients_today(user, now), key=lambda row: row.patient.pk not in fallen),
        "patients": shown[:MAX_PATIENTS],
        "more": len(shown) > MAX_PATIENTS,
        "open": [one for one in open_sessions(user) if one.patient_id not in fallen],
        "fallen": fallen,
        "stopped": {one.session_id for one in alarms if one.kind == Alarm.ROBOT_STOP},
    }


def begin_context(user: User, patient: Patient) -> dict[str, Any]:
    """Return the context of the button that starts a session as it is proposed for a patient."""
    first_station(patient.clinic)
    initial, last = initial_choices(patient, user), last_session(patient, user)
    return {
        "form": SessionForm(initial=initial, patient=patient, by=user),
        "last": initial,
        "is_repeated": last is not None,
        "last_goal": format_quantity(last.goal, last.measure.unit) if last and last.goal else "",
        "first_goal": format_first_goal(user, last, initial),
        "has_tablet": has_tablet(initial["station"], timezone.now()),
    }


def load_progress(user: User, patient: Patient, now: datetime) -> dict[str, Any] | None:
    """Return how a patient's last sessions went; None before the first one."""
    sessions = TrainingSession.objects.visible_to(user).filter(
        patient=patient, simulated=patient.simulated
    )
    trend = load_trend(user, sessions, most=MAX_PROGRESS)
    if not trend:
        return None
    last = trend[-1].session
    unit, higher_is_better = last.measure.unit, last.measure.higher_is_better
    same = [p for p in trend if p.with_feedback and p.session.measure == last.measure]
    means = [point.with_feedback.mean for point in same if point.with_feedback]
    goals = [point.session.goal for point in same if point.session.goal]
    goals = goals if len(goals) == len(means) else []
    noted = load_noted(user, [last.pk]).get(last.pk, [])
    progress = {
        "session": last,
        "day": format_day(clinic_time(last.began_at, patient.clinic).date(), now.date()),
        "totals": summarize_trend([], trend, simulated=patient.simulated),
        "noted": dict.fromkeys(one.words for one in noted if one.is_adverse),
    }
    if len(means) > 1:
        ends = sorted([*means, *goals], reverse=higher_is_better)
        progress |= {
            "points": draw_spark(means, higher_is_better=higher_is_better, beside=goals),
            "goals": draw_spark(goals, higher_is_better=higher_is_better, beside=means),
            "scale": [format_number(ends[0]), format_number(ends[-1])],
            "ends": f"{format_number(means[0])} → {format_quantity(means[-1], unit)}",
        }
    return progress


def load_last_walked(user: User, now: datetime) -> list[tuple[TrainingSession, str, str]]:
    """Return the clinic's last sessions, each with its day and its hit rate."""
    walked = TrainingSession.objects.visible_to(user).filter(
        counted(), excluded=False, active_s__gt=0
    )
    rows: Any = with_metrics(user, walked.exclude(IS_OPEN)).select_related("patient", "clinic")
    return [
        (
            one,
            format_day(clinic_time(one.began_at, one.clinic).date(), now.date()),
            format_rate(one.metric_hit_rate),
        )
        for one in rows.order_by("-created_at", "-pk")[:MAX_LAST_WALKED]
    ]


@for_roles(Role.LEAD, Role.PT)
@never_cache  # so that going back shows the present state
@require_safe
def choose_patient(request: HttpRequest) -> HttpResponse:
    """List who is expected today, then all patients."""
    query = request.GET.get("q", "").strip()
    user = user_of(request)
    context = start_context(user, query) | {
        "q": query,
        "first_steps": list_first_steps(request),
    }
    context["lately"] = load_last_walked(user, context["now"])
    coming = [row for row in context["today"] if row.progress is Progress.EXPECTED]
    context["is_over"] = context["today"] and all(row.is_missed for row in coming)
    following = next((row for row in coming if not row.is_late), None)
    if following is not None:  # who is late may not come: from the list, when they do
        context |= {"next": following} | begin_context(user, following.patient)
    return render(request, "patients/start.html", context)


@for_roles(Role.LEAD, Role.PT)
@never_cache
@require_safe
def show_patient(request: HttpRequest, patient_id: int) -> HttpResponse:
    """Show a patient: a session like last time, planned visits (``?plan``: open), progress."""
    user = user_of(request)
    patient = get_object_or_404(patients_by_last_visit(user), pk=patient_id)
    lists = start_context(user)
    today = lists["now"].date()
    visits = Visit.objects.visible_to(user).filter(patient=patient, day__gte=today)
    row = next((row for row in lists["today"] if row.patient == patient), None)
    was_here = row is not None and row.progress is Progress.DONE
    if was_here:
        visits = visits.exclude(day=today)
    planned = {visit.day: visit for visit in visits}
    not_asked = [] if patient.simulated else unasked_purposes(patient)
    context = lists | begin_context(user, patient)
    context |= {
        "patient": patient,
        "progress": load_progress(user, patient, lists["now"]),
        "open_here": open_sessions(user).filter(patient=patient),
        "visits": visits,
        "was_here": was_here,
        "must_plan": "plan" in request.GET
        or (was_here and not visits)
        or (row is not None and row.is_missed),
        "soon": [
            (days, today + timedelta(days=days), planned.get(today + timedelta(days=days)))
            for days in QUICK_VISIT_DAYS
            if days or row is None
        ],
        "at": suggested_time(user, patient, lists["now"]),
        "not_asked": not_asked,
        "asks_care": not is_care_allowed(patient),
    }
    return render(request, "patients/start.html", context)


@for_roles(Role.LEAD, Role.PT)
@require_http_methods(["GET", "HEAD", "POST"])
def add_patient(request: HttpRequest) -> HttpResponse:
    """Add a new patient."""
    user = user_of(request)
    form = PatientForm(request.POST or None, by=user, now=timezone.now())
    if request.method == "POST" and form.save_or_report():
        return redirect("setup", patient_id=form.instance.pk)
    context = {"form": form, "words": current_text(clinic_of(user)).text}
    return render(request, "patients/form.html", context)


@for_roles(Role.LEAD, Role.PT)
@require_http_methods(["GET", "HEAD", "POST"])
def edit_patient(request: HttpRequest, patient_id: int) -> HttpResponse:
    """Edit a patient's details."""
    user = user_of(request)
    patient = get_object_or_404(patients_by_last_visit(user), pk=patient_id)
    form = PatientForm(request.POST or None, by=user, now=timezone.now(), instance=patient)
    if request.method == "POST" and form.save_or_report():
        _speak(request, form)
        return redirect("patient", patient_id=patient.pk)
    context = {"form": form, "patient": Patient.objects.visible_to(user).get(pk=patient_id)}
    return render(request, "patients/form.html", context)


@for_roles(Role.LEAD, Role.PT)
@require_http_methods(["GET", "HEAD", "POST"])
def set_screen(request: HttpRequest, patient_id: int) -> HttpResponse:
    """Set how the patient's page looks and sounds; ``seen``: as a check of the letters proposes."""
    patient = get_object_or_404(patients_by_last_visit(user_of(request)), pk=patient_id)
    seen = request.GET.get("seen", "")
    is_checked = len(seen) == len(LETTERS) and set(seen) <= {"0", "1"}
    initial = {}
    if is_checked:
        proposal = propose([one == "1" for one in seen])
        initial["screen_text"] = proposal.text.value
        if proposal.side is not None:
            initial["screen_side"] = proposal.side.value
    form = ScreenForm(request.POST or None, instance=patient, initial=initial)
    if request.method == "POST" and form.save_or_report():
        _speak(request, form)
        return redirect("patient", patient_id=patient.pk)
    context = {"form": form, "patient": patient, "checked": is_checked, "count": seen.count("1")}
    return render(request, "patients/screen_form.html", context | {"of": len(LETTERS)})


def _speak(request: HttpRequest, form: PatientForm | ScreenForm) -> None:
    """Let open sessions go on in the patient's language, where a form has changed that."""
    if "language" in form.changed_data:
        for problem in change_language(form.instance, user_of(request)):
            messages.error(request, problem)


@for_roles(Role.LEAD, Role.PT)
@require_safe
def check_screen(request: HttpRequest, patient_id: int) -> HttpResponse:
    """Show letters of three sizes on either side, on the screen that the patient will read."""
    patient = get_object_or_404(patients_by_last_visit(user_of(request)), pk=patient_id)
    letters = [each._asdict() for each in LETTERS]
    context = {"patient": patient, "letters": letters, "screen": screen_of_browser(request)}
    return render(request, "patients/screen_check.html", context)


@for_roles(Role.LEAD, Role.PT)
@require_POST
def add_demo(request: HttpRequest) -> HttpResponse:
    """Add a simulated patient, for people who want to try GARRY."""
    return redirect("patient", patient_id=add_demo_patient(request).pk)


def add_demo_patient(request: HttpRequest) -> Patient:
    """Return the clinic's simulated patient; say so where a real one has that code."""
    user = user_of(request)
    patient, _created = Patient.objects.visible_to(user).get_or_create(
        clinic=clinic_of(user),
        code=DEMO_CODE,
        defaults={"nickname": "Demo", "paretic_side": "left", "simulated": True},
    )
    if not patient.simulated:
        message = _("%(nickname)s has the code %(code)s. Give that patient another code first.")
        messages.error(request, message % {"nickname": patient.nickname, "code": patient.code})
    return patient
