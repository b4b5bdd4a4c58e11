"""A new clinic is walked through: station, tablet, sensor, first patient."""

from __future__ import annotations

from typing import Any

from django.http import HttpRequest, HttpResponse, JsonResponse
from django.shortcuts import redirect, render
from django.urls import reverse
from django.utils import timezone
from django.views.decorators.cache import never_cache
from django.views.decorators.http import require_http_methods, require_safe

from rehab.patients.first_steps import STEPS, FirstStep, Found, is_new, list_devices, look_at_all
from rehab.people.access import clinic_of, for_roles, user_of
from rehab.people.roles import Right, Role, rights_of
from rehab.people.sign_in import step_up
from rehab.stations.builtin import first_station
from rehab.stations.forms import DeviceForm, StationForm
from rehab.stations.models import Device, Station
from rehab.stations.pages.pairing import let_in, tablet_address
from rehab.stations.pages.stations import show_token

SKIPPED, HIDDEN = "skipped_first_steps", "hidden_first_steps"  # keys of the browser session


def list_first_steps(request: HttpRequest) -> list[tuple[FirstStep, Found]]:
    """Return the steps for the start page of a new clinic; none once all are done, or hidden."""
    user = user_of(request)
    if request.session.get(HIDDEN) or not is_new(user):
        return []
    found = look_at_all(user, timezone.now())
    skipped = request.session.get(SKIPPED, [])
    if all(one.is_done or slug in skipped for slug, one in found.items()):
        return []
    return [(step, found[step.slug]) for step in STEPS]


@for_roles(Role.LEAD, Role.PT, patients=False)
@never_cache
@require_http_methods(["GET", "HEAD", "POST"])
def first_steps(request: HttpRequest) -> HttpResponse:
    """Show one step at a time; each can be done here, is looked at live, and can be skipped."""
    user = user_of(request)
    first_station(clinic_of(user))  # named anew in the first step, by who wants to
    found = look_at_all(user, timezone.now())
    if request.method == "POST" and "hide" in request.POST:
        request.session[HIDDEN] = True
        return redirect("start")
    skipped = set(request.session.get(SKIPPED, []))
    if request.method == "POST" and request.POST.get("skip") in found:
        request.session[SKIPPED] = sorted(skipped | {request.POST["skip"]})
        return redirect("first-steps")
    open_ones = [slug for slug, one in found.items() if not one.is_done and slug not in skipped]
    wanted = request.GET.get("step", "")
    slug = wanted if wanted in found else open_ones[0] if open_ones else ""
    context: dict[str, Any] = {
        "steps": [(step, found[step.slug], step.slug in skipped) for step in STEPS],
        "slug": slug,
        "next": open_ones[0] if open_ones else "",
        "following": next(
            (one for one in STEPS if one.slug in open_ones and one.slug != slug), None
        ),
        "now": found.get(slug),
        "may_edit": Right.CHANGE in rights_of(user.role, "Station"),
    }
    if slug == "tablet":
        context |= tablet_address(request) | {"stations": Station.objects.visible_to(user)}
    if slug == "sensor":
        context["sensors"] = list_devices(user, Device.Kind.SOURCE)
    acted = _act(request, slug, context)
    return acted or render(request, "patients/first_steps.html", context)


def _act(request: HttpRequest, slug: str, context: dict[str, Any]) -> HttpResponse | None:
    """Do what a step's form asks for. Return where that leads; None to show the step."""
    user, sent = user_of(request), request.POST if request.method == "POST" else None
    there = f"{reverse('first-steps')}?step={slug}"
    gives_a_token = slug in {"tablet", "sensor"}
    if gives_a_token and sent is not None and not step_up.is_confirmed(request, timezone.now()):
        return step_up.ask(request)
    if slug == "tablet" and sent is not None:
        asked = let_in(request)
        if asked is None:
            return redirect(there)
        context |= asked
        return None
    if not context["may_edit"]:
        return None
    if slug == "station":
        station = Station.objects.visible_to(user).order_by("pk").first()
        form = context["form"] = StationForm(sent, instance=station, by=user)
        if sent is not None and form.is_valid():
            form.save()
            return redirect("first-steps")
    if slug == "sensor":
        device = DeviceForm(sent, station=first_station(clinic_of(user)))
        del device.fields["kind"]
        device.instance.kind = Device.Kind.SOURCE
        context["form"] = device
        if sent is not None and device.is_valid():
            return show_token(request, device.instance, device.issue())
    return None


@for_roles(Role.LEAD, Role.PT, patients=False)
@never_cache
@require_safe
def first_steps_state(request: HttpRequest) -> JsonResponse:
    """Return what is there of each step now."""
    found = look_at_all(user_of(request), timezone.now())
    return JsonResponse({slug: [one.is_done, one.words] for slug, one in found.items()})
