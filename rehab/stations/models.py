"""Stations: places with a tablet, a source and a robot, and the devices that dial in from them."""

from __future__ import annotations

import hashlib
import secrets
from datetime import timedelta
from typing import ClassVar

from django.db import models
from django.utils import timezone

from rehab.people.models import Clinic
from rehab.people.scope import ClinicRow, Scope, ScopedModel

# 256 random bits: nothing to guess, so a fast hash keeps the token as safe as a slow one would.
TOKEN_BYTES = 32
SEEN_EVERY = timedelta(minutes=1)  # so exactly is it known when a device was last here


class Station(ClinicRow):
    """A place in a clinic with its tablet, source and robot."""

    scope = Scope(clinic="clinic", station="pk")

    clinic = models.ForeignKey(Clinic, on_delete=models.PROTECT, related_name="stations")
    name = models.CharField(max_length=64)

    class Meta(ClinicRow.Meta):
        ordering: ClassVar = ["name"]
        constraints: ClassVar = [
            models.UniqueConstraint(fields=["clinic", "name"], name="station_name_once_per_clinic")
        ]

    def __str__(self) -> str:
        return self.name


def hash_token(token: str) -> str:
    """Give the only form of a token that is ever stored."""
    return hashlib.sha256(token.encode()).hexdigest()


class Device(ClinicRow):
    """A tablet, source or robot that dials in with its token and sees its own station only."""

    class Kind(models.TextChoices):
        """What a device does."""

        SOURCE = "source", "Source of steps"
        TABLET = "tablet", "Tablet"
        ROBOT = "robot", "Robot"

    actor_kind = "device"
    scope = Scope(clinic="clinic")

    clinic = models.ForeignKey(Clinic, on_delete=models.PROTECT, related_name="devices")
    station = models.ForeignKey(Station, on_delete=models.CASCADE, related_name="devices")
    kind = models.CharField(max_length=16, choices=Kind.choices)
    name = models.CharField(max_length=64)
    builtin = models.BooleanField(
        default=False, editable=False, help_text="The server runs it itself."
    )
    token_hash = models.CharField(max_length=64, unique=True, editable=False)
    created_at = models.DateTimeField(auto_now_add=True)
    last_seen_at = models.DateTimeField(null=True, blank=True, editable=False)
    revoked_at = models.DateTimeField(null=True, blank=True, editable=False)

    class Meta(ClinicRow.Meta):
        ordering: ClassVar = ["station", "kind", "name"]

    def __str__(self) -> str:
        return f"{self.name} ({self.get_kind_display()})"

    @property
    def is_revoked(self) -> bool:
        """Whether the token no longer opens anything."""
        return self.revoked_at is not None

    def new_token(self) -> str:
        """Give the device a new token; the old one is dead once the device is saved.

        The token is returned this one time and never stored.
        """
        token = secrets.token_urlsafe(TOKEN_BYTES)
        self.token_hash = hash_token(token)
        return token


class Pairing(ScopedModel):
    """A tablet that shows a code and waits for somebody to approve it. Nobody's until then."""

    scope = Scope(clinic="device__clinic")

    code = models.CharField(max_length=8, unique=True)
    secret_hash = models.CharField(max_length=64, unique=True)
    expires_at = models.DateTimeField()
    device = models.ForeignKey(Device, on_delete=models.CASCADE, related_name="+", null=True)

    class Meta(ScopedModel.Meta):
        pass

    def __str__(self) -> str:
        return "Pairing"


def find_device(token: str) -> Device | None:
    """Give the device that this token belongs to; None for an unknown or revoked one."""
    device = Device.everywhere.filter(token_hash=hash_token(token), revoked_at__isnull=True).first()
    if device is not None:
        now = timezone.now()
        if device.last_seen_at is None or now - device.last_seen_at > SEEN_EVERY:
            Device.everywhere.filter(pk=device.pk).update(last_seen_at=now)
    return device
