"""Admin of API tokens."""

from __future__ import annotations

from typing import Any

from django.contrib import admin
from django.http import HttpRequest

from rehab.people.access import user_of
from rehab.people.sign_in.tokens import ApiToken
from rehab.people.web.row_forms import with_values
from rehab.people.web.token_admin import TokenAdmin


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
        return with_values(form, user_id=user_of(request).pk)

    def may_issue(self, request: HttpRequest, holder: Any) -> bool:
        """Return whether this person may have the token: it is the own one."""
        return bool(holder.user_id == user_of(request).pk)
