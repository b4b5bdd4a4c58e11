"""Admin of clinics, accounts and patients."""

from __future__ import annotations

from typing import Any
from zoneinfo import ZoneInfo

from django.contrib import admin, messages
from django.contrib.admin.utils import unquote
from django.contrib.auth.admin import UserAdmin
from django.contrib.auth.forms import AdminUserCreationForm
from django.contrib.auth.models import Group
from django.contrib.auth.views import redirect_to_login
from django.core.exceptions import ValidationError
from django.db import connection, transaction
from django.db.models import Count, Max, QuerySet
from django.http import HttpRequest, HttpResponse, HttpResponseBase
from django.shortcuts import redirect
from django.urls import reverse
from django.utils import timezone
from django.utils.html import format_html
from django.utils.translation import gettext
from django.utils.translation import gettext_lazy as _

from rehab.people.access import user_of
from rehab.people.aliases import format_alias
from rehab.people.audit.audit_log import Act, record_security_change
from rehab.people.models import Clinic, Patient, User
from rehab.people.models.blinding import RUNNING
from rehab.people.networks import client_address
from rehab.people.pages.sign_in import sign_out
from rehab.people.roles import Role
from rehab.people.sign_in import attempts, factors, resets, step_up
from rehab.people.sign_in.tokens import ApiToken
from rehab.people.web.admin_base import (
    ScopedAdmin,
    ScopedOptions,
    TokenAdmin,
    TrackedAdmin,
    rights_for,
)

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


@admin.register(Clinic)
class ClinicAdmin(ScopedAdmin):
    """Clinics: the host adds them, a lead edits the own one."""

    list_display = ("name", "language", "time_zone", "second_factor_required", "boards_across")
    search_fields = ("name",)
    fields = (
        *("name", "language", "time_zone", "boards_across", "second_factor_required"),
        *("care_needs_consent", "research_needs_consent", "networks"),
        *("retention_months", "log_retention_months"),
    )


class NewAccountForm(AdminUserCreationForm):
    """Django's form for a new account; names are unique on the whole server."""

    class Meta(AdminUserCreationForm.Meta):
        model = User

    def clean_username(self) -> str:
        """Refuse a name that any account has."""
        username: str = self.cleaned_data["username"]
        if User.is_taken(username):
            raise ValidationError(gettext("This name is taken. Choose another one."))
        return username


@admin.register(User)
class AccountAdmin(ScopedOptions, TrackedAdmin, UserAdmin):
    """Accounts: a lead manages those of the own clinic, a host all of them."""

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
        """End the lockouts of the chosen accounts."""
        for account in accounts:
            with transaction.atomic():
                by, address = user_of(request), client_address(request)
                record_security_change(Act.UNLOCK, by, account, address, timezone.now())
                attempts.forget_all(account)
        message = gettext("Accounts that may try again: %(count)s.")
        messages.success(request, message % {"count": accounts.count()})

    @admin.action(
        description=_("Remove second factors (lost phone or key)"), permissions=["change"]
    )
    def remove_second_factors(
        self, request: HttpRequest, accounts: QuerySet[User]
    ) -> HttpResponse | None:
        """Remove all second factors of the chosen accounts, but not one's own."""
        if not step_up.is_confirmed(request, timezone.now()):
            return step_up.ask(request)
        removed = 0
        for account in accounts:
            if not self._may_reset(request, account):
                continue
            removed += 1
            with transaction.atomic():
                by, address = user_of(request), client_address(request)
                record_security_change(Act.FACTORS, by, account, address, timezone.now())
                factors.remove_second_factors(account)
        message = gettext(
            "%(count)s account(s) sign in by password alone now, or set up a new second "
            "factor where the clinic asks for one. If a phone was stolen, give a new password too."
        )
        if removed:
            messages.warning(request, message % {"count": removed})
        return None

    def user_change_password(
        self,
        request: HttpRequest,
        id: str,  # noqa: A002 (Django's name)
        form_url: str = "",
    ) -> HttpResponse:
        """Change another account's password. One's own takes the old one, on its own page."""
        account = self.get_object(request, unquote(id))
        if account is not None and account.pk == user_of(request).pk:
            return redirect("own-password")
        if not step_up.is_confirmed(request, timezone.now()):
            return step_up.ask(request)
        sent = request.method == "POST"
        if sent and account is not None and not self._may_reset(request, account):
            return redirect("admin:rehab_user_change", account.pk)
        return super().user_change_password(request, id, form_url)

    def _may_reset(self, request: HttpRequest, account: User) -> bool:
        """Return whether this person may reset how an account signs in; where not, say why."""
        user = user_of(request)
        if account.pk == user.pk:
            messages.error(request, gettext("Your own you change on the page Your account."))
            return False
        if resets.may_reset(user, account, timezone.now()):
            return True
        message = gettext(
            "First %(account)s or another host has to confirm this, on the page Your account. Then "
            "do it again within an hour."
        )
        messages.error(request, message % {"account": account})
        return False

    def has_module_permission(self, request: HttpRequest) -> bool:
        """Return whether accounts are on the front page."""
        return bool(rights_for(request, User))

    def get_fieldsets(self, request: HttpRequest, obj: Any = None) -> Any:
        """Return the fields; only a host, who has no clinic, chooses one."""
        role_fields = ("role", "clinic") if user_of(request).role == Role.HOST else ("role",)
        if obj is None:
            passwords = ("usable_password", "password1", "password2")
            return [(None, {"fields": ("username", *passwords, *role_fields)})]
        return [
            (None, {"fields": ("username", "password", *role_fields, "is_active")}),
            (_("Person"), {"fields": ("first_name", "last_name", "email")}),
        ]

    def get_form(
        self, request: HttpRequest, obj: Any = None, change: bool = False, **kwargs: Any
    ) -> Any:
        """Return the form; a lead's new account belongs to the lead's own clinic."""
        form: Any = super().get_form(request, obj, change=change, **kwargs)
        clinic_id = user_of(request).clinic_id
        if clinic_id is None:
            return form

        class OwnClinicForm(form):  # type: ignore[misc]
            def __init__(self, *args: Any, **kwargs: Any) -> None:
                super().__init__(*args, **kwargs)
                self.instance.clinic_id = clinic_id

        return OwnClinicForm

    def formfield_for_choice_field(self, db_field: Any, request: HttpRequest, **kwargs: Any) -> Any:
        """Offer the roles that this person may assign: only a host creates hosts."""
        if db_field.name == "role" and user_of(request).role != Role.HOST:
            kwargs["choices"] = [choice for choice in Role.choices if choice[0] != Role.HOST]
        return super().formfield_for_choice_field(db_field, request, **kwargs)


@admin.register(ApiToken)
class ApiTokenAdmin(TokenAdmin):
    """API tokens of programs. Everybody makes the own ones; a lead revokes any of the clinic."""

    list_display = ("name", "user", "role", "expires_at", "last_seen_at", "revoked_at")
    list_filter = ("role", "last_seen_at", "revoked_at")
    search_fields = ("name", "user__username")
    fields = (
        *("name", "user", "role", "may_read", "may_steer", "may_export", "expires_at"),
        *("created_at", "last_seen_at", "revoked_at"),
    )
    readonly_fields = ("user", *TokenAdmin.readonly_fields)

    def get_readonly_fields(self, request: HttpRequest, obj: Any = None) -> Any:
        """Return the fixed fields: what a token may do is set when it is made."""
        if obj is None:
            return self.readonly_fields
        return tuple(name for name in self.fields if name != "name")

    def get_form(
        self, request: HttpRequest, obj: Any = None, change: bool = False, **kwargs: Any
    ) -> Any:
        """Return the form; a new token speaks for whoever makes it."""
        form: Any = super().get_form(request, obj, change=change, **kwargs)
        maker = user_of(request)

        class OwnTokenForm(form):  # type: ignore[misc]
            def __init__(self, *args: Any, **kwargs: Any) -> None:
                super().__init__(*args, **kwargs)
                if self.instance.pk is None:
                    self.instance.user = maker

        return OwnTokenForm

    def may_issue(self, request: HttpRequest, holder: Any) -> bool:
        """Return whether this person may have the token: it is the own one."""
        return bool(holder.user_id == user_of(request).pk)


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
    ordering = ("nickname", "code")  # rows with aggregates lose the model's ordering
    search_fields = ("nickname", "code")
    fields = (
        "code",
        "nickname",
        "body_mass_kg",
        ("birth_year", "stroke_month", "severity"),
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
        in_study = obj is not None and obj.enrollments.filter(study__state=RUNNING).exists()
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

    @admin.display(description=_("leaderboards"))
    def boards_agreed(self, patient: Patient) -> Any:
        """Return the boards the patient has consented to, with a link to the consent page."""
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
