"""How large a screen is, and from how far it is read: set once on each that patients look at.

A paired tablet keeps it with its device, so that the mirror on the therapist's page is true; any
other browser in a cookie.
"""

from __future__ import annotations

from typing import NamedTuple

from django import forms
from django.http import HttpRequest, HttpResponse
from django.shortcuts import redirect, render
from django.utils.translation import gettext_lazy as _
from django.views.decorators.cache import never_cache
from django.views.decorators.http import require_http_methods

from rehab.people.access import for_roles, tablet_of
from rehab.people.models import ScreenText
from rehab.people.roles import Role
from rehab.people.row_values import read_key
from rehab.sessions.models import TrainingSession
from rehab.stations.models import Device

COOKIE = "garry_screen"
COOKIE_AGE_S = 5 * 365 * 24 * 3600
# How much larger words are than one degree, and points than two (static/css/walk/layouts.css).
FACTORS = {"normal": 1.0, "large": 1.4, "largest": 1.8}
DISTANCES = {1.5: "1.5 m", 2.0: "2 m", 3.0: "3 m"}
PX_PER_MM = (0.5, 40.0)  # a television of 2 m; four times the finest telephone


class Screen(NamedTuple):
    """A screen: CSS pixels a millimeter, and how far from the patient it stands [m]."""

    px_per_mm: float
    distance_m: float


class ScreenSizeForm(forms.Form):
    """What a person measured with a card on the screen, or knows of its diagonal."""

    px_per_mm = forms.FloatField(
        min_value=PX_PER_MM[0],
        max_value=PX_PER_MM[1],
        widget=forms.HiddenInput,
        error_messages={"required": _("Lay a card on the screen first, or type its diagonal.")},
    )
    distance_m = forms.TypedChoiceField(
        label=_("The patient reads it from"), choices=list(DISTANCES.items()), coerce=float
    )


@for_roles(Role.LEAD, Role.PT, tablets=True, patients=False)
@never_cache
@require_http_methods(["GET", "HEAD", "POST"])
def set_screen_size(request: HttpRequest) -> HttpResponse:
    """Set the size and distance of the screen that shows this page."""
    tablet = tablet_of(request)
    known = _of_tablet(tablet) if tablet is not None else screen_of_browser(request)
    form = ScreenSizeForm(request.POST or None, initial=known._asdict() if known else None)
    if request.method == "POST" and form.is_valid():
        screen = Screen(**form.cleaned_data)
        patient = read_key(request.GET.get("for", ""))  # whose letter test waits for it
        if tablet is not None:
            response = redirect("tablet")
        else:
            response = redirect("check-screen", patient) if patient else redirect("start")
        if tablet is None:
            written = f"{screen.px_per_mm:.3f},{screen.distance_m:g}"
            response.set_cookie(COOKIE, written, max_age=COOKIE_AGE_S, samesite="Lax")
        else:
            Device.everywhere.filter(pk=tablet.pk).update(
                screen_px_per_mm=screen.px_per_mm, screen_distance_m=screen.distance_m
            )
        return response
    context = {
        "form": form,
        "tablet": tablet,
        "sizes": [(FACTORS[one.value], one.label) for one in ScreenText],
    }
    return render(request, "sessions/screen_size.html", context)


def screen_of(request: HttpRequest, session: TrainingSession, *, mirror: bool) -> Screen | None:
    """Return the screen on which a session's patient reads; None where nobody measured it.

    ``mirror``: the page is a copy, on the therapist's, of what the station's tablet shows.
    """
    tablet = tablet_of(request)
    if mirror and session.station_id is not None:
        tablets = Device.everywhere.filter(station=session.station_id, kind=Device.Kind.TABLET)
        tablet = tablets.filter(revoked_at=None).order_by("-last_seen_at").first()
        return _of_tablet(tablet) if tablet is not None else None
    return _of_tablet(tablet) if tablet is not None else screen_of_browser(request)


def _of_tablet(tablet: Device) -> Screen | None:
    if tablet.screen_px_per_mm is None:
        return None
    return Screen(tablet.screen_px_per_mm, tablet.screen_distance_m)


def screen_of_browser(request: HttpRequest) -> Screen | None:
    """Return the screen of a browser that is no paired tablet's; None where nobody measured it."""
    try:
        px_per_mm, distance_m = map(float, request.COOKIES.get(COOKIE, "").split(","))
    except ValueError:
        return None
    if not PX_PER_MM[0] <= px_per_mm <= PX_PER_MM[1] or distance_m not in DISTANCES:
        return None
    return Screen(px_per_mm, distance_m)
