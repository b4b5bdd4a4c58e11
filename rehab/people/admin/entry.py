"""The admin's name, and how one comes in and out: as everywhere, by our own pages."""

from __future__ import annotations

from typing import Any

from django.contrib import admin
from django.contrib.auth.models import Group
from django.contrib.auth.views import redirect_to_login
from django.http import HttpRequest, HttpResponseBase
from django.shortcuts import redirect
from django.urls import reverse

from rehab.people.pages.sign_in import sign_out

admin.site.site_header = "GARRY"
admin.site.site_title = "GARRY"
admin.site.index_title = "Clinic"
admin.site.unregister(Group)  # rights come from roles


def redirect_to_sign_in(request: HttpRequest, extra_context: Any = None) -> HttpResponseBase:
    """Redirect to the page where everybody signs in."""
    return redirect_to_login(request.GET.get("next", "") or reverse("admin:index"))


def redirect_to_own_password(request: HttpRequest, extra_context: Any = None) -> HttpResponseBase:
    """Redirect to the page where people change their own password."""
    return redirect("own-password")


# The admin's own pages for these do not ask for a second factor.
admin.site.login = redirect_to_sign_in  # type: ignore[assignment]
admin.site.logout = sign_out  # type: ignore[assignment]
admin.site.password_change = redirect_to_own_password  # type: ignore[assignment]
