"""A phone as a sensor: paired by a QR code on the therapist's page, worn on a leg."""

from __future__ import annotations

from typing import Any

import numpy as np
import segno
from django.http import HttpRequest, HttpResponse, JsonResponse
from django.shortcuts import render
from django.urls import reverse
from django.utils import timezone, translation
from django.utils.translation import gettext as _
from django.utils.translation import gettext_lazy
from django.views.decorators.cache import never_cache
from django.views.decorators.http import require_http_methods, require_safe

from rehab.people.access import clinic_of, for_roles, public, user_of
from rehab.people.audit.audit_log import Act, record_security_change
from rehab.people.models import LANGUAGES, Clinic, User
from rehab.people.networks import client_address
from rehab.people.roles import Role
from rehab.people.row_values import read_key
from rehab.people.sign_in import step_up
from rehab.sources.synthetic.leg import STRIDE_S, Floats, stand, walk_foot
from rehab.stations.builtin import first_station
from rehab.stations.device_trust import NotTrusted, check_approval
from rehab.stations.https.certificate import secure_host
from rehab.stations.models import Device, Station
from rehab.stations.pages.https import certificate_square
from rehab.training.steps import Side

STANDS_S, RATE_HZ = 5.0, 60.0  # of the simulated leg
LEGS = {Side.LEFT: gettext_lazy("left"), Side.RIGHT: gettext_lazy("right")}
PLACE = "shank"  # a phone on the foot would be too heavy


@for_roles(Role.LEAD, Role.PT, patients=False)
@never_cache
@step_up.required
@require_http_methods(["GET", "HEAD", "POST"])
def pair_phone(request: HttpRequest) -> HttpResponse:
    """Choose where a phone is worn; then show the code to scan, once."""
    user = user_of(request)
    first_station(clinic_of(user))
    context: dict[str, Any] = {
        "stations": Station.objects.visible_to(user),
        "legs": LEGS.items(),
        "is_secure": secure_host() is not None or request.is_secure(),
    }
    if request.method == "POST":
        try:
            context |= _pair(request, user)
        except NotTrusted as refused:
            context["problem"] = str(refused)
    return render(request, "stations/phone.html", context)


def _pair(request: HttpRequest, user: User) -> dict[str, Any]:
    """Return a new phone with the code that opens its page, or what is missing to pair one.

    Raises NotTrusted.
    """
    now = timezone.now()
    check_approval(user, client_address(request), "phone", now)
    stations = Station.objects.visible_to(user)
    station = stations.filter(pk=read_key(request.POST.get("station", ""))).first()
    side = request.POST.get("side")
    if station is None or side not in LEGS:
        return {"problem": _("Choose a station and a leg.")}
    where = {"leg": LEGS[Side(side)], "place": _("shin")}
    device = Device(
        clinic_id=station.clinic_id,
        station=station,
        kind=Device.Kind.SOURCE,
        name=_("Phone, %(leg)s %(place)s") % where,
        side=side,
        place=PLACE,
    )
    token = device.new_token()
    device.note_issuer(user, now)
    device.save()
    record_security_change(Act.TOKEN, request, device, now)
    # Behind the # nothing of it reaches a server's log.
    host = secure_host()
    here = f"https://{host}" if host else f"{request.scheme}://{request.get_host()}"
    page = sensor_path(clinic_of(user))
    worn = f"#token={token}&place={PLACE}&side={side}"
    drawing = segno.make(f"{here}{page}{worn}", micro=False).svg_inline(omitsize=True, border=2)
    trial = trial_path(clinic_of(user), token, Side(side))
    return {"device": device, "qr": drawing, "trial": trial, **certificate_square()}


def sensor_path(clinic: Clinic) -> str:
    """Return the path of a phone's page in a clinic's language."""
    return f"{reverse('sensor')}?language={clinic.language}"


def trial_path(clinic: Clinic, token: str, side: Side) -> str:
    """Return the path of a phone's page on which a recording is tried."""
    # Behind the # nothing of it reaches a server's log.
    return f"{sensor_path(clinic)}&trial#token={token}&place={PLACE}&side={side}"


@public
@require_safe
def show_sensor(request: HttpRequest) -> HttpResponse:
    """Show the page of a phone that is worn; what it may do is in the address that it scanned."""
    if (language := request.GET.get("language")) in dict(LANGUAGES):
        translation.activate(language)  # the station's: nobody is signed in
    return render(request, "stations/sensor.html")


@public
@require_safe
def trial_walk(request: HttpRequest) -> JsonResponse:
    """Return a simulated leg as a phone would measure it: it stands, then walks one stride."""
    standing_s = np.arange(0, STANDS_S, 1 / RATE_HZ)
    rate, acceleration = stand(standing_s)
    t_s, rates, accelerations = walk_foot(2 * STRIDE_S, RATE_HZ)
    one = slice(len(t_s) // 2)
    return JsonResponse(
        {
            "stand": _as_rows(standing_s, rate, acceleration),
            "walk": _as_rows(t_s[one], rates[one], accelerations[one]),
        }
    )


def _as_rows(t_s: Floats, rate: Floats, acceleration: Floats) -> list[list[float]]:
    """Return rows of time [s], acceleration [m/s²] and rate of rotation [°/s]."""
    rows: list[list[float]] = np.column_stack((t_s, acceleration, np.degrees(rate))).tolist()
    return rows
