"""Admin of patients."""

from __future__ import annotations

from typing import Any
from zoneinfo import ZoneInfo

from django.contrib import admin, messages
from django.db import connection
from django.db.models import Count, Max, QuerySet
from django.http import HttpRequest
from django.urls import reverse
from django.utils.html import format_html
from django.utils.translation import gettext
from django.utils.translation import gettext_lazy as _

from rehab.people.aliases import format_alias
from rehab.people.field_policy import details
from rehab.people.models import BoardsConsent, Patient
from rehab.people.models.hidden_patients import is_in_running_study
from rehab.people.web.admin_base import ScopedAdmin
from rehab.people.web.row_forms import MonthField

NAMED = ("nickname", "code", "language")


@admin.register(Patient)
class PatientAdmin(ScopedAdmin):
    """Patients of the clinic."""

    list_display = (
        "nickname",
        "code",
        "paretic_side",
        "session_count",
        "last_here",
        "on_boards",
        "badge",
    )
    list_filter = ("paretic_side", "boards", "blinded", "simulated", "language", "created_at")
    list_select_related = ("clinic",)
    ordering = ("simulated", "nickname", "code")  # rows with aggregates lose the model's ordering
    search_fields = ("nickname", "code")
    fieldsets = (
        (None, {"fields": NAMED}),
        (
            _("Clinical data"),
            {"fields": tuple(name for name in details(Patient) if name not in NAMED)},
        ),
        (
            _("Leaderboards and studies"),
            {"fields": ("boards_agreed", "animal_name", "blinded", "pseudonym")},
        ),
        (_("Dates"), {"fields": ("created_at", "ended_at", "erased_at")}),
    )
    readonly_fields = (
        *("boards_agreed", "animal_name", "pseudonym"),
        *("created_at", "ended_at", "erased_at"),
    )
    actions = row_actions = ("draw_aliases",)

    def get_queryset(self, request: HttpRequest) -> QuerySet[Any]:
        """Return the visible patients with the number of sessions and the last visit."""
        rows: QuerySet[Any] = (
            super()
            .get_queryset(request)
            .annotate(sessions_total=Count("sessions"), last_visit=Max("sessions__created_at"))
        )
        return rows

    def get_readonly_fields(self, request: HttpRequest, obj: Any = None) -> Any:
        """Return what follows from elsewhere; of a study's participant also the blinding."""
        fields = super().get_readonly_fields(request, obj)
        in_study = obj is not None and is_in_running_study(obj)
        return (*fields, "blinded") if in_study else fields

    def get_object(self, request: HttpRequest, object_id: str, from_field: Any = None) -> Any:
        """Return a patient, locked before a change, so that no erasure is undone."""
        patient = super().get_object(request, object_id, from_field)
        if patient is not None and request.method == "POST" and connection.in_atomic_block:
            patient.lock()
        return patient

    def save_model(self, request: HttpRequest, obj: Any, form: Any, change: bool) -> None:
        """Save the changed fields alone."""
        if change:
            obj.save_fields(*form.changed_data)
        else:
            super().save_model(request, obj, form, change)

    def formfield_for_dbfield(self, db_field: Any, request: HttpRequest, **kwargs: Any) -> Any:
        """Return the field; of the stroke the month alone."""
        if db_field.name == "stroke_month":
            kwargs |= {"form_class": MonthField, "widget": MonthField.widget}
        return super().formfield_for_dbfield(db_field, request, **kwargs)

    def get_row_links(self, request: HttpRequest, row: Any) -> list[tuple[str, Any]]:
        """Return links to start a session, to past sessions and to consent."""
        return [
            (reverse("patient", args=[row.pk]), _("Start a session")),
            (reverse("history", args=[row.pk]), _("Past sessions")),
            (reverse("consent", args=[row.pk]), _("Consent")),
        ]

    @admin.display(description=_("sessions"), ordering="sessions_total")
    def session_count(self, patient: Any) -> int:
        """Return the number of sessions."""
        count: int = patient.sessions_total
        return count

    @admin.display(description=_("last here"), ordering="last_visit")
    def last_here(self, patient: Any) -> Any:
        """Return the date of the last session in the clinic's time zone."""
        zone = ZoneInfo(patient.clinic.time_zone)
        return patient.last_visit and patient.last_visit.astimezone(zone).date()

    @admin.display(description=_("leaderboards"), ordering="boards")
    def on_boards(self, patient: Patient) -> str:
        """Return how far the patient agreed to boards; "" for not at all."""
        return "" if patient.boards == BoardsConsent.OWN else patient.get_boards_display()

    @admin.display(description=_("simulated"), ordering="simulated")
    def badge(self, patient: Patient) -> str:
        """Return that nobody walks as this patient; "" for a person."""
        badge = format_html('<span class="badge warn">{}</span>', gettext("yes"))
        return badge if patient.simulated else ""

    @admin.display(description=_("leaderboards"))
    def boards_agreed(self, patient: Patient) -> Any:
        """Return the boards the patient has consented to, with a link to the consent page."""
        if patient.is_new:
            return _("To be noted on the patient's consent page, once the patient is here.")
        return format_html(
            '{} · <a href="{}">{}</a>',
            patient.get_boards_display(),
            reverse("consent", args=[patient.pk]),
            _("Change it on the consent page"),
        )

    @admin.display(description=_("animal name"))
    def animal_name(self, patient: Patient) -> str:
        """Return the patient's alias on boards."""
        return format_alias(patient.alias) if patient.alias else "–"

    @admin.action(description=_("Draw new animal names for boards"), permissions=["change"])
    def draw_aliases(self, request: HttpRequest, patients: QuerySet[Patient]) -> None:
        """Draw new aliases for the chosen patients."""
        drawn = list(patients.filter(erased_at=None))
        for patient in drawn:
            patient.draw_alias()
            patient.save_fields("alias")
        names = ", ".join(f"{patient.nickname}: {self.animal_name(patient)}" for patient in drawn)
        messages.success(request, gettext("New names on boards. %(names)s") % {"names": names})
