"""Admin of clinics."""

from __future__ import annotations

from typing import Any

from django.contrib import admin
from django.http import HttpRequest
from django.urls import reverse
from django.utils.translation import gettext

from rehab.people.access import user_of
from rehab.people.models import Clinic, SignOnGroup
from rehab.people.roles import Role
from rehab.people.web.admin_base import ScopedAdmin


@admin.register(Clinic)
class ClinicAdmin(ScopedAdmin):
    """Clinics: the host adds them, a lead edits the own one."""

    list_display = ("name", "language", "time_zone", "second_factor_required", "boards_across")
    search_fields = ("name",)
    fields = (
        *("name", "language", "time_zone", "boards_across", "second_factor_required"),
        *("care_needs_consent", "research_needs_consent", "networks", "note_template"),
        *("retention_months", "log_retention_months"),
    )

    def get_row_links(self, request: HttpRequest, row: Any) -> list[tuple[str, Any]]:
        """Return for a host where the clinic is taken out, verified and removed."""
        links = [(reverse("move-clinic", args=[row.pk]), gettext("Move or remove"))]
        return links if user_of(request).role == Role.HOST else []


@admin.register(SignOnGroup)
class SignOnGroupAdmin(ScopedAdmin):
    """Groups of the hospital's sign-on: the host says which clinic and role they give."""

    list_display = ("name", "clinic", "role")
    list_select_related = ("clinic",)
    fields = ("name", "clinic", "role")

    def get_exclude(self, request: HttpRequest, obj: Any = None) -> Any:
        """Return nothing: a host, who has no clinic, chooses one."""
        return ()
