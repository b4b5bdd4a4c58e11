"""Try a phone as a sensor, without one: a recording walks through the phone's real page."""

from __future__ import annotations

import segno
from django.contrib import messages
from django.http import HttpRequest, HttpResponse, JsonResponse
from django.shortcuts import redirect, render
from django.urls import reverse
from django.utils import timezone
from django.views.decorators.cache import never_cache
from django.views.decorators.http import require_http_methods, require_POST, require_safe

from rehab.patients.pages.start import add_demo_patient
from rehab.patients.phone_trial import begin_trial, find_trial, look_at_trial
from rehab.people.access import clinic_of, for_roles, user_of
from rehab.people.networks import client_address
from rehab.people.roles import Role
from rehab.people.sign_in import step_up
from rehab.people.web.refusals import format_refusal
from rehab.sessions.live.database.owners import OwnedElsewhere
from rehab.sessions.live.database.trouble import NotStored
from rehab.sessions.services import StationTaken
from rehab.stations.builtin import first_station, issue_builtin_token
from rehab.stations.device_trust import NotTrusted, check_approval
from rehab.stations.models import Device, Station
from rehab.stations.pages.pairing import address_for_others, let_in, tablet_address
from rehab.stations.pages.phones import LEGS, sensor_path
from rehab.training.measures import InvalidSetting
from rehab.training.steps import Side


@for_roles(Role.LEAD, Role.PT)
@never_cache
@require_http_methods(["GET", "HEAD", "POST"])
def try_phone(request: HttpRequest) -> HttpResponse:
    """Show the three screens of a trial, each with its way there; first choose the leg.

    ``open`` opens the trial that there is, else one of the latest leg; ``side`` one of that leg;
    ``code`` lets a tablet in.
    """
    lets_in = "code" in request.POST
    if lets_in and not step_up.is_confirmed(request, timezone.now()):
        return step_up.ask(request)
    side = request.POST.get("side", "")
    if side in LEGS or "open" in request.POST:
        return _begin(request, Side(side) if side in LEGS else None)
    trial = find_trial(user_of(request))
    if trial is None:
        return render(request, "patients/phone_trial.html", {"legs": LEGS.items()})
    asked = let_in(request) if lets_in else {}
    if asked is None:
        return redirect("try-phone")
    return _show(request, asked)


def _begin(request: HttpRequest, side: Side | None) -> HttpResponse:
    user = user_of(request)
    patient, station = add_demo_patient(request), first_station(clinic_of(user))
    if not patient.simulated:
        return redirect("patient", patient_id=patient.pk)
    try:
        begin_trial(patient, station, side, user)
    except StationTaken as taken:
        messages.error(request, format_refusal(taken))
        return redirect("monitor", session_id=taken.session.pk)
    except InvalidSetting as refused:
        messages.error(request, format_refusal(refused))
        return redirect("start")
    except (NotStored, OwnedElsewhere) as problem:
        messages.error(request, str(problem))
        return redirect("start")
    return redirect("try-phone")


def _show(request: HttpRequest, more: dict[str, object]) -> HttpResponse:
    """Show the open trial, with what a form of it has answered."""
    user, now = user_of(request), timezone.now()
    trial = find_trial(user)
    if trial is None:
        return redirect("try-phone")
    context = {
        "session": trial,
        "found": look_at_trial(trial, now),
        "legs": LEGS.items(),
        "stations": Station.objects.visible_to(user),
        **tablet_address(request),
        "here": reverse("try-phone"),  # the QR code of the phone answers a POST
        **more,
    }
    return render(request, "patients/phone_trial.html", context)


@for_roles(Role.LEAD, Role.PT)
@never_cache
@step_up.required
@require_POST
def open_trial_phone(request: HttpRequest) -> HttpResponse:
    """Open the phone's page of the trial here, or show its QR code; any earlier one is left out."""
    user, now = user_of(request), timezone.now()
    trial = find_trial(user)
    if trial is None or trial.station is None:
        return redirect("try-phone")
    try:
        check_approval(user, client_address(request), "phone", now)
    except NotTrusted as refused:
        messages.error(request, str(refused))
        return redirect("first-steps")
    token = issue_builtin_token(trial.station, Device.Kind.SOURCE, by=user)
    # Behind the # nothing of it reaches a server's log.
    worn = f"#token={token}&place=shank&side={trial.trained_side}"
    page = f"{sensor_path(clinic_of(user))}&trial{worn}"
    server = address_for_others(request) if "qr" in request.POST else None
    if server is None:
        return redirect(page)
    drawing = segno.make(server + page, micro=False)
    return _show(request, {"phone_qr": drawing.svg_inline(omitsize=True, border=2)})


@for_roles(Role.LEAD, Role.PT, patients=False)  # of the simulated one alone, every two seconds
@never_cache
@require_safe
def trial_state(request: HttpRequest) -> JsonResponse:
    """Return which screens of the trial are there now."""
    trial = find_trial(user_of(request))
    found = look_at_trial(trial, timezone.now()) if trial else {}
    return JsonResponse({name: [one.is_done, one.words] for name, one in found.items()})
