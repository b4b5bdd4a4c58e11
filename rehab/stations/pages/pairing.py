"""Pages to pair a tablet and to leave the patient's page by PIN."""

from __future__ import annotations

import segno
from django.conf import settings
from django.contrib import messages
from django.http import HttpRequest, HttpResponse, JsonResponse
from django.shortcuts import get_object_or_404, redirect, render
from django.urls import reverse
from django.utils import timezone
from django.utils.translation import gettext as _
from django.views.decorators.http import require_http_methods, require_POST

from rehab.people.access import actor_of, clinic_of, for_roles, tablet_of, user_of
from rehab.people.roles import Role
from rehab.people.row_values import read_key
from rehab.people.sign_in import step_up
from rehab.stations.addresses import reachable_host
from rehab.stations.builtin import first_station
from rehab.stations.models import Station
from rehab.stations.pairing import PairingRefused, approve_pairing
from rehab.stations.pins import PinRefused, check_pin
from rehab.stations.tablets import COOKIE


@for_roles(Role.LEAD, Role.PT, patients=False)
@step_up.required
@require_http_methods(["GET", "HEAD", "POST"])
def pair(request: HttpRequest) -> HttpResponse:
    """Approve the tablet that shows a code, for a station of the person's own clinic."""
    user = user_of(request)
    first_station(clinic_of(user))
    problem = ""
    if request.method == "POST":
        problem = let_in(request)
        if not problem:
            return redirect("start")
    context = {
        "stations": Station.objects.visible_to(user),
        "code": request.POST.get("code", request.GET.get("code", ""))[:16],
        "problem": problem,
    }
    return render(request, "stations/pair.html", context | tablet_address(request))


def let_in(request: HttpRequest) -> str:
    """Approve the tablet that shows the code that was sent; return why not, "" where it worked."""
    user = user_of(request)
    stations = Station.objects.visible_to(user)
    station = stations.filter(pk=read_key(request.POST.get("station", ""))).first()
    if station is None:
        return _("Choose a station.")
    try:
        code = request.POST.get("code", "")[:16]
        device = approve_pairing(code, station, user.pk, timezone.now())
    except PairingRefused as refused:
        return str(refused)
    names = {"tablet": device.name, "station": station}
    messages.success(request, _("%(tablet)s belongs to %(station)s now.") % names)
    return ""


def tablet_address(request: HttpRequest) -> dict[str, str]:
    """Return the address that a tablet opens, and its drawing to scan; empty without one."""
    host = reachable_host(request.get_host(), [settings.HOST, *settings.ALLOWED_HOSTS])
    if host is None:
        return {"address": "", "qr": ""}
    address = f"{request.scheme}://{host}{reverse('tablet')}"
    drawing = segno.make(address, micro=False).svg_inline(omitsize=True, border=2)
    return {"address": address, "qr": drawing}


@for_roles(Role.LEAD, Role.PT, tablets=True)
@require_POST
def leave(request: HttpRequest) -> HttpResponse:
    """Leave a patient's page with the station's PIN; ``unpair`` also ends the tablet's pairing.

    A session that runs there goes on in any case.
    """
    stations = Station.objects.visible_to(actor_of(request))
    station = get_object_or_404(stations, pk=read_key(request.POST.get("station", "")))
    tablet = None if request.user.is_authenticated else tablet_of(request)
    screen = f"tablet {tablet.pk}" if tablet else f"person {request.user.pk}"
    try:
        check_pin(station, screen, request.POST.get("pin", "")[:16], timezone.now())
    except PinRefused as refused:
        return JsonResponse({"message": str(refused), "wait_s": refused.wait_s}, status=403)
    if tablet is None or "unpair" not in request.POST:
        return JsonResponse({"go": reverse("start")})
    tablet.revoked_at = timezone.now()
    tablet.save(update_fields=["revoked_at"])
    response = JsonResponse({"go": reverse("tablet")})
    response.delete_cookie(COOKIE)
    return response
