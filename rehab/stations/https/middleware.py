"""What http and https do with a request, once this server encrypts by itself."""

from __future__ import annotations

from collections.abc import Callable
from ipaddress import ip_address
from urllib.parse import urlencode

from django.conf import settings
from django.http import HttpRequest, HttpResponse, HttpResponseBase, HttpResponseRedirect
from django.http.request import split_domain_port
from django.urls import reverse

from rehab.stations.https.certificate import is_encrypting


class EncryptionMiddleware:
    """Sends others than this machine from http to https, and keeps cookies of https there.

    A browser that may not trust an own certificate yet first gets the page that says so.

    Without HSTS: who removes an own authority must not be locked out. Keeps no state.
    """

    def __init__(self, get_response: Callable[[HttpRequest], HttpResponseBase]) -> None:
        self.get_response = get_response

    def __call__(self, request: HttpRequest) -> HttpResponseBase:
        """Pass the request on, or send it to https."""
        if self._has_to_move(request):
            name, _ = split_domain_port(request.get_host())
            address = f"https://{name}:{settings.HTTPS_PORT}{request.get_full_path()}"
            is_page = "text/html" in request.headers.get("Accept", "")
            if request.method == "GET" and is_page and not settings.CERTIFICATE:
                place = urlencode({"next": request.get_full_path()})
                page = f"{reverse('certificate')}?{place}"
                return HttpResponseRedirect(f"http://{name}:{settings.HTTPS_PORT}{page}")
            if request.method in {"GET", "HEAD"}:
                return HttpResponseRedirect(address)
            return HttpResponse(f"Use {address}: this server encrypts.\n", status=403)
        response = self.get_response(request)
        if request.is_secure():
            for cookie in response.cookies.values():
                cookie["secure"] = True
        return response

    @staticmethod
    def _has_to_move(request: HttpRequest) -> bool:
        if request.is_secure() or settings.PROXIES or not is_encrypting():
            return False
        if request.path.startswith(reverse("certificate")):  # who opens it has no certificate yet
            return False
        try:
            return not ip_address(request.META.get("REMOTE_ADDR", "")).is_loopback
        except ValueError:  # a socket of the machine itself
            return False
