"""The tablet at a treadmill: it shows a code until it is paired, then its station's sessions."""

from __future__ import annotations

import segno
from django.http import HttpRequest, HttpResponse, JsonResponse
from django.shortcuts import redirect, render
from django.templatetags.static import static
from django.urls import reverse
from django.utils import timezone
from django.utils.html import format_html
from django.utils.translation import gettext as _
from django.views.decorators.cache import never_cache
from django.views.decorators.http import require_safe

from rehab.people.access import public, tablet_of
from rehab.people.networks import client_address
from rehab.people.sign_in.signed_in_browsers import describe_browser
from rehab.sessions.models import TrainingSession
from rehab.stations import pairing, tablets
from rehab.stations.models import Device
from rehab.stations.pages.phones import trial_path
from rehab.training.changes import OPEN_STATES
from rehab.training.steps import Side

PAIRING_COOKIE = "garry_pairing"


def current_session(tablet: Device) -> TrainingSession | None:
    """Return the newest open session at the tablet's station."""
    sessions = TrainingSession.objects.visible_to(tablet)
    return sessions.filter(state__in=[state.value for state in OPEN_STATES]).first()


@public
@never_cache
@require_safe
def show_tablet(request: HttpRequest) -> HttpResponse:
    """Show the code of a new tablet; a paired one waits for its station's next session."""
    tablet = tablet_of(request)
    if tablet is not None:
        session = current_session(tablet)
        if session is not None:
            return redirect("walk", session_id=session.pk)
        context = {"station": tablet.station, "is_away": tablet.is_away}
        return render(request, "sessions/tablet.html", context)
    now = timezone.now()
    begun = pairing.find_pairing(request.COOKIES.get(PAIRING_COOKIE, ""), now)
    if begun is not None:
        if (device := begun.device) is None:
            return _show_code(request, begun.code)
        if (token := pairing.claim_token(begun)) is not None:
            return _set_paired(redirect(_way_in(device, token)), device, token)
    agent = describe_browser(request.headers.get("User-Agent", ""))
    try:
        begun, secret = pairing.start_pairing(client_address(request), now, agent)
    except pairing.PairingRefused as refused:
        status = 429 if isinstance(refused, pairing.PairingRateLimited) else 503
        return render(request, "sessions/tablet.html", {"problem": refused}, status=status)
    response = _show_code(request, begun.code)
    tablets.set_secret_cookie(response, PAIRING_COOKIE, secret, pairing.LIFETIME.total_seconds())
    return response


def _show_code(request: HttpRequest, code: str) -> HttpResponse:
    path = reverse("pair")  # without the code: a person compares it
    place = request.build_absolute_uri(path)
    drawing = segno.make(place, micro=False).svg_inline(omitsize=True, border=2)
    broken = format_html("{}<wbr>{}", place.removesuffix(path), path)
    context = {"code": code, "qr": drawing, "place": broken}
    return render(request, "sessions/tablet.html", context)


def _way_in(device: Device, token: str) -> str:
    """Return the page of what was let in: a tablet's own, of a phone that where it is tried."""
    if device.kind == Device.Kind.TABLET:
        return reverse("tablet")
    session = current_session(device)
    return trial_path(device.clinic, token, Side(session.trained_side) if session else Side.LEFT)


def _set_paired(response: HttpResponse, device: Device, token: str) -> HttpResponse:
    """Let the browser of an approved tablet store its token; a phone's page has it already."""
    if device.kind == Device.Kind.TABLET:
        tablets.set_secret_cookie(response, tablets.COOKIE, token, tablets.COOKIE_AGE_S)
    response.delete_cookie(PAIRING_COOKIE)
    return response


@public
@require_safe
def web_app_manifest(request: HttpRequest) -> JsonResponse:
    """Return the manifest with which a browser installs the page as a full-screen app."""
    mark = {"src": static("img/mark.svg"), "type": "image/svg+xml", "sizes": "any"}
    app = {
        "name": _("GARRY tablet"),
        "short_name": "GARRY",
        "id": reverse("tablet"),
        "start_url": reverse("tablet"),
        "scope": "/",
        "display": "fullscreen",
        "background_color": "#E6F0E7",
        "theme_color": "#E6F0E7",
        "icons": [mark],
    }
    return JsonResponse(app, content_type="application/manifest+json")


@public
@never_cache
@require_safe
def tablet_state(request: HttpRequest) -> HttpResponse:
    """Return where a tablet goes next: nowhere yet, to a new code, or to a session."""
    tablet = tablet_of(request)
    if tablet is not None:
        session = current_session(tablet)
        there = reverse("walk", kwargs={"session_id": session.pk}) if session else ""
        response = JsonResponse({"paired": True, "go": there})
        if token := request.COOKIES.get(tablets.COOKIE):
            tablets.set_secret_cookie(response, tablets.COOKIE, token, tablets.COOKIE_AGE_S)
        return response
    begun = pairing.find_pairing(request.COOKIES.get(PAIRING_COOKIE, ""), timezone.now())
    if begun is None:
        return JsonResponse({"paired": False, "go": reverse("tablet")})  # for a new code
    token = pairing.claim_token(begun)
    if begun.device is None or token is None:
        return JsonResponse({"paired": False, "go": ""})
    answer = JsonResponse({"paired": True, "go": _way_in(begun.device, token)})
    return _set_paired(answer, begun.device, token)
