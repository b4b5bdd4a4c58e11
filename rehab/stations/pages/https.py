"""https for phones: a guided page for the clinic, and one for phones that do not trust it yet."""

from __future__ import annotations

from typing import Any

import segno
from django.conf import settings
from django.http import Http404, HttpRequest, HttpResponse
from django.shortcuts import redirect, render
from django.urls import reverse
from django.utils import timezone
from django.views.decorators.cache import never_cache
from django.views.decorators.http import require_http_methods, require_safe

from rehab.people.access import for_roles, public, user_of
from rehab.people.audit.audit_log import Act, record
from rehab.people.networks import client_address
from rehab.people.roles import Role
from rehab.people.sign_in import step_up
from rehab.people.sign_in.signed_in_browsers import describe_browser
from rehab.stations.https.authority import fingerprint, read_certificate
from rehab.stations.https.certificate import (
    is_encrypting,
    make_own,
    network_address,
    own_authority,
    secure_host,
)

# Whose instructions a device is shown unfolded; an iPad calls itself a Mac.
SYSTEMS = {"iPhone": {"ios"}, "iPad": {"ios"}, "Android": {"android"}, "macOS": {"ios", "computer"}}
SYSTEMS |= {name: {"computer"} for name in ("Windows", "Linux", "ChromeOS")}
ALL_SYSTEMS = {"ios", "android", "computer"}


@for_roles(Role.LEAD, Role.PT, patients=False)
@never_cache
@step_up.required
@require_http_methods(["GET", "HEAD", "POST"])
def set_up_https(request: HttpRequest) -> HttpResponse:
    """Make a certificate of the clinic's own; then show how phones and tablets get it.

    ``next`` in the address is the page that led here, and goes on once it is made.
    """
    user = user_of(request)
    network = network_address()
    may_make = user.role == Role.LEAD and not settings.HOSTED and not is_encrypting()
    if request.method == "POST" and may_make and network:
        now = timezone.now()
        make_own(now)
        address, about = client_address(request), "https: a certificate of the clinic's own"
        record(Act.CHANGE, user, clinic_id=user.clinic_id, about=about, address=address, now=now)
        return redirect(step_up.way_back(request) or request.path)
    context: dict[str, Any] = {
        "is_hosted": settings.HOSTED,
        "is_encrypting": is_encrypting() or request.is_secure(),
        "may_make": may_make,
        "address": network,
        "secure_address": secure_address(),
        "way_back": step_up.way_back(request),
        **certificate_square(),
    }
    return render(request, "stations/https.html", context)


def secure_address() -> str:
    """Return the address of this server by https; empty without a certificate."""
    host = secure_host()
    return f"https://{host}" if host else ""


def certificate_square() -> dict[str, str]:
    """Return where devices get the own authority's certificate, drawn; empty without one."""
    own, host = own_authority(), secure_host()
    if host is None or settings.CERTIFICATE:
        return {}
    address = f"http://{host}{reverse('certificate')}"
    return {
        "certificate_address": address,
        "certificate_qr": segno.make(address, micro=False).svg_inline(omitsize=True, border=2),
        "fingerprint": fingerprint(read_certificate(own.certificate)),
    }


@public
@never_cache
@require_safe
def show_certificate(request: HttpRequest) -> HttpResponse:
    """Show how a phone or tablet comes to trust this server: read before it does.

    ``next`` is where it goes on by https, as soon as it does.
    """
    agent = describe_browser(request.headers.get("User-Agent", ""))
    context = {
        "systems": SYSTEMS.get(agent.rpartition(", ")[2], ALL_SYSTEMS),
        "secure_address": secure_address(),
        "next": step_up.way_back(request),
        **certificate_square(),
    }
    return render(request, "stations/certificate.html", context)


@public
@never_cache
@require_safe
def download_certificate(request: HttpRequest) -> HttpResponse:
    """Return the certificate of the clinic's own authority, as phones install it."""
    own = own_authority()
    if not own.exists:
        raise Http404("This server has no authority of its own.")
    return HttpResponse(
        own.certificate.read_bytes(),
        content_type="application/x-x509-ca-cert",
        headers={"Content-Disposition": 'attachment; filename="garry.crt"'},
    )
