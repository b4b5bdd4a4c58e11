"""Try a phone as a sensor, without one: a simulated leg walks through the phone's real page."""

from __future__ import annotations

from django.contrib import messages
from django.http import HttpRequest, HttpResponse
from django.shortcuts import redirect, render
from django.urls import reverse
from django.utils import timezone
from django.views.decorators.cache import never_cache
from django.views.decorators.http import require_POST

from rehab.patients.pages.start import add_demo_patient
from rehab.people.access import clinic_of, for_roles, user_of
from rehab.people.networks import client_address
from rehab.people.roles import Role
from rehab.people.sign_in import step_up
from rehab.people.web.refusals import format_refusal
from rehab.sessions.services import SessionRequest, StationTaken, create_session
from rehab.sessions.setup.protocols import MeasureDefinition
from rehab.stations.builtin import first_station, issue_builtin_token
from rehab.stations.device_trust import NotTrusted, check_approval
from rehab.stations.models import Device
from rehab.stations.pages.phones import sensor_path
from rehab.training.goals import GoalRule, Target
from rehab.training.measures import MEASURES
from rehab.training.phases import make_phase
from rehab.training.steps import Side
from rehab.training.valences import POSITIVE

MEASURE, GOAL_PERCENT, MINUTES = MEASURES["shank_stance"], 60.0, 10


@for_roles(Role.LEAD, Role.PT)
@never_cache
@step_up.required
@require_POST
def try_phone(request: HttpRequest) -> HttpResponse:
    """Open a session of the demo patient; show the ways to the phone's and the therapist's page."""
    user = user_of(request)
    clinic = clinic_of(user)
    try:
        check_approval(user, client_address(request), "phone", timezone.now())
    except NotTrusted as refused:
        messages.error(request, str(refused))
        return redirect("first-steps")
    patient, station = add_demo_patient(request), first_station(clinic)
    if not patient.simulated:
        return redirect("patient", patient_id=patient.pk)
    try:
        session = create_session(
            SessionRequest(
                patient=patient,
                valence=POSITIVE.slug,
                measure=MeasureDefinition.objects.visible_to(user).get(
                    clinic=None, slug=MEASURE.slug
                ),
                goal=GoalRule(value=GOAL_PERCENT),
                phases=[make_phase(kind="training")],
                target=Target(duration_s=60 * MINUTES),
                trained_side=Side.LEFT,
                station=station,
                created_by=user,
                simulated=True,
            )
        )
    except StationTaken as taken:
        messages.error(request, format_refusal(taken))
        return redirect("monitor", session_id=taken.session.pk)
    token = issue_builtin_token(station, Device.Kind.SOURCE, by=user)
    context = {
        "phone": f"{sensor_path(clinic)}&trial#token={token}&place=shank&side=left",
        "session": session,
        "monitor": reverse("monitor", args=[session.pk]),
    }
    return render(request, "patients/phone_trial.html", context)
