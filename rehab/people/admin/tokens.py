"""Admin of API tokens."""

from __future__ import annotations

from typing import Any

from django.contrib import admin
from django.http import HttpRequest

from rehab.people.access import user_of
from rehab.people.models import User
from rehab.people.sign_in.tokens import ApiToken, service_accounts
from rehab.people.web.row_forms import with_values
from rehab.people.web.token_admin import TokenAdmin


@admin.register(ApiToken)
class ApiTokenAdmin(TokenAdmin):
    """API tokens of programs: the own ones, and those of service accounts; a lead revokes any."""

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
            is_chosen = service_accounts(user_of(request)).exists()
            return TokenAdmin.readonly_fields if is_chosen else self.readonly_fields
        return tuple(name for name in self.fields if name != "name")

    def formfield_for_foreignkey(self, db_field: Any, request: HttpRequest, **kwargs: Any) -> Any:
        """Offer the own account and those of programs."""
        if db_field.name == "user":
            own = User.everywhere.filter(pk=user_of(request).pk)
            kwargs |= {"queryset": own | service_accounts(user_of(request)), "initial": own.get()}
        return super().formfield_for_foreignkey(db_field, request, **kwargs)

    def get_form(
        self, request: HttpRequest, obj: Any = None, change: bool = False, **kwargs: Any
    ) -> Any:
        """Return the form; a new token speaks for whoever makes it, unless another is chosen."""
        form: Any = super().get_form(request, obj, change=change, **kwargs)
        return with_values(form, user_id=user_of(request).pk)

    def may_issue(self, request: HttpRequest, holder: Any) -> bool:
        """Return whether this person may have the token: the own one, or a service account's."""
        user = user_of(request)
        return (
            holder.user_id == user.pk or service_accounts(user).filter(pk=holder.user_id).exists()
        )
