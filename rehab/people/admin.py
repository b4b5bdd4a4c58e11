"""Admin of clinics, accounts and patients."""

from __future__ import annotations

from typing import Any
from zoneinfo import ZoneInfo

from django.contrib import admin, messages
from django.contrib.auth.admin import UserAdmin
from django.contrib.auth.forms import AdminUserCreationForm
from django.contrib.auth.models import Group
from django.contrib.auth.views import redirect_to_login
from django.core.exceptions import ValidationError
from django.db import connection, transaction
from django.db.models import Count, Max, QuerySet
from django.http import HttpRequest, HttpResponseBase
from django.shortcuts import redirect
from django.urls import reverse
from django.utils import timezone
from django.utils.html import format_html
from django.utils.translation import gettext
from django.utils.translation import gettext_lazy as _

from rehab.people.access import person
from rehab.people.aliases import say_alias
from rehab.people.audit.audit_log import Act, note_safety
from rehab.people.models import Clinic, Patient, User
from rehab.people.networks import client_address
from rehab.people.pages.sign_in import sign_out
from rehab.people.roles import Role
from rehab.people.sign_in import factors, lockout
from rehab.people.sign_in.tokens import ApiToken
from rehab.people.web.admin_base import RowAdmin, ScopedAdmin, ScopedOptions, TokenAdmin, rights

admin.site.site_header = "GARRY"
admin.site.site_title = "GARRY"
admin.site.index_title = "Clinic"
admin.site.unregister(Group)  # rights come from roles


def to_sign_in(request: HttpRequest, extra_context: Any = None) -> HttpResponseBase:
    """Send to the one page where everybody signs in."""
    return redirect_to_login(request.GET.get("next", "") or reverse("admin:index"))


def to_own_password(request: HttpRequest, extra_context: Any = None) -> HttpResponseBase:
    """Send to the one page where people change their own password."""
    return redirect("own-password")


# One door: the admin's own pages for these know no second factor.
admin.site.login = to_sign_in  # type: ignore[assignment]
admin.site.logout = sign_out  # type: ignore[assignment]
admin.site.password_change = to_own_password  # type: ignore[assignment]


@admin.register(Clinic)
class ClinicAdmin(ScopedAdmin):
    """Clinics: the host adds them, a lead keeps the details of the own one."""

    list_display = ("name", "language", "time_zone", "second_factor_required", "boards_across")
    search_fields = ("name",)
    fields = (
        *("name", "language", "time_zone", "boards_across", "second_factor_required"),
        *("care_needs_consent", "research_needs_consent", "networks"),
        *("keep_months", "keep_log_months"),
    )


class NewAccountForm(AdminUserCreationForm):
    """Django's form for a new account; names are taken server-wide."""

    class Meta(AdminUserCreationForm.Meta):
        model = User

    def clean_username(self) -> str:
        """Refuse a name that any account has."""
        username: str = self.cleaned_data["username"]
        if User.is_taken(username):
            raise ValidationError(gettext("This name is taken. Choose another one."))
        return username


@admin.register(User)
class AccountAdmin(ScopedOptions, RowAdmin, UserAdmin):
    """Accounts: a lead keeps those of the own clinic, a host all of them."""

    list_display = (
        "username",
        "first_name",
        "last_name",
        "role",
        "clinic",
        "last_login",
        "is_active",
    )
    list_filter = ("role", "is_active", "last_login", ("clinic", admin.RelatedOnlyFieldListFilter))
    list_select_related = ("clinic",)
    show_facets = admin.ShowFacets.NEVER
    add_form = NewAccountForm
    filter_horizontal = ()
    ordering = ("username",)
    actions = ("unlock", "remove_second_factors")

    @admin.action(description=_("Unlock after too many wrong tries"), permissions=["change"])
    def unlock(self, request: HttpRequest, accounts: QuerySet[User]) -> None:
        """Let the chosen accounts try again at once."""
        for account in accounts:
            with transaction.atomic():
                by, address = person(request), client_address(request)
                note_safety(Act.UNLOCK, by, account, address, timezone.now())
                lockout.forgive(account)
        words = gettext("Accounts that may try again: %(count)s.")
        messages.success(request, words % {"count": accounts.count()})

    @admin.action(
        description=_("Remove second factors (lost phone or key)"), permissions=["change"]
    )
    def remove_second_factors(self, request: HttpRequest, accounts: QuerySet[User]) -> None:
        """Take the chosen accounts back to their passwords alone."""
        for account in accounts:
            with transaction.atomic():
                by, address = person(request), client_address(request)
                note_safety(Act.FACTORS, by, account, address, timezone.now())
                factors.forget_all(account)
        words = gettext(
            "%(count)s account(s) sign in by password alone now, or set up a new second "
            "factor where the clinic asks for one. If a phone was stolen, give a new password too."
        )
        messages.warning(request, words % {"count": accounts.count()})

    def has_module_permission(self, request: HttpRequest) -> bool:
        """Whether accounts are on the front page."""
        return bool(rights(request, User))

    def get_fieldsets(self, request: HttpRequest, obj: Any = None) -> Any:
        """Give the fields; only a host, who has no clinic, chooses one."""
        works = ("role", "clinic") if person(request).role == Role.HOST else ("role",)
        if obj is None:
            passwords = ("usable_password", "password1", "password2")
            return [(None, {"fields": ("username", *passwords, *works)})]
        return [
            (None, {"fields": ("username", "password", *works, "is_active")}),
            (_("Person"), {"fields": ("first_name", "last_name", "email")}),
        ]

    def get_form(
        self, request: HttpRequest, obj: Any = None, change: bool = False, **kwargs: Any
    ) -> Any:
        """Give the form; a lead's new account is of the lead's own clinic."""
        form: Any = super().get_form(request, obj, change=change, **kwargs)
        clinic_id = person(request).clinic_id
        if clinic_id is None:
            return form

        class OfClinic(form):  # type: ignore[misc]
            def __init__(self, *args: Any, **kwargs: Any) -> None:
                super().__init__(*args, **kwargs)
                self.instance.clinic_id = clinic_id

        return OfClinic

    def formfield_for_choice_field(self, db_field: Any, request: HttpRequest, **kwargs: Any) -> Any:
        """Offer the roles that this person may give: only a host makes hosts."""
        if db_field.name == "role" and person(request).role != Role.HOST:
            kwargs["choices"] = [choice for choice in Role.choices if choice[0] != Role.HOST]
        return super().formfield_for_choice_field(db_field, request, **kwargs)


@admin.register(ApiToken)
class ApiTokenAdmin(TokenAdmin):
    """What lets programs use the API."""

    list_display = ("name", "user", "role", "created_at", "last_seen_at", "revoked_at")
    list_filter = ("role", "last_seen_at", "revoked_at")
    search_fields = ("name", "user__username")
    fields = ("name", "user", "role", "created_at", "last_seen_at", "revoked_at")


@admin.register(Patient)
class PatientAdmin(ScopedAdmin):
    """Patients of the clinic."""

    list_display = (
        "nickname",
        "code",
        "paretic_side",
        "session_count",
        "last_here",
        "boards",
        "simulated",
    )
    list_filter = ("paretic_side", "boards", "blinded", "simulated", "language", "created_at")
    list_select_related = ("clinic",)
    ordering = ("nickname", "code")  # rows that are counted with others have no order of their own
    search_fields = ("nickname", "code")
    fields = (
        "code",
        "nickname",
        "body_mass_kg",
        "paretic_side",
        "language",
        "boards_agreed",
        "animal_name",
        "blinded",
        "pseudonym",
        "created_at",
        "ended_at",
        "erased_at",
    )
    readonly_fields = (
        *("boards_agreed", "animal_name", "pseudonym"),
        *("created_at", "ended_at", "erased_at"),
    )
    actions = row_actions = ("draw_aliases",)

    def get_queryset(self, request: HttpRequest) -> QuerySet[Any]:
        """Give the visible patients with how often and when they were here last."""
        rows: QuerySet[Any] = (
            super()
            .get_queryset(request)
            .annotate(walks=Count("sessions"), last_visit=Max("sessions__created_at"))
        )
        return rows

    def get_object(self, request: HttpRequest, object_id: str, from_field: Any = None) -> Any:
        """Find a patient; one who is about to be changed is held, so that no erasing is undone."""
        patient = super().get_object(request, object_id, from_field)
        if patient is not None and request.method == "POST" and connection.in_atomic_block:
            patient.hold()
        return patient

    def save_model(self, request: HttpRequest, obj: Any, form: Any, change: bool) -> None:
        """Store what the form asked for."""
        if change:
            obj.keep(*form.changed_data)
        else:
            super().save_model(request, obj, form, change)

    def get_row_links(self, request: HttpRequest, row: Any) -> list[tuple[str, Any]]:
        """Lead to where the patient walks, and to what was walked."""
        return [
            (reverse("patient", args=[row.pk]), _("Start a session")),
            (reverse("history", args=[row.pk]), _("Past sessions")),
            (reverse("consent", args=[row.pk]), _("Consent")),
        ]

    @admin.display(description=_("sessions"), ordering="walks")
    def session_count(self, patient: Any) -> int:
        """Count the sessions."""
        count: int = patient.walks
        return count

    @admin.display(description=_("last here"), ordering="last_visit")
    def last_here(self, patient: Any) -> Any:
        """Give the day of the last session by the clinic's clock."""
        zone = ZoneInfo(patient.clinic.time_zone)
        return patient.last_visit and patient.last_visit.astimezone(zone).date()

    @admin.display(description=_("leaderboards"))
    def boards_agreed(self, patient: Patient) -> Any:
        """Say on which boards the patient agrees to stand, and where that is noted."""
        if patient.is_new:
            return _("Noted on the patient's consent page, once the patient is here.")
        return format_html(
            '{} · <a href="{}">{}</a>',
            patient.get_boards_display(),
            reverse("consent", args=[patient.pk]),
            _("Change it on the consent page"),
        )

    @admin.display(description=_("animal name"))
    def animal_name(self, patient: Patient) -> str:
        """Say what the patient is called on boards."""
        return say_alias(patient.alias) if patient.alias else "–"

    @admin.action(description=_("Draw new animal names for boards"), permissions=["change"])
    def draw_aliases(self, request: HttpRequest, patients: QuerySet[Patient]) -> None:
        """Give the chosen patients other names on boards."""
        drawn = list(patients.filter(erased_at=None))
        for patient in drawn:
            patient.draw_alias()
            patient.keep("alias")
        names = ", ".join(f"{patient.nickname}: {self.animal_name(patient)}" for patient in drawn)
        messages.success(request, gettext("New names on boards. %(names)s") % {"names": names})
