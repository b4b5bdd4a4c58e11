"""Receivers outside of GARRY, and the messages to them."""

from __future__ import annotations

import secrets
from base64 import b64encode
from collections.abc import Mapping
from datetime import datetime
from typing import Any, ClassVar
from urllib.parse import urlsplit

from django.core.exceptions import ValidationError
from django.db import models
from django.utils.translation import gettext_lazy as _

from rehab.people.models import Clinic
from rehab.people.scope import ClinicModel, Scope
from rehab.people.server_keys import Purpose, decrypt_text, encrypt_text

SECRET_BYTES = 32  # Standard Webhooks asks for 24 to 64
MAX_ANSWER_CHARS = 500


class Topic(models.TextChoices):
    """What receivers are notified of."""

    SESSION = "session.ended", _("a session ended")
    FALL = "patient.fall", _("a patient fell")
    INCIDENT = "robot.incident", _("a robot stopped by itself")
    BACKUP = "backup.failed", _("a backup failed")
    EXPORT = "export.ready", _("an export is ready")


class Endpoint(ClinicModel):
    """A program that a clinic notifies, by signed webhooks or FHIR.

    ``secret``: what signs webhooks, or the token that a FHIR server asks for; encrypted.
    """

    class Kind(models.TextChoices):
        """How it is told."""

        WEBHOOK = "webhook", _("Webhook (Standard Webhooks)")
        FHIR = "fhir", _("FHIR R4 server: sessions")

    scope = Scope(clinic="clinic")

    clinic = models.ForeignKey(
        Clinic, on_delete=models.CASCADE, related_name="endpoints", verbose_name=_("clinic")
    )
    name = models.CharField(_("name"), max_length=64)
    kind = models.CharField(_("kind"), max_length=8, choices=Kind.choices, default=Kind.WEBHOOK)
    url = models.CharField(
        _("address"),
        max_length=400,
        help_text=_("https://…; addresses within a network only where the host allows them."),
    )
    wants_sessions = models.BooleanField(Topic.SESSION.label, default=True)
    wants_falls = models.BooleanField(Topic.FALL.label, default=True)
    wants_incidents = models.BooleanField(Topic.INCIDENT.label, default=True)
    wants_backups = models.BooleanField(Topic.BACKUP.label, default=True)
    wants_exports = models.BooleanField(Topic.EXPORT.label, default=True)
    active = models.BooleanField(_("active"), default=True)
    secret = models.TextField(editable=False)
    created_at = models.DateTimeField(_("created at"), auto_now_add=True)

    class Meta(ClinicModel.Meta):
        verbose_name = _("receiver")
        verbose_name_plural = _("receivers")
        ordering: ClassVar = ["name"]

    def __str__(self) -> str:
        return self.name

    def clean(self) -> None:
        """Refuse what is no address, and one with a password, which lists and logs would show."""
        try:
            place = urlsplit(self.url or "")
            is_address = place.scheme in ("http", "https") and bool(place.hostname)
        except ValueError:
            is_address = False
        if not is_address:
            raise ValidationError({"url": _("An address begins with https://.")})
        if "@" in place.netloc:
            raise ValidationError({"url": _("Give the address without a name and password.")})

    def wants(self, topic: Topic) -> bool:
        """Return whether it wants to know something. A FHIR server gets sessions."""
        if self.kind == self.Kind.FHIR:
            return topic is Topic.SESSION
        return bool(getattr(self, f"wants_{topic.name.lower()}s"))

    def new_secret(self) -> str:
        """Set and return a new secret for signatures."""
        secret = f"whsec_{b64encode(secrets.token_bytes(SECRET_BYTES)).decode()}"
        self.store_secret(secret)
        return secret

    def store_secret(self, secret: str) -> None:
        """Set the secret, encrypted with this server's key."""
        self.secret = encrypt_text(Purpose.RECEIVERS, secret)

    def open_secret(self) -> str:
        """Return the secret. Raises InvalidToken where the server has another key now."""
        return decrypt_text(Purpose.RECEIVERS, self.secret) if self.secret else ""


def new_key() -> str:
    """Return the key of a new message."""
    return f"msg_{secrets.token_hex(16)}"


class OutboxMessage(ClinicModel):
    """One message to one receiver. ``body`` names rows by their keys, and never a patient."""

    class State(models.TextChoices):
        """What became of it."""

        WAITING = "waiting", _("waiting")
        DELIVERED = "delivered", _("delivered")
        REFUSED = "refused", _("refused")

    scope = Scope(clinic="clinic")

    clinic = models.ForeignKey(
        Clinic, on_delete=models.CASCADE, related_name="+", verbose_name=_("clinic")
    )
    endpoint = models.ForeignKey(
        Endpoint, on_delete=models.CASCADE, related_name="messages", verbose_name=_("receiver")
    )
    key = models.CharField(_("number"), max_length=64, unique=True, default=new_key)
    topic = models.CharField(_("what"), max_length=32, choices=Topic.choices)
    body = models.JSONField(_("content"))
    at = models.DateTimeField(_("at"))
    due_at = models.DateTimeField(_("next attempt"))
    attempts = models.PositiveSmallIntegerField(_("attempts"), default=0)
    state = models.CharField(
        _("state"), max_length=16, choices=State.choices, default=State.WAITING
    )
    answer = models.CharField(_("last answer"), max_length=MAX_ANSWER_CHARS, blank=True)

    class Meta(ClinicModel.Meta):
        verbose_name = _("message to a receiver")
        verbose_name_plural = _("messages to receivers")
        ordering: ClassVar = ["-at", "-pk"]
        indexes: ClassVar = [
            models.Index(
                fields=["due_at"], condition=models.Q(state="waiting"), name="waiting_message"
            )
        ]

    def __str__(self) -> str:
        return self.key

    def send_again(self, now: datetime) -> None:
        """Let it be sent again, under its old key: receivers know what they have."""
        self.state, self.due_at, self.attempts = self.State.WAITING, now, 0
        self.save(update_fields=["state", "due_at", "attempts"])


def notify(clinic_id: int, topic: Topic, about: Mapping[str, Any], at: datetime) -> None:
    """Store a message for each receiver that wants to know.

    In the transaction of what it reports: both are stored, or neither.
    """
    OutboxMessage.everywhere.bulk_create(
        OutboxMessage(
            clinic_id=clinic_id, endpoint=one, topic=topic, body=dict(about), at=at, due_at=at
        )
        for one in Endpoint.everywhere.filter(clinic=clinic_id, active=True)
        if one.wants(topic)
    )
