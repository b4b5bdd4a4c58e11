"""Stations: places with a tablet, a source and a robot, and the devices that connect from them."""

from __future__ import annotations

from datetime import datetime, timedelta
from typing import ClassVar

from django.db import models
from django.utils import timezone
from django.utils.translation import gettext_lazy as _

from rehab.people.models import Clinic, User
from rehab.people.networks import is_outside
from rehab.people.scope import ClinicModel, Scope, ScopedModel
from rehab.people.sign_in.tokens import TokenModel

WORN_LIFETIME = timedelta(hours=12)  # of the token of a sensor that is worn: a day in the clinic


class Station(ClinicModel):
    """A place in a clinic with its tablet, source and robot."""

    scope = Scope(clinic="clinic", station="pk")

    clinic = models.ForeignKey(
        Clinic, on_delete=models.PROTECT, related_name="stations", verbose_name=_("clinic")
    )
    name = models.CharField(_("name"), max_length=64)
    # The latest order to its robot, of any session's log: stop, until a person arms it.
    robot_stopped = models.BooleanField(_("robot stopped"), default=False, editable=False)
    pin_hash = models.CharField(max_length=128, blank=True, editable=False)

    class Meta(ClinicModel.Meta):
        verbose_name = _("station")
        verbose_name_plural = _("stations")
        ordering: ClassVar = ["name"]
        constraints: ClassVar = [
            models.UniqueConstraint(fields=["clinic", "name"], name="station_name_once_per_clinic")
        ]

    def __str__(self) -> str:
        return self.name


class Device(TokenModel):
    """A tablet, source or robot. It connects with its token and sees its own station only."""

    class Kind(models.TextChoices):
        """The kind of device."""

        SOURCE = "source", _("Sensor")
        TABLET = "tablet", _("Tablet")
        ROBOT = "robot", _("Robot")

    actor_kind = "device"
    scope = Scope(clinic="clinic")
    is_trusted: bool | None = None  # where a query says it (device_trust.with_trust)

    clinic = models.ForeignKey(
        Clinic, on_delete=models.PROTECT, related_name="devices", verbose_name=_("clinic")
    )
    station = models.ForeignKey(
        Station, on_delete=models.CASCADE, related_name="devices", verbose_name=_("station")
    )
    kind = models.CharField(_("kind"), max_length=16, choices=Kind.choices)
    name = models.CharField(_("name"), max_length=64)
    builtin = models.BooleanField(
        _("built in"), default=False, editable=False, help_text=_("The server runs it itself.")
    )
    # Of a sensor that is worn: on which leg, and where; "" of any other.
    side = models.CharField(_("leg"), max_length=8, blank=True, editable=False)
    place = models.CharField(_("place"), max_length=8, blank=True, editable=False)
    # What it gets in place of its token, and what it had before (``tokens``).
    successor_hash = models.CharField(max_length=64, blank=True, editable=False, db_index=True)
    retired_hash = models.CharField(max_length=64, blank=True, editable=False, db_index=True)
    rotated_at = models.DateTimeField(_("token changed by itself"), null=True, editable=False)
    token_expires_at = models.DateTimeField(_("valid until"), null=True, editable=False)
    copy_seen_at = models.DateTimeField(_("old token seen"), null=True, editable=False)

    # Who let a tablet or phone in (``device_trust``), and what a tablet was then.
    approver = models.ForeignKey(
        User,
        on_delete=models.SET_NULL,
        related_name="+",
        null=True,
        editable=False,
        verbose_name=_("let in by"),
    )
    approved_at = models.DateTimeField(_("let in at"), null=True, editable=False)
    network = models.CharField(_("network"), max_length=45, blank=True, editable=False)
    browser = models.CharField(_("browser"), max_length=32, blank=True, editable=False)

    # Of a tablet's screen: CSS pixels a millimeter, and from how far the patient reads it.
    screen_px_per_mm = models.FloatField(_("pixels a millimeter"), null=True, editable=False)
    screen_distance_m = models.FloatField(_("viewing distance"), default=1.5, editable=False)

    address = ""  # from which this object's holder connects
    given_hash = ""  # of the successor that this object's holder was given

    class Meta(TokenModel.Meta):
        verbose_name = _("device")
        verbose_name_plural = _("devices")
        ordering: ClassVar = ["station", "kind", "name"]

    def __str__(self) -> str:
        return f"{self.name} ({self.get_kind_display()})"

    def has_expired(self, now: datetime) -> bool:
        """Return whether its token was valid until then."""
        return self.token_expires_at is not None and self.token_expires_at <= now

    @property
    def is_away(self) -> bool:
        """Return whether it is outside its clinic's networks, or nobody knows where."""
        return is_outside(self.clinic.networks, self.address)

    @property
    def is_let_in(self) -> bool:
        """Return whether a person answers for it: a tablet, a phone, what a person tries."""
        return self.kind == self.Kind.TABLET or bool(self.place) or self.approver_id is not None

    def note_issuer(self, by: User | None, now: datetime) -> None:
        """Make the person who gives a tablet or phone its token the one who answers for it."""
        if self.is_let_in:
            self.approver, self.approved_at, self.last_seen_at = by, now, None

    def new_token(self) -> str:
        """Set and return a new token, as if there had been none before."""
        self.successor_hash = self.retired_hash = self.given_hash = ""
        self.rotated_at = self.token_expires_at = self.copy_seen_at = None
        if self.is_let_in and self.kind != self.Kind.TABLET:
            self.token_expires_at = timezone.now() + WORN_LIFETIME
        return super().new_token()


class Pairing(ScopedModel):
    """A tablet that shows a code and waits for approval. Until then it belongs to no clinic."""

    scope = Scope(clinic="device__clinic")

    code = models.CharField(max_length=8, unique=True)
    secret_hash = models.CharField(max_length=64, unique=True)
    expires_at = models.DateTimeField()
    address = models.CharField(max_length=45, blank=True)  # of the tablet, and its browser
    browser = models.CharField(max_length=32, blank=True)
    device = models.ForeignKey(Device, on_delete=models.CASCADE, related_name="+", null=True)

    class Meta(ScopedModel.Meta):
        pass

    def __str__(self) -> str:
        return "Pairing"


class PinAttempts(ScopedModel):
    """Failed PIN attempts of one screen at one station, and its lockout (see ``pins``)."""

    scope = Scope(clinic="station__clinic")

    station = models.ForeignKey(
        Station, on_delete=models.CASCADE, related_name="+", verbose_name=_("station")
    )
    screen = models.CharField(max_length=64)
    failures = models.PositiveIntegerField(default=0)
    locked_until = models.DateTimeField()

    class Meta(ScopedModel.Meta):
        constraints: ClassVar = [
            models.UniqueConstraint(
                fields=["station", "screen"], name="pin_attempts_once_per_screen"
            )
        ]

    def __str__(self) -> str:
        return "PIN attempts"
