"""Where a tablet is let in, and where a PIN lets somebody out."""

from __future__ import annotations

from django.contrib import messages
from django.http import HttpRequest, HttpResponse, JsonResponse
from django.shortcuts import get_object_or_404, redirect, render
from django.urls import reverse
from django.utils import timezone
from django.utils.translation import gettext as _
from django.views.decorators.http import require_http_methods, require_POST

from rehab.people.access import actor_of, clinic_of, for_roles, person, tablet_of
from rehab.people.roles import Role
from rehab.stations.builtin import first_station
from rehab.stations.models import Station
from rehab.stations.pairing import PairingRefused, approve
from rehab.stations.pins import PinRefused, check_pin
from rehab.stations.tablets import COOKIE


@for_roles(Role.LEAD, Role.PT, patients=False)
@require_http_methods(["GET", "HEAD", "POST"])
def pair(request: HttpRequest) -> HttpResponse:
    """Approve the tablet that shows a code, for a station of the person's own clinic."""
    user = person(request)
    first_station(clinic_of(user))
    stations = Station.objects.visible_to(user)
    problem = ""
    code = request.POST.get("code", request.GET.get("code", ""))[:16]
    if request.method == "POST":
        chosen = request.POST.get("station", "")
        station = stations.filter(pk=int(chosen)).first() if chosen.isdecimal() else None
        try:
            if station is None:
                raise PairingRefused(_("Choose a station."))
            device = approve(code, station, user.pk, timezone.now())
        except PairingRefused as refused:
            problem = str(refused)
        else:
            said = {"tablet": device.name, "station": station}
            messages.success(request, _("%(tablet)s belongs to %(station)s now.") % said)
            return redirect("start")
    context = {"stations": stations, "code": code, "problem": problem}
    return render(request, "stations/pair.html", context)


@for_roles(Role.LEAD, Role.PT, tablets=True)
@require_POST
def leave(request: HttpRequest) -> HttpResponse:
    """Let somebody out of a patient's page where the station's PIN is given; ``unpair`` gives the
    tablet back. The session that runs there goes on, whatever is answered.
    """
    chosen = request.POST.get("station", "")
    stations = Station.objects.visible_to(actor_of(request))
    station = get_object_or_404(stations, pk=int(chosen) if chosen.isdecimal() else None)
    tablet = None if request.user.is_authenticated else tablet_of(request)
    who = f"tablet {tablet.pk}" if tablet else f"person {request.user.pk}"
    try:
        check_pin(station, who, request.POST.get("pin", "")[:16], timezone.now())
    except PinRefused as refused:
        return JsonResponse({"message": str(refused), "wait_s": refused.wait_s}, status=403)
    if tablet is None or "unpair" not in request.POST:
        return JsonResponse({"go": reverse("start")})
    tablet.revoked_at = timezone.now()
    tablet.save(update_fields=["revoked_at"])
    response = JsonResponse({"go": reverse("tablet")})
    response.delete_cookie(COOKIE)
    return response
