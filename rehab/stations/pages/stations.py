"""Stations are named; their devices added, given tokens, revoked."""

from __future__ import annotations

from typing import Any

from django.contrib import messages
from django.core.exceptions import PermissionDenied
from django.http import HttpRequest, HttpResponse
from django.shortcuts import get_object_or_404, redirect, render
from django.utils import timezone
from django.utils.translation import gettext as _
from django.views.decorators.cache import never_cache
from django.views.decorators.http import require_http_methods, require_POST

from rehab.people.access import for_roles, user_of
from rehab.people.roles import Role
from rehab.people.sign_in import step_up
from rehab.people.sign_in.tokens import renew_token
from rehab.stations.forms import DeviceForm, StationForm
from rehab.stations.models import Device, Station
from rehab.stations.sensor_programs import PROGRAMS


@for_roles(Role.LEAD, patients=False)
@require_http_methods(["GET", "HEAD", "POST"])
def edit_station(request: HttpRequest, station_id: int | None = None) -> HttpResponse:
    """Add a station, or edit one: its name and its PIN."""
    user = user_of(request)
    station = None if station_id is None else _find_station(request, station_id)
    form = StationForm(request.POST or None, instance=station, by=user)
    if request.method == "POST" and form.is_valid():
        form.save()
        messages.success(request, _("%(station)s is saved.") % {"station": form.instance})
        return redirect("stations")
    context = {"form": form, "title": station or _("New station")}
    return render(request, "stations/form.html", context)


@for_roles(Role.LEAD, patients=False)
@never_cache
@step_up.required
@require_http_methods(["GET", "HEAD", "POST"])
def add_device(request: HttpRequest, station_id: int) -> HttpResponse:
    """Add a source or robot to a station, and show its token once."""
    station = _find_station(request, station_id)
    form = DeviceForm(request.POST or None, station=station)
    if request.method == "POST" and form.is_valid():
        token = form.issue()
        return show_token(request, form.instance, token)
    title = _("New device at %(station)s") % {"station": station}
    return render(request, "stations/form.html", {"form": form, "title": title})


@for_roles(Role.LEAD, patients=False)
@never_cache
@step_up.required
@require_POST
def change_device(request: HttpRequest, device_id: int) -> HttpResponse:
    """Renew a device's token and show it once; or with ``revoke`` end it."""
    user, now = user_of(request), timezone.now()
    device = get_object_or_404(Device.objects.visible_to(user), pk=device_id)
    if device.builtin:
        raise PermissionDenied  # the server gives its own devices their tokens
    if "revoke" in request.POST:
        device.revoked_at = now
        device.save(update_fields=["revoked_at"])
        messages.success(request, _("%(device)s is revoked.") % {"device": device})
        return redirect("stations")
    token = renew_token(device, request, now)
    return show_token(request, device, token)


def show_token(request: HttpRequest, device: Device, token: str) -> HttpResponse:
    """Return the page with a new token: the answer itself, since no cookie may keep it."""
    context: dict[str, Any] = {"device": device, "token": token}
    if device.kind == Device.Kind.SOURCE:
        server = f"{request.scheme}://{request.get_host()}"
        context["programs"] = [
            (one.kind, one.command(server, token), one.blanks) for one in PROGRAMS
        ]
    return render(request, "stations/token.html", context)


def _find_station(request: HttpRequest, station_id: int) -> Station:
    return get_object_or_404(Station.objects.visible_to(user_of(request)), pk=station_id)
