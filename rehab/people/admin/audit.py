"""Admin of the audit log and the change history, for the leads of a clinic."""

from __future__ import annotations

from typing import Any, ClassVar

from django.apps import apps
from django.contrib import admin
from django.contrib.admin import RelatedOnlyFieldListFilter
from django.http import HttpRequest
from django.urls import Resolver404, resolve
from django.utils.html import format_html
from django.utils.translation import gettext_lazy

from rehab.people.audit.audit_log import AuditEntry
from rehab.people.audit.history import HistoryEntry
from rehab.people.audit.row_history import describe_actor
from rehab.people.roles import Role
from rehab.people.web.admin_base import ReadOnlyAdmin, rights_for

# What pages are called that are looked at often; others by their address.
PAGES = {
    "assessments": gettext_lazy("Standard tests"),
    "caseload": gettext_lazy("Caseload"),
    "consent": gettext_lazy("Consent"),
    "family-links": gettext_lazy("Family view"),
    "history": gettext_lazy("Past sessions"),
    "incidents": gettext_lazy("Incidents"),
    "insight": gettext_lazy("Hit rates compared"),
    "monitor": gettext_lazy("Therapist’s page"),
    "patient": gettext_lazy("Patient"),
    "records": gettext_lazy("Consent and data"),
    "replay": gettext_lazy("Replay"),
    "report": gettext_lazy("Report"),
    "session": gettext_lazy("Session"),
    "take-home": gettext_lazy("For the patient"),
    "walk": gettext_lazy("Patient’s page"),
}


class LogAdmin(ReadOnlyAdmin):
    """Pages of a log of the whole clinic, for its leads alone."""

    date_hierarchy = "at"
    list_per_page = 100

    def has_module_permission(self, request: HttpRequest) -> bool:
        """Return whether the log is on the front page: it is for leads."""
        return bool(rights_for(request, self.model)) and self._leads(request)

    def has_view_permission(self, request: HttpRequest, obj: Any = None) -> bool:
        """Return whether the log may be read."""
        return self._leads(request) and super().has_view_permission(request, obj)

    @staticmethod
    def _leads(request: HttpRequest) -> bool:
        return getattr(request.user, "role", "") == Role.LEAD

    @admin.display(description=gettext_lazy("who"), ordering="by")
    def who(self, entry: Any) -> str:
        """Return the person, and the program or device used."""
        return describe_actor(entry)


@admin.register(AuditEntry)
class AuditAdmin(LogAdmin):
    """Who looked at or exported patients' data, or commanded a robot."""

    list_display = ("at", "who", "act", "times", "patient", "page", "address")
    list_filter: ClassVar[Any] = (
        "act",
        ("by", RelatedOnlyFieldListFilter),
        ("patient", RelatedOnlyFieldListFilter),
    )
    search_fields = ("patient__nickname", "patient__code", "by__username", "about")
    list_select_related = ("by", "patient")

    @admin.display(description=gettext_lazy("times"), ordering="count")
    def times(self, entry: AuditEntry) -> str:
        """Return how often it was done; "" for once."""
        return f"{entry.count} ×" if entry.count > 1 else ""

    @admin.display(description=gettext_lazy("where in GARRY"), ordering="about")
    def page(self, entry: AuditEntry) -> str:
        """Return the name of the page, else its address or what was asked for."""
        try:
            name = resolve(entry.about).view_name
        except Resolver404:
            name = ""
        return format_html('<span title="{}">{}</span>', entry.about, PAGES.get(name, entry.about))


@admin.register(HistoryEntry)
class HistoryAdmin(LogAdmin):
    """Who changed people and settings. Each row's own page shows its changes in full."""

    list_display = ("at", "who", "kind", "model_name", "object_id", "fields_changed")
    list_filter: ClassVar[Any] = ("kind", "model_name", ("by", RelatedOnlyFieldListFilter))
    list_select_related = ("by",)

    @admin.display(description=gettext_lazy("fields"))
    def fields_changed(self, entry: HistoryEntry) -> str:
        """Return the names of the fields."""
        fields = apps.get_model("rehab", entry.model_name)._meta.get_fields()
        names = {field.name: str(getattr(field, "verbose_name", field.name)) for field in fields}
        return ", ".join(names.get(name, name) for name in entry.changes)
