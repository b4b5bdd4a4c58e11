"""Pages to pair a tablet and to leave the patient's page by PIN."""

from __future__ import annotations

from collections.abc import Iterable
from ipaddress import ip_address
from typing import Any

import segno
from django.conf import settings
from django.contrib import messages
from django.http import HttpRequest, HttpResponse, JsonResponse
from django.http.request import split_domain_port
from django.shortcuts import get_object_or_404, redirect, render
from django.urls import reverse
from django.utils import timezone
from django.utils.translation import gettext as _
from django.views.decorators.http import require_http_methods, require_POST

from rehab.people.access import actor_of, clinic_of, for_roles, tablet_of, user_of
from rehab.people.audit.audit_log import truncate_address
from rehab.people.networks import client_address
from rehab.people.roles import Role
from rehab.people.row_values import read_key
from rehab.people.sign_in import step_up
from rehab.people.sign_in.signed_in_browsers import describe_browser
from rehab.stations.builtin import first_station
from rehab.stations.device_trust import NotTrusted
from rehab.stations.https.certificate import network_address, secure_host
from rehab.stations.models import Device, Station
from rehab.stations.pages.https import certificate_square
from rehab.stations.pairing import PairingRefused, approve_pairing, find_by_code
from rehab.stations.pins import PinRefused, check_pin
from rehab.stations.tablets import COOKIE


@for_roles(Role.LEAD, Role.PT, patients=False)
@step_up.required
@require_http_methods(["GET", "HEAD", "POST"])
def pair(request: HttpRequest) -> HttpResponse:
    """Approve the tablet that shows a code, for a station of the person's own clinic."""
    user = user_of(request)
    first_station(clinic_of(user))
    asked = let_in(request) if request.method == "POST" else {}
    if asked is None:
        return redirect("start")
    context = {
        "stations": Station.objects.visible_to(user),
        **asked,
        **tablet_address(request),
    }
    return render(request, "stations/pair.html", context)


def let_in(request: HttpRequest, kind: Device.Kind = Device.Kind.TABLET) -> dict[str, Any] | None:
    """Let in the device that shows the code that was sent, once a person has compared it.

    Return None where that is done; else the context of `stations/pair_form.html`: why not, or what
    there is to compare.
    """
    user, now = user_of(request), timezone.now()
    code, here = request.POST.get("code", "")[:16], client_address(request)
    stations = Station.objects.visible_to(user)
    station = stations.filter(pk=read_key(request.POST.get("station", ""))).first()
    if station is None:
        return {"code": code, "problem": _("Choose a station.")}
    try:
        pairing = find_by_code(code, user, now)
        if request.POST.get("compared") != "yes":
            theirs, own = _network_of(pairing.address), _network_of(here)
            agent = describe_browser(request.headers.get("User-Agent", ""))
            return {
                "asking": {"code": pairing.code, "network": theirs, "browser": pairing.browser},
                "station": station,
                "own": {"network": own, "browser": agent},
                "is_elsewhere": theirs != own and not station.clinic.networks,
            }
        device = approve_pairing(pairing, station, user, here, now, kind)
    except (PairingRefused, NotTrusted) as refused:
        return {"code": code, "problem": str(refused), "chosen": station}
    if kind == Device.Kind.TABLET:
        names = {"tablet": device.name, "station": station}
        messages.success(request, _("%(tablet)s belongs to %(station)s now.") % names)
    return None


def _network_of(address: str) -> str:
    """Return the network of an address; of this computer itself, the one that it is in."""
    is_own = address in {"127.0.0.1", "::"}  # of IPv6 the client's /64 is known
    return truncate_address((is_own and network_address()) or address)


def tablet_address(request: HttpRequest) -> dict[str, Any]:
    """Return the addresses that a tablet opens, each with its drawing to scan, and this page's own.

    One that lacks an own certificate comes by http, which leads on to https once it trusts that
    (`https.show_certificate`); no other one, since anybody in the network can read and change http.
    Without an address: whether a tablet reached the server anyway.
    """
    here, secure = request.get_full_path(), secure_host()
    host = secure or reachable_host(request.get_host(), [settings.HOST, *settings.ALLOWED_HOSTS])
    if host is None:
        tablets = Device.objects.visible_to(user_of(request)).filter(kind=Device.Kind.TABLET)
        return {"is_reached": tablets.exclude(last_seen_at=None).exists(), "here": here}
    own = certificate_square()
    address = f"{'https' if secure else request.scheme}://{host}{reverse('tablet')}"
    addresses = [address.replace("https", "http", 1), address] if own else [address]
    drawn = [
        (one, segno.make(one, micro=False).svg_inline(omitsize=True, border=2)) for one in addresses
    ]
    return {"addresses": drawn, "here": here, **own}


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


def _is_for_others(name: str) -> bool:
    """Return whether other machines reach a name or address: no loopback, wildcard or pattern."""
    if not name or name.startswith((".", "*")) or name == "localhost":
        return False
    try:
        address = ip_address(name.strip("[]"))
    except ValueError:
        return True
    return not (address.is_loopback or address.is_unspecified)


def reachable_host(host: str, names: Iterable[str]) -> str | None:
    """Return the host and port that a tablet opens; None where only this machine can.

    Parameters
    ----------
    host
        Where the therapist's own page was opened, `name:port`.
    names
        Names and addresses that the server answers to, the best one first.
    """
    name, port = split_domain_port(host)
    if _is_for_others(name):
        return host
    for other in names:
        if _is_for_others(other):
            return f"{other}:{port}" if port else other
    return None
