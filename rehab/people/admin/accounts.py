"""Admin of accounts."""

from __future__ import annotations

from typing import Any

from django.contrib import admin, messages
from django.contrib.admin.utils import unquote
from django.contrib.auth.admin import UserAdmin
from django.contrib.auth.forms import (
    AdminUserCreationForm,
    ReadOnlyPasswordHashField,
    UserChangeForm,
)
from django.core.exceptions import ValidationError
from django.db import transaction
from django.db.models import QuerySet
from django.http import HttpRequest, HttpResponse
from django.shortcuts import redirect
from django.utils import timezone
from django.utils.translation import gettext
from django.utils.translation import gettext_lazy as _

from rehab.people.access import user_of
from rehab.people.audit.audit_log import Act, record_security_change
from rehab.people.models import User
from rehab.people.roles import Role
from rehab.people.sign_in import attempt_counter, resets
from rehab.people.sign_in.factors import factors
from rehab.people.web.admin_base import ScopedOptions, TrackedAdmin, asks_who_it_is, rights_for
from rehab.people.web.row_forms import with_values


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


class AccountForm(UserChangeForm):
    """Django's form of an account, without its sentence about how passwords are stored."""

    password = ReadOnlyPasswordHashField(label=_("Password"))

    class Meta(UserChangeForm.Meta):
        help_texts = {
            "username": "",
            "is_active": _("Untick to stop this person signing in. Do not delete the account."),
        }


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
    form = AccountForm
    add_form = NewAccountForm
    filter_horizontal = ()
    ordering = ("username",)
    actions = ("unlock", "remove_second_factors")

    @admin.action(description=_("Unlock after too many wrong tries"), permissions=["change"])
    def unlock(self, request: HttpRequest, accounts: QuerySet[User]) -> None:
        """End the lockouts of the chosen accounts."""
        for account in accounts:
            with transaction.atomic():
                record_security_change(Act.UNLOCK, request, account, timezone.now())
                attempt_counter.forget_all(account)
        message = gettext("Accounts that may try again: %(count)s.")
        messages.success(request, message % {"count": accounts.count()})

    @admin.action(
        description=_("Remove second factors (lost phone or key)"), permissions=["change"]
    )
    @asks_who_it_is
    def remove_second_factors(self, request: HttpRequest, accounts: QuerySet[User]) -> None:
        """Remove all second factors of the chosen accounts, but not one's own."""
        removed = 0
        for account in accounts:
            if not self._may_reset(request, account):
                continue
            removed += 1
            with transaction.atomic():
                record_security_change(Act.FACTORS, request, account, timezone.now())
                factors.remove_second_factors(account)
        message = gettext(
            "%(count)s account(s) sign in by password alone now, or set up a new second "
            "factor where the clinic asks for one. If a phone was stolen, give a new password too."
        )
        if removed:
            messages.warning(request, message % {"count": removed})

    @asks_who_it_is
    def changeform_view(
        self,
        request: HttpRequest,
        object_id: str | None = None,
        form_url: str = "",
        extra_context: Any = None,
    ) -> HttpResponse:
        """Show an account or the form of a new one, which could let a stranger stay in: ask."""
        return super().changeform_view(request, object_id, form_url, extra_context)

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
        return self._change_password_of_other(request, id, account, form_url)

    @asks_who_it_is
    def _change_password_of_other(
        self, request: HttpRequest, key: str, account: Any, form_url: str
    ) -> HttpResponse:
        sent = request.method == "POST"
        if sent and account is not None and not self._may_reset(request, account):
            return redirect("admin:rehab_user_change", account.pk)
        return super().user_change_password(request, key, form_url)

    def _may_reset(self, request: HttpRequest, account: User) -> bool:
        """Return whether this person may reset how an account signs in; where not, say why."""
        user = user_of(request)
        if account.pk == user.pk:
            messages.error(request, gettext("Change your own on the page Your account."))
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
            return [(None, {"fields": ("username", *passwords, *role_fields, "is_service")})]
        service = ("is_service",) if obj.is_service else ()
        return [
            (None, {"fields": ("username", "password", *role_fields, *service, "is_active")}),
            (_("Person"), {"fields": ("first_name", "last_name", "email")}),
        ]

    def get_readonly_fields(self, request: HttpRequest, obj: Any = None) -> Any:
        """Return the fixed fields: a program's account never becomes a person's."""
        return () if obj is None else ("is_service",)

    def get_form(
        self, request: HttpRequest, obj: Any = None, change: bool = False, **kwargs: Any
    ) -> Any:
        """Return the form; a lead's new account belongs to the lead's own clinic."""
        form: Any = super().get_form(request, obj, change=change, **kwargs)
        clinic_id = user_of(request).clinic_id
        return form if clinic_id is None else with_values(form, clinic_id=clinic_id)

    def formfield_for_choice_field(self, db_field: Any, request: HttpRequest, **kwargs: Any) -> Any:
        """Offer the roles that this person may assign: only a host creates hosts."""
        if db_field.name == "role" and user_of(request).role != Role.HOST:
            kwargs["choices"] = [choice for choice in Role.choices if choice[0] != Role.HOST]
        if db_field.name == "role":
            kwargs["help_text"] = _(
                "A lead runs the clinic: accounts, stations, consent. A physical therapist trains "
                "patients. A researcher sees sessions without names. A sponsor sees studies alone."
            )
        return super().formfield_for_choice_field(db_field, request, **kwargs)
