"""The patient's page during a session."""

from __future__ import annotations

from csp.constants import SELF
from csp.decorators import csp_replace
from django.http import HttpRequest, HttpResponse
from django.shortcuts import get_object_or_404, redirect, render
from django.urls import reverse
from django.utils import translation
from django.views.decorators.clickjacking import xframe_options_sameorigin

from rehab.people.access import actor_of, for_roles
from rehab.people.consent.services import is_remote_view_allowed
from rehab.people.models import ScreenSide
from rehab.people.networks import client_address
from rehab.people.roles import Role
from rehab.people.web.language import activate_patient_language
from rehab.sessions.feedback_text_updates import session_language
from rehab.sessions.models import TrainingSession
from rehab.sessions.pages.monitor import redirect_to_consent
from rehab.sessions.pages.screen_size import screen_of
from rehab.training.changes import ENDED_STATES, State

# How the page is laid out for a side: as one column, in the middle or in a half of the screen.
COLUMNS = {
    ScreenSide.CENTER.value: "center",
    ScreenSide.IN_RIGHT.value: "right",
    ScreenSide.IN_LEFT.value: "left",
}


@for_roles(Role.LEAD, Role.PT, tablets=True)
@xframe_options_sameorigin  # the therapist's page mirrors this one in a frame
@csp_replace({"frame-ancestors": [SELF]})  # type: ignore[arg-type]  # knows no views with arguments
def show_walk(request: HttpRequest, session_id: int) -> HttpResponse:
    """Show a session as the patient sees it; one that has ended shows its scores."""
    sessions = TrainingSession.objects.visible_to(actor_of(request)).select_related(
        "patient__clinic", "station"
    )
    session = get_object_or_404(sessions, pk=session_id)
    alone = not request.user.is_authenticated
    if not alone and not is_remote_view_allowed(session.patient, client_address(request)):
        return redirect_to_consent(request, session.patient)
    mirror = "mirror" in request.GET
    activate_patient_language(session.patient)
    if State(session.state) not in ENDED_STATES:
        translation.activate(session_language(session))  # with its words
    elif not mirror:
        return redirect("scores", session_id=session.pk)
    context = {
        "session": session,
        "mirror": mirror,
        "replayed": mirror and "replay" in request.GET,  # in the frame of the replay
        "tablet": alone,
        "column": COLUMNS.get(session.patient.screen_side, ""),
        "screen": screen_of(request, session, mirror=mirror),
        "leave_to": reverse("start") if alone else reverse("patient", args=[session.patient_id]),
    }
    return render(request, "sessions/walk.html", context)
