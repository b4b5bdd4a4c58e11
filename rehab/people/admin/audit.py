"""Admin of the audit log and the change history, for the leads of a clinic."""

from __future__ import annotations

import re
from contextlib import suppress
from typing import Any, ClassVar

from django.apps import apps
from django.contrib import admin
from django.contrib.admin import RelatedOnlyFieldListFilter
from django.http import HttpRequest
from django.urls import Resolver404, resolve
from django.utils.html import format_html
from django.utils.text import capfirst
from django.utils.translation import gettext_lazy as _

from rehab.people.audit.audit_log import AuditEntry
from rehab.people.audit.history import HistoryEntry
from rehab.people.audit.row_history import describe_actor
from rehab.people.roles import Role
from rehab.people.web.admin_base import ReadOnlyAdmin, rights_for

# What pages are called of which the log speaks, with the names of their addresses.
NAMES = (
    (_("Admin"), "admin:index"),
    (_("All sessions as a file"), "export export-sessions"),
    (_("Alarms"), "alarms acknowledge-alarms"),
    (_("Caseload"), "caseload"),
    (_("Consent"), "consent"),
    (_("Consent and data"), "records erase patient-data"),
    (_("Correct a session"), "correct"),
    (_("Enroll a patient"), "enroll"),
    (_("Family view"), "family family-links end-family-link"),
    (_("Take-home page"), "take-home"),
    (_("Hit rates compared"), "insight insight-file"),
    (_("Incidents"), "incidents incident incident-file"),
    (_("Leaderboards"), "scores leave-boards waiting-board"),
    (_("Move or remove"), "move-clinic clinic-file"),
    (_("New patient"), "new-patient demo"),
    (_("New session"), "setup"),
    (_("Participant"), "participant start-visit leave-study note-guess agree-again reveal"),
    (_("Past sessions"), "history"),
    (_("Patient"), "patient edit-patient end-program reopen"),
    (_("Patient’s page"), "walk ending leave own-language"),
    (_("Questions after a session"), "questions add-questionnaire"),
    (_("Replay"), "replay"),
    (_("Report"), "report"),
    (_("Results"), "study-results study-results-file"),
    (_("Screen"), "screen check-screen"),
    (_("Session"), "session"),
    (_("Standard tests"), "assessments assess strike-out"),
    (_("Start"), "start"),
    (_("Stations"), "stations stop-robot"),
    (_("Studies"), "studies study"),
    (_("Therapist’s page"), "monitor write-note"),
    (_("Try a phone"), "try-phone open-trial-phone"),
    (_("Two sessions"), "side-by-side"),
    (_("Visits"), "visits"),
    (_("Words of this session"), "words"),
)
PAGES = {name: words for words, names in NAMES for name in names.split()}
SOCKET = re.compile(r"/ws/session/\d+/(patient|monitor)/")
PARAMETER = re.compile(r"<(\w+):\w+>")


def name_of_page(about: str) -> str:
    """Return what a page, list or form is called, by its address or route; else that itself."""
    address = PARAMETER.sub(lambda part: "1" if part[1] == "int" else "x", about)
    if socket := SOCKET.match(address):
        return str(PAGES["walk" if socket[1] == "patient" else "monitor"])
    try:
        name = resolve(address).view_name
    except Resolver404:
        return about
    with suppress(LookupError, ValueError):
        app, model = name.removeprefix("admin:").split("_")[:2]
        return str(capfirst(apps.get_model(app, model)._meta.verbose_name_plural))
    return str(PAGES.get(name, about))


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

    @admin.display(description=_("who"), ordering="by")
    def who(self, entry: Any) -> str:
        """Return the person, and the program or device used."""
        return describe_actor(entry)


@admin.register(AuditEntry)
class AuditAdmin(LogAdmin):
    """Who looked at or exported patients' data, or commanded a robot."""

    list_display = ("at", "who", "done", "patient", "page", "address")
    list_filter: ClassVar[Any] = (
        "act",
        ("by", RelatedOnlyFieldListFilter),
        ("patient", RelatedOnlyFieldListFilter),
    )
    search_fields = ("patient__nickname", "patient__code", "by__username", "about")
    list_select_related = ("by", "patient")

    @admin.display(description=_("what"), ordering="act")
    def done(self, entry: AuditEntry) -> str:
        """Return what was done, and how often if more than once."""
        times = f" ({entry.count} ×)" if entry.count > 1 else ""
        return f"{entry.get_act_display()}{times}"

    @admin.display(description=_("where in GARRY"), ordering="about")
    def page(self, entry: AuditEntry) -> str:
        """Return the name of the page, with its address to hover over."""
        name = name_of_page(entry.about)
        return format_html('<span title="{}">{}</span>', entry.about, name)


@admin.register(HistoryEntry)
class HistoryAdmin(LogAdmin):
    """Who changed people and settings. Each row's own page shows its changes in full."""

    list_display = ("at", "who", "kind", "model_name", "object_id", "fields_changed")
    list_filter: ClassVar[Any] = ("kind", "model_name", ("by", RelatedOnlyFieldListFilter))
    list_select_related = ("by",)

    @admin.display(description=_("fields"))
    def fields_changed(self, entry: HistoryEntry) -> str:
        """Return the names of the fields."""
        fields = apps.get_model("rehab", entry.model_name)._meta.get_fields()
        names = {field.name: str(getattr(field, "verbose_name", field.name)) for field in fields}
        return ", ".join(names.get(name, name) for name in entry.changes)
