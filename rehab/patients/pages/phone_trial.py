"""Try a phone as a sensor, without one: a recording walks through the phone's real page."""

from __future__ import annotations

from typing import Any

from django.contrib import messages
from django.http import HttpRequest, HttpResponse, JsonResponse
from django.shortcuts import redirect, render
from django.utils import timezone
from django.utils.translation import gettext_lazy
from django.views.decorators.cache import never_cache
from django.views.decorators.http import require_http_methods, require_POST, require_safe

from rehab.patients.pages.start import add_demo_patient
from rehab.patients.phone_trial import begin_trial, find_trial, look_at_trial
from rehab.people.access import clinic_of, for_roles, user_of
from rehab.people.networks import client_address
from rehab.people.roles import Role
from rehab.people.sign_in import step_up
from rehab.people.web.refusals import format_refusal
from rehab.sessions.live.database.clinic_owners import OwnedElsewhere
from rehab.sessions.live.database.trouble import NotStored
from rehab.sessions.models import TrainingSession
from rehab.sessions.services import StationTaken, change_session
from rehab.stations.builtin import first_station, issue_builtin_token
from rehab.stations.device_trust import NotTrusted, check_approval
from rehab.stations.models import Device
from rehab.stations.pages.pairing import let_in, tablet_address
from rehab.stations.pages.phones import LEGS, trial_path
from rehab.training.changes import ChangeKind, State
from rehab.training.measures import InvalidSetting
from rehab.training.steps import Side

STEPS = {
    "screen": gettext_lazy("The patient’s screen"),
    "phone": gettext_lazy("The phone"),
    "recording": gettext_lazy("A recording"),
    "start": gettext_lazy("Start"),
}
LET_IN_AS = {"screen": Device.Kind.TABLET, "phone": Device.Kind.SOURCE}


@for_roles(Role.LEAD, Role.PT)
@never_cache
@require_http_methods(["GET", "HEAD", "POST"])
def try_phone(request: HttpRequest) -> HttpResponse:
    """Show the next step of a trial; first choose the leg.

    ``open`` opens the trial that there is, else one of the latest leg; ``side`` one of that leg;
    ``code`` lets a tablet or, as the ``step``, a phone in; ``start`` starts its session.
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
    if "start" in request.POST:
        return _start(request, trial)
    step = request.POST.get("step", "")
    asked = let_in(request, LET_IN_AS.get(step, Device.Kind.TABLET)) if lets_in else {}
    if asked is None:
        return redirect("try-phone")
    return _show(request, trial, step or request.GET.get("step", ""), asked)


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


def _start(request: HttpRequest, trial: TrainingSession) -> HttpResponse:
    try:
        if trial.state == State.READY:
            change_session(trial, ChangeKind.START, by=user_of(request))
    except InvalidSetting as refused:
        messages.error(request, format_refusal(refused))
    except (NotStored, OwnedElsewhere) as problem:
        messages.error(request, str(problem))
    return redirect("monitor", session_id=trial.pk)


def _show(
    request: HttpRequest, trial: TrainingSession, wanted: str, asked: dict[str, Any]
) -> HttpResponse:
    """Show a step of the open trial, the first that is not done unless another one is wanted."""
    found = look_at_trial(trial, timezone.now())
    open_ones = [slug for slug, one in found.items() if not one.is_done]
    step = wanted if wanted in STEPS else [*open_ones, "start"][0]
    context = {
        "session": trial,
        "steps": [(slug, title, found.get(slug)) for slug, title in STEPS.items()],
        "step": step,
        "waits_for": step if step in open_ones else "",
        "legs": LEGS.items(),
        "stations": [trial.station],
        **tablet_address(request),
        **asked,
    }
    return render(request, "patients/phone_trial.html", context)


@for_roles(Role.LEAD, Role.PT)
@never_cache
@step_up.required
@require_POST
def open_trial_phone(request: HttpRequest) -> HttpResponse:
    """Open the phone's page of the trial here; any earlier one is left out."""
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
    return redirect(trial_path(clinic_of(user), token, Side(trial.trained_side)))


@for_roles(Role.LEAD, Role.PT, patients=False)  # of the simulated one alone, every two seconds
@never_cache
@require_safe
def trial_state(request: HttpRequest) -> JsonResponse:
    """Return which screens of the trial are there now."""
    trial = find_trial(user_of(request))
    found = look_at_trial(trial, timezone.now()) if trial else {}
    return JsonResponse({name: [one.is_done, one.words] for name, one in found.items()})
