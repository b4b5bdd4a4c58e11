"""Pages of a study's participants: enrollment, visits, leaving, revealing an arm."""

from __future__ import annotations

from typing import Any

from django.contrib import messages
from django.http import HttpRequest, HttpResponse
from django.shortcuts import get_object_or_404, redirect, render
from django.urls import reverse
from django.utils import timezone
from django.utils.translation import gettext as _
from django.views.decorators.http import require_http_methods, require_POST, require_safe

from rehab.people.access import for_roles, user_of
from rehab.people.models import User
from rehab.people.roles import Role
from rehab.people.sign_in import step_up
from rehab.stations.builtin import first_station
from rehab.studies.agreements import agree, agreed_version, version_to_agree_to
from rehab.studies.blinding import (
    arms_of,
    find_request,
    may_read_arm,
    must_not_know_arms,
    reveal_arms,
)
from rehab.studies.enrolling import enroll, withdraw
from rehab.studies.guesses import GUESSERS, UNKNOWN, group_labels, may_guess, record_guess
from rehab.studies.pages.planning import get_study
from rehab.studies.pages.refusals import refuse
from rehab.studies.participant_forms import EnrollmentForm, PlaceForm
from rehab.studies.participants import Enrollment
from rehab.studies.screening import find_unmet, turn_away
from rehab.studies.visit_marks import describe_visits
from rehab.studies.visits import next_visit, start_session
from rehab.training.changes import OPEN_STATES
from rehab.training.measures import InvalidSetting


def get_enrollment(user: User, enrollment_id: int) -> Enrollment:
    """Return the enrollment of key ``enrollment_id``. Raises Http404 if ``user`` may not see it."""
    rows = Enrollment.objects.visible_to(user).select_related("study__clinic", "patient__clinic")
    return get_object_or_404(rows, pk=enrollment_id)


@for_roles(Role.LEAD, Role.PT)
@require_http_methods(["GET", "HEAD", "POST"])
def enroll_patient(request: HttpRequest, study_id: int) -> HttpResponse:
    """Assess a patient for a running study: enroll them, or note why not."""
    user, now = user_of(request), timezone.now()
    study = get_study(user, study_id)
    form = EnrollmentForm(request.POST or None, study=study, by=user)
    if request.method == "POST" and form.is_valid():
        patient, keep_data = form.cleaned_data["patient"], form.cleaned_data["keep_data"]
        declined = not form.cleaned_data["takes_part"]
        try:
            unmet = find_unmet(study, patient, form.met, now)
            if unmet or declined:
                noted = turn_away(study, patient, unmet, declined=declined, by=user, now=now)
                message = _("Noted in the screening log: not enrolled (%(why)s).")
                messages.success(request, message % {"why": noted.why_not})
                return redirect(reverse("study", args=[study.pk]) + "#screening")
            enrollment = enroll(
                study,
                patient,
                form.levels,
                keep_data=keep_data,
                by=user,
                now=now,
                met=form.met,
                consent=form.consent,
            )
        except InvalidSetting as problem:
            form.add_error(None, refuse(request, problem))
        else:
            return redirect("participant", enrollment_id=enrollment.pk)
    return render(request, "studies/enroll.html", {"study": study, "form": form})


@for_roles(Role.LEAD, Role.PT)
@require_safe
def show_participant(request: HttpRequest, enrollment_id: int) -> HttpResponse:
    """Show a participant's visits, and what can be done. The arm stays hidden until revealed."""
    enrollment = get_enrollment(user_of(request), enrollment_id)
    return render_participant(request, enrollment)


def render_participant(
    request: HttpRequest, enrollment: Enrollment, status: int = 200, **more: Any
) -> HttpResponse:
    """Return a participant's page.

    Parameters
    ----------
    enrollment
        The participant.
    status
        The response's HTTP status.
    more
        What else the template shows: a form as it was sent, why something was refused, the arms
        that were revealed.
    """
    user, now = user_of(request), timezone.now()
    first_station(enrollment.patient.clinic)
    blind = must_not_know_arms(enrollment.study, user)
    visits = list(enrollment.visits.select_related("session"))
    told = describe_visits(enrollment.study, visits, blind=blind)
    if not blind and "revealed" not in more and may_read_arm(enrollment, user, now):
        more["revealed"] = arms_of(enrollment)
    is_walking = any(visit.session and visit.session.state in OPEN_STATES for visit in visits)
    guesser = may_guess(enrollment, user)
    context = {
        "enrollment": enrollment,
        "study": enrollment.study,
        "visits": [(visit, told.get(visit.pk)) for visit in visits],
        "has_simulated": any(visit.is_simulated for visit in visits),
        "next": None if is_walking else next_visit(enrollment),
        "blind": blind,
        "guesser": GUESSERS[guesser] if guesser else "",
        "groups": group_labels(enrollment.study) if guesser else {},
        "unknown": UNKNOWN,
        "asked": find_request(enrollment, now),
        "agreed": agreed_version(enrollment),
        "to_agree_to": version_to_agree_to(enrollment),
        "place": PlaceForm(patient=enrollment.patient, by=user),
        **more,
    }
    return render(request, "studies/participant.html", context, status=status)


@for_roles(Role.LEAD, Role.PT)
@require_POST
def start_visit(request: HttpRequest, enrollment_id: int) -> HttpResponse:
    """Create the session of the next visit, with the arm's condition, and go to it."""
    user = user_of(request)
    enrollment = get_enrollment(user, enrollment_id)
    form = PlaceForm(request.POST, patient=enrollment.patient, by=user)
    refused = ""
    if form.is_valid():
        chosen_id = request.POST.get("visit", "")
        try:
            session = start_session(
                enrollment, form.place, user, timezone.now(), chosen_id=chosen_id
            )
        except InvalidSetting as problem:
            refused = refuse(request, problem)
        else:
            return redirect("monitor", session_id=session.pk)
    return render_participant(request, enrollment, place=form, refused=refused)


@for_roles(Role.LEAD, Role.PT)
@require_POST
def leave_study(request: HttpRequest, enrollment_id: int) -> HttpResponse:
    """Record that a participant leaves the study."""
    user = user_of(request)
    enrollment = get_enrollment(user, enrollment_id)
    reason, back = request.POST.get("reason", "")[:1000], request.POST.get("consent") == "back"
    withdraw(enrollment, user, timezone.now(), reason, takes_consent_back=back)
    return redirect("participant", enrollment_id=enrollment.pk)


@for_roles(Role.LEAD, Role.PT)
@require_POST
def note_guess(request: HttpRequest, enrollment_id: int) -> HttpResponse:
    """Note what the participant, or the assessor who asks, guesses about the group."""
    user = user_of(request)
    enrollment = get_enrollment(user, enrollment_id)
    try:
        record_guess(enrollment, request.POST.get("group", ""), user, timezone.now())
    except InvalidSetting as problem:
        return render_participant(request, enrollment, 403, refused=refuse(request, problem))
    messages.success(request, _("The guess is noted."))
    return redirect("participant", enrollment_id=enrollment.pk)


@for_roles(Role.LEAD, Role.PT)
@step_up.required
@require_POST
def reveal(request: HttpRequest, enrollment_id: int) -> HttpResponse:
    """Show a participant's arms, with a reason; the study's events and the audit log have it."""
    user = user_of(request)
    enrollment = get_enrollment(user, enrollment_id)
    reason = request.POST.get("reason", "")[:1000]
    emergency, alone = (request.POST.get(name) == "yes" for name in ("emergency", "alone"))
    try:
        arms = reveal_arms(
            *(enrollment, reason),
            emergency=emergency,
            second=not alone,
            by=user,
            now=timezone.now(),
        )
    except InvalidSetting as problem:
        return render_participant(request, enrollment, 403, refused=refuse(request, problem))
    return render_participant(request, enrollment, revealed=arms)


@for_roles(Role.LEAD, Role.PT)
@require_POST
def agree_again(request: HttpRequest, enrollment_id: int) -> HttpResponse:
    """Record that a participant agreed to the study's newer version."""
    user = user_of(request)
    agree(get_enrollment(user, enrollment_id), user, timezone.now())
    return redirect("participant", enrollment_id=enrollment_id)
