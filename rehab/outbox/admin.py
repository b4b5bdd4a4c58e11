"""Admin of receivers, and of the messages to them."""

from __future__ import annotations

from typing import Any

from django import forms
from django.contrib import admin, messages
from django.db.models import QuerySet
from django.http import HttpRequest, HttpResponse
from django.utils import timezone
from django.utils.formats import localize
from django.utils.translation import gettext
from django.utils.translation import gettext_lazy as _

from rehab.outbox.models import Endpoint, OutboxMessage
from rehab.people.web.admin_base import ScopedAdmin, asks_who_it_is
from rehab.people.web.row_forms import ClinicForm
from rehab.people.web.token_admin import show_once

WANTS = ("wants_sessions", "wants_falls", "wants_incidents", "wants_backups", "wants_exports")


class EndpointForm(ClinicForm):
    """A receiver, with the token that a FHIR server asks for."""

    token = forms.CharField(
        label=_("Token of the FHIR server"),
        required=False,
        widget=forms.PasswordInput,
        help_text=_("Sent as a Bearer token; empty to leave it as it is."),
    )

    def clean_token(self) -> str:
        """Return the token; a stored one, which nobody sees, is sent to no other address."""
        token: str = self.cleaned_data["token"]
        row = self.instance
        if (
            row.kind == Endpoint.Kind.FHIR
            and row.secret
            and "url" in self.changed_data
            and not token
        ):
            raise forms.ValidationError(_("For another address give the token again."))
        return token


@admin.register(Endpoint)
class EndpointAdmin(ScopedAdmin):
    """Receivers of a clinic; the secret that signs is shown once, when it is made."""

    form = EndpointForm
    list_display = ("name", "kind", "url", "active")
    actions = row_actions = ("renew_secrets",)

    def get_readonly_fields(self, request: HttpRequest, obj: Any = None) -> Any:
        """Return the fixed fields: another kind is another receiver."""
        return () if obj is None else ("kind",)

    def get_fieldsets(self, request: HttpRequest, obj: Any = None) -> Any:
        """Return the fields of its kind; of a new receiver, those of all kinds."""
        kind = obj and obj.kind
        token = () if kind == Endpoint.Kind.WEBHOOK else ("token",)
        told = (_("A webhook is told when"), {"fields": WANTS})
        main = (None, {"fields": ("name", "kind", "url", *token, "active")})
        return (main,) if kind == Endpoint.Kind.FHIR else (main, told)

    @asks_who_it_is
    def changeform_view(self, *args: Any, **kwargs: Any) -> HttpResponse:
        """Show a receiver, to which data go; ask for the password."""
        return super().changeform_view(*args, **kwargs)

    def save_model(self, request: HttpRequest, obj: Any, form: Any, change: bool) -> None:
        """Save the row; a new one gets a secret."""
        token = form.cleaned_data.get("token")
        if obj.kind == Endpoint.Kind.FHIR:
            if token:
                obj.store_secret(token)
        elif not change:
            obj.shown_secret = obj.new_secret()
        super().save_model(request, obj, form, change)

    def response_add(self, request: HttpRequest, obj: Any, *args: Any, **kwargs: Any) -> Any:
        """Show the secret of a new receiver."""
        if secret := getattr(obj, "shown_secret", ""):
            return show_once(self, request, [(obj, secret)], gettext("New secrets"), is_kept=True)
        return super().response_add(request, obj, *args, **kwargs)

    @admin.action(description=_("Give new secrets (old ones stop at once)"), permissions=["change"])
    @asks_who_it_is
    def renew_secrets(self, request: HttpRequest, rows: QuerySet[Endpoint]) -> HttpResponse | None:
        """Replace what signs the messages to the chosen webhooks, and show it."""
        issued = [(row, row.new_secret()) for row in rows.filter(kind=Endpoint.Kind.WEBHOOK)]
        if not issued:
            messages.error(request, gettext("A FHIR server’s token is its own: type it there."))
            return None
        for row, _secret in issued:
            row.save(update_fields=["secret"])
        return show_once(self, request, issued, gettext("New secrets"), is_kept=True)


@admin.register(OutboxMessage)
class OutboxMessageAdmin(ScopedAdmin):
    """What was sent, and what waits or was refused."""

    list_display = ("at", "endpoint", "topic", "state", "next_at", "answer")
    list_filter = ("state", "topic")
    list_select_related = ("endpoint",)
    actions = row_actions = viewer_actions = ("send_again",)

    readonly_fields = ("next_at",)
    fields = ("endpoint", "topic", "body", "at", "state", "attempts", "next_at", "answer", "key")

    @admin.display(description=_("next attempt"))
    def next_at(self, row: OutboxMessage) -> str:
        """Return when a message that waits is sent again."""
        is_waiting = row.state == OutboxMessage.State.WAITING
        return str(localize(timezone.localtime(row.due_at))) if is_waiting else "–"

    @admin.action(description=_("Send again"), permissions=["view"])
    def send_again(self, request: HttpRequest, rows: QuerySet[OutboxMessage]) -> None:
        """Let the chosen messages be sent again."""
        for row in rows:
            row.send_again(timezone.now())
        messages.success(request, gettext("They are sent again."))
