"""Step-up: what would let a stranger stay in, or take data out, asks once more who it is.

The password or a factor is asked for where the person has shown one longer ago than ten minutes:
so an open screen or a stolen cookie is not enough.
"""

from __future__ import annotations

from collections.abc import Callable
from datetime import datetime, timedelta
from functools import wraps
from typing import Any, TypeVar
from urllib.parse import urlencode

from django.contrib.auth.signals import user_logged_in
from django.http import HttpRequest, HttpResponse
from django.shortcuts import redirect
from django.urls import reverse
from django.utils import timezone
from django.utils.http import url_has_allowed_host_and_scheme

CONFIRMED_AT = "confirmed_at"  # key of the browser session
LIFETIME = timedelta(minutes=10)

ViewT = TypeVar("ViewT", bound=Callable[..., Any])


def confirm(request: HttpRequest, now: datetime) -> None:
    """Note that the person has just shown the password or a factor."""
    request.session[CONFIRMED_AT] = int(now.timestamp())


def is_confirmed(request: HttpRequest, now: datetime) -> bool:
    """Return whether the person has shown the password or a factor lately."""
    confirmed_at: float = request.session.get(CONFIRMED_AT, 0)
    return now.timestamp() - confirmed_at < LIFETIME.total_seconds()


def required(view: ViewT) -> ViewT:
    """Ask who it is before a page; a form that was sent has to be sent again."""
    return _guard(view, ask)


def required_for_download(view: ViewT) -> ViewT:
    """Ask who it is before a download, and return to the page that links to it."""
    return _guard(view, ask_and_go_back)


def _guard(view: ViewT, refuse: Callable[[HttpRequest], HttpResponse]) -> ViewT:
    @wraps(view)
    def guarded(request: HttpRequest, *args: Any, **kwargs: Any) -> Any:
        # Who enrolls a factor before being signed in has shown the password just now.
        if request.user.is_authenticated and not is_confirmed(request, timezone.now()):
            return refuse(request)
        return view(request, *args, **kwargs)

    return guarded  # type: ignore[return-value]


def ask(request: HttpRequest) -> HttpResponse:
    """Return the way to the page that asks, and from there back to this one."""
    if request.method not in {"GET", "HEAD"}:
        return ask_and_go_back(request)
    return _ask(request.get_full_path())


def ask_and_go_back(request: HttpRequest) -> HttpResponse:
    """Return the way to the page that asks, and from there to the page that led here."""
    before = request.headers.get("Referer", "")
    return _ask(before if is_own_page(request, before) else reverse("home"))


def is_own_page(request: HttpRequest, url: str) -> bool:
    """Return whether an address is a page of this server."""
    return url_has_allowed_host_and_scheme(
        url, allowed_hosts={request.get_host()}, require_https=request.is_secure()
    )


def way_back(request: HttpRequest) -> str:
    """Return the page of this server that ``next`` in the address names; empty for none."""
    next_url = request.GET.get("next", "")
    return next_url if is_own_page(request, next_url) else ""


def _ask(next_url: str) -> HttpResponse:
    return redirect(f"{reverse('confirm')}?{urlencode({'next': next_url})}")


def _confirm_sign_in(request: HttpRequest, **_: Any) -> None:
    confirm(request, timezone.now())


def connect_signals() -> None:
    """Let a sign-in count as shown."""
    user_logged_in.connect(_confirm_sign_in, dispatch_uid="garry.step_up")
