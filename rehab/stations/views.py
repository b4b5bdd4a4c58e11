"""Where a tablet is let in."""

from __future__ import annotations

from django.contrib import messages
from django.http import HttpRequest, HttpResponse
from django.shortcuts import redirect, render
from django.utils import timezone
from django.views.decorators.http import require_http_methods

from rehab.people.access import clinic_of, for_roles, person
from rehab.people.roles import Role
from rehab.stations.builtin import first_station
from rehab.stations.models import Station
from rehab.stations.pairing import PairingRefused, approve


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
                raise PairingRefused("Choose a station.")
            device = approve(code, station, user.pk, timezone.now())
        except PairingRefused as refused:
            problem = str(refused)
        else:
            messages.success(request, f"{device.name} belongs to {station} now.")
            return redirect("start")
    context = {"stations": stations, "code": code, "problem": problem}
    return render(request, "stations/pair.html", context)
