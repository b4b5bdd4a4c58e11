"""Base class of the admin of rows with a token."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar

from django.contrib import admin, messages
from django.db.models import QuerySet
from django.http import HttpRequest, HttpResponse
from django.template.response import TemplateResponse
from django.utils import timezone
from django.utils.translation import gettext, ngettext
from django.utils.translation import gettext_lazy as _

from rehab.people.sign_in.tokens import TokenModel, renew_token
from rehab.people.web.admin_base import ScopedAdmin, asks_who_it_is


def show_once(
    options: ScopedAdmin,
    request: HttpRequest,
    issued: Sequence[tuple[Any, str]],
    title: str,
    *,
    is_kept: bool = False,
) -> HttpResponse:
    """Show secrets of rows, this one time; ``is_kept``: the server has more than their hashes."""
    context = {
        **options.admin_site.each_context(request),
        "title": title,
        "opts": options.opts,
        "issued": issued,
        "is_kept": is_kept,
    }
    return TemplateResponse(request, "admin/new_tokens.html", context)


class TokenAdmin(ScopedAdmin):
    """Pages of rows with a token, which is shown once, when it is issued."""

    readonly_fields: ClassVar[tuple[str, ...]] = ("created_at", "last_seen_at", "revoked_at")
    actions = row_actions = ("renew_tokens", "revoke_tokens")
    row_words: ClassVar[dict[str, Any]] = {"renew_tokens": _("New key: the old one stops at once")}

    @asks_who_it_is
    def add_view(
        self, request: HttpRequest, form_url: str = "", extra_context: Any = None
    ) -> HttpResponse:
        """Show the form of a new row, whose token speaks for somebody; ask for the password."""
        return super().add_view(request, form_url, extra_context)

    def may_issue(self, request: HttpRequest, holder: Any) -> bool:
        """Return whether this person may be shown a new token of a row."""
        return True

    def save_model(self, request: HttpRequest, obj: Any, form: Any, change: bool) -> None:
        """Save the row, a new one with a token."""
        if not change:
            obj.token = obj.new_token()
            obj.note_issuer(request.user, timezone.now())
        super().save_model(request, obj, form, change)

    def response_add(self, request: HttpRequest, obj: Any, *args: Any, **kwargs: Any) -> Any:
        """Show the token of a new row."""
        return self._show_tokens(request, [(obj, obj.token)])

    @admin.action(description=_("Give new tokens (old ones stop at once)"), permissions=["change"])
    @asks_who_it_is
    def renew_tokens(self, request: HttpRequest, holders: QuerySet[Any]) -> HttpResponse | None:
        """Replace the tokens of the chosen rows, and show the new ones; ask for the password."""
        if not all(self.may_issue(request, holder) for holder in holders):
            messages.error(request, gettext("Only its own person gives a program a new token."))
            return None
        now = timezone.now()
        return self._show_tokens(
            request, [(row, renew_token(row, request, now)) for row in holders]
        )

    @admin.action(description=_("Revoke tokens"), permissions=["change"])
    @asks_who_it_is
    def revoke_tokens(self, request: HttpRequest, holders: QuerySet[Any]) -> None:
        """Revoke the tokens of the chosen rows; ask for the password."""
        valid = list(holders.filter(revoked_at__isnull=True))
        for holder in valid:  # one by one, so that the change history records each
            holder.revoked_at = timezone.now()
            holder.save(update_fields=["revoked_at"])
        message = ngettext("%(count)d token revoked.", "%(count)d tokens revoked.", len(valid))
        messages.success(request, message % {"count": len(valid)})

    def _show_tokens(
        self, request: HttpRequest, issued: list[tuple[TokenModel, str]]
    ) -> HttpResponse:
        """Show new tokens in the answer itself: a message would keep them in a cookie."""
        return show_once(self, request, issued, gettext("New tokens"))
