"""How a session is set up."""

from __future__ import annotations

from django.http import HttpRequest, HttpResponse
from django.shortcuts import get_object_or_404, redirect, render
from django.views.decorators.http import require_http_methods

from rehab.feedback.valences import valences_of
from rehab.people.access import for_roles, person
from rehab.people.models import Patient
from rehab.people.roles import Role
from rehab.sessions.forms import SessionForm, like_last_time, minutes_of
from rehab.sessions.models import Protocol
from rehab.stations.builtin import first_station

# Where the person who set the session up goes on.
PLACES = ("walk", "monitor")


@for_roles(Role.LEAD, Role.PT)
@require_http_methods(["GET", "HEAD", "POST"])
def set_up(request: HttpRequest, patient_id: int) -> HttpResponse:
    """Show the set-up, beginning like last time; create the session."""
    user = person(request)
    patient = get_object_or_404(Patient.objects.visible_to(user), pk=patient_id)
    first_station(patient.clinic)
    if request.method == "POST":
        form = SessionForm(request.POST, patient=patient, by=user)
        session = form.create()
        if session is not None:
            wanted = request.POST.get("then")
            return redirect(wanted if wanted in PLACES else PLACES[0], session_id=session.pk)
    else:
        form = SessionForm(initial=like_last_time(patient, user), patient=patient, by=user)
    lengths = {row.pk: minutes_of(row) for row in Protocol.objects.visible_to(user)}
    context = {
        "patient": patient,
        "form": form,
        "valences": valences_of(patient.clinic_id).values(),
        "lengths": lengths,
    }
    return render(request, "sessions/setup.html", context)
