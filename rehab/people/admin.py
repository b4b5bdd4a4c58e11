"""Admin of clinics, accounts and patients."""

from __future__ import annotations

from typing import Any

from django.contrib import admin
from django.contrib.auth.admin import UserAdmin
from django.contrib.auth.forms import AdminUserCreationForm
from django.contrib.auth.models import Group
from django.core.exceptions import ValidationError
from django.http import HttpRequest

from rehab.people.access import person
from rehab.people.admin_base import ScopedAdmin, ScopedOptions, rights
from rehab.people.models import Clinic, Patient, User
from rehab.people.roles import Role

admin.site.site_header = "GARRY"
admin.site.site_title = "GARRY"
admin.site.index_title = "Clinic"
admin.site.unregister(Group)  # rights come from roles


@admin.register(Clinic)
class ClinicAdmin(ScopedAdmin):
    """Clinics: the host adds them, a lead keeps the details of the own one."""

    list_display = ("name", "language", "time_zone")
    fields = ("name", "language", "time_zone")


class NewAccountForm(AdminUserCreationForm):
    """Django's form for a new account; names are taken server-wide."""

    class Meta(AdminUserCreationForm.Meta):
        model = User

    def clean_username(self) -> str:
        """Refuse a name that any account has."""
        username: str = self.cleaned_data["username"]
        if User.is_taken(username):
            raise ValidationError("This name is taken. Choose another one.")
        return username


@admin.register(User)
class AccountAdmin(ScopedOptions, UserAdmin):
    """Accounts: a lead keeps those of the own clinic, a host all of them."""

    list_display = ("username", "first_name", "last_name", "role", "clinic", "is_active")
    list_filter = ("role", "is_active")
    add_form = NewAccountForm
    filter_horizontal = ()
    ordering = ("username",)

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
            ("Person", {"fields": ("first_name", "last_name", "email")}),
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


@admin.register(Patient)
class PatientAdmin(ScopedAdmin):
    """Patients of the clinic."""

    list_display = ("nickname", "code", "paretic_side", "language", "created_at")
    list_filter = ("paretic_side", "language")
    search_fields = ("nickname", "code")
    readonly_fields = ("pseudonym", "created_at")
    fields = (
        "code",
        "nickname",
        "body_mass_kg",
        "paretic_side",
        "language",
        "pseudonym",
        "created_at",
    )
