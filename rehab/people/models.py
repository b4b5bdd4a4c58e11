"""Clinics, the people who work there, and the patients who walk."""

from __future__ import annotations

import secrets
from typing import Any, ClassVar
from zoneinfo import available_timezones

from django.conf import settings
from django.contrib.auth.base_user import BaseUserManager
from django.contrib.auth.models import AbstractUser, UserManager
from django.core.exceptions import NON_FIELD_ERRORS, ValidationError
from django.core.validators import MaxValueValidator, MinValueValidator
from django.db import models, transaction
from django.db.models import Q
from django.utils.translation import gettext_lazy as _

from rehab.people.aliases import draw_alias
from rehab.people.networks import check_networks
from rehab.people.roles import Role
from rehab.people.scope import ClinicRow, Scope, ScopedManager, ScopedModel
from rehab.training.steps import Side

SIDES = [(Side.LEFT.value, _("Left")), (Side.RIGHT.value, _("Right"))]
LANGUAGES = settings.LANGUAGES
# Neither 0 and O nor 1, I and L: read aloud and typed without doubt.
UNAMBIGUOUS = "23456789ABCDEFGHJKMNPQRSTUVWXYZ"


def check_time_zone(name: str) -> None:
    """Refuse a name that is no time zone."""
    if name not in available_timezones():
        raise ValidationError(
            _("“%(name)s” is no time zone. Give a name such as Europe/Madrid."),
            params={"name": name},
        )


class Clinic(ScopedModel):
    """A place of care. Whatever belongs to it is seen by its own people alone."""

    scope = Scope(clinic="pk", host=Q())

    name = models.CharField(_("name"), max_length=100, unique=True)
    time_zone = models.CharField(
        _("time zone"), max_length=64, default="UTC", validators=[check_time_zone]
    )
    language = models.CharField(_("language"), max_length=8, choices=LANGUAGES, default="en")
    boards_across = models.BooleanField(
        _("boards across clinics"),
        default=False,
        help_text=_(
            "Patients who agree may stand, by their animal names, on boards with patients "
            "of other clinics."
        ),
    )
    second_factor_required = models.BooleanField(
        _("second factor required"),
        default=False,
        help_text=_(
            "Everybody who works here signs in with an app or a passkey besides the "
            "password. Whoever has none is led to set one up first; you as well."
        ),
    )
    research_needs_consent = models.BooleanField(
        _("research needs consent"),
        default=True,
        help_text=_(
            "Researchers see the sessions of those patients only who have agreed to research."
        ),
    )
    care_needs_consent = models.BooleanField(
        _("care needs consent"),
        default=False,
        help_text=_("No session can be set up for a patient who has not agreed to care."),
    )
    networks = models.TextField(
        _("the clinic's own networks"),
        blank=True,
        max_length=1000,
        validators=[check_networks],
        help_text=_(
            "One a line, such as 192.168.1.0/24. From elsewhere a session is watched only with "
            "the patient's consent to remote view; say so in your words. Empty: from anywhere, and "
            "nobody is asked."
        ),
    )
    keep_months = models.PositiveSmallIntegerField(
        _("keep patients (months)"),
        null=True,
        blank=True,
        validators=[MinValueValidator(1), MaxValueValidator(1200)],
        help_text=_(
            "So long after the last session a patient's name, code and all that leads to the "
            "person are erased for good. Empty: never."
        ),
    )
    keep_log_months = models.PositiveSmallIntegerField(
        _("keep the logs (months)"),
        default=36,
        validators=[MinValueValidator(12), MaxValueValidator(1200)],
        help_text=_("How long it is kept who looked at, changed and took out what."),
    )
    created_at = models.DateTimeField(_("created at"), auto_now_add=True)

    class Meta(ScopedModel.Meta):
        verbose_name = _("clinic")
        verbose_name_plural = _("clinics")
        ordering: ClassVar = ["name"]

    def __str__(self) -> str:
        return self.name


class AccountManager(UserManager["User"]):
    """Creates accounts. `createsuperuser` makes a host: someone who runs the server."""

    def create_superuser(
        self,
        username: str,
        email: str | None = None,
        password: str | None = None,
        **extra_fields: Any,
    ) -> User:
        """Make a host account."""
        return self.create_user(username, email, password, **extra_fields | {"role": Role.HOST})


class VisibleAccounts(ScopedManager["User"], BaseUserManager["User"]):
    """Accounts by scope, with the helpers that Django's own account class asks of `objects`."""


class User(AbstractUser):
    """A person with an account. The role decides what the account may do."""

    actor_kind = "user"
    scope: ClassVar[Scope] = Scope(clinic="clinic", host=Q())

    clinic = models.ForeignKey(
        Clinic,
        on_delete=models.PROTECT,
        related_name="users",
        null=True,
        blank=True,
        verbose_name=_("clinic"),
    )
    role = models.CharField(_("role"), max_length=16, choices=Role.choices)
    language = models.CharField(
        _("language"),
        max_length=8,
        choices=LANGUAGES,
        blank=True,
        help_text=_("Of the pages that this account opens; empty: the clinic's."),
    )
    program = ""  # the name of the API token, where one speaks for this person

    everywhere = AccountManager()
    objects: ClassVar[VisibleAccounts] = VisibleAccounts()  # type: ignore[assignment]

    class Meta(AbstractUser.Meta):
        default_manager_name = "everywhere"
        base_manager_name = "everywhere"
        ordering: ClassVar = ["username"]
        constraints: ClassVar = [
            models.CheckConstraint(
                condition=Q(role=Role.HOST, clinic__isnull=True)
                | (~Q(role=Role.HOST) & Q(clinic__isnull=False)),
                name="user_clinic_fits_role",
                violation_error_message=_("A host has no clinic; every other role needs one."),
            ),
            models.CheckConstraint(condition=Q(role__in=Role.values), name="user_role_is_known"),
        ]

    def save(self, *args: Any, **kwargs: Any) -> None:
        """Save the account; Django's own flags follow the role."""
        self.is_staff = True  # every person works in the admin; what they see there is their role's
        self.is_superuser = False  # nobody passes by the table of roles
        super().save(*args, **kwargs)

    def __str__(self) -> str:
        return self.get_full_name() or self.username

    @classmethod
    def is_taken(cls, username: str) -> bool:
        """Whether an account of any clinic has this name, in capitals or not."""
        return cls.everywhere.filter(username__iexact=username).exists()


def new_pseudonym() -> str:
    """Make a name that says nothing about a patient."""
    return "P-" + "".join(secrets.choice(UNAMBIGUOUS) for _ in range(8))


class ScreenSide(models.TextChoices):
    """Where the patient's page has the thermometer; for neglect and lost fields of vision."""

    RIGHT = "right", _("on the right (usual)")
    LEFT = "left", _("on the left")
    CENTER = "center", _("all of it in the middle, smaller")


class ScreenText(models.TextChoices):
    """How large the patient's page writes."""

    NORMAL = "normal", _("normal")
    LARGE = "large", _("large")
    LARGEST = "largest", _("largest")


class Boards(models.TextChoices):
    """Which leaderboards a patient has agreed to stand on; each includes those before it."""

    OWN = "own", _("None: sees own sessions only")
    TOTAL = "total", _("Counts in totals, stands in no row")
    CLINIC = "clinic", _("Boards of this clinic")
    ACROSS = "across", _("Boards of this clinic and across clinics")


class Ending(models.TextChoices):
    """Why a patient's program has ended."""

    DONE = "done", _("The program is complete")
    WISH = "wish", _("The patient wishes to stop")
    HEALTH = "health", _("Health")
    MOVED = "moved", _("Goes on elsewhere")
    OTHER = "other", _("Another reason")


class Erasing(models.TextChoices):
    """Why all that leads to a patient was erased."""

    ASKED = "asked", _("The patient asks for it")
    MISTAKE = "mistake", _("Was entered by mistake")
    RETENTION = "retention", _("Kept long enough")


class PersonErased(ValidationError):
    """Words about a person whom nobody brings back."""

    def __init__(self) -> None:
        super().__init__({NON_FIELD_ERRORS: _("This person is erased. Take a new patient in.")})


class Patient(ClinicRow):
    """Someone who walks. The clinic's code and a nickname, never a full name."""

    scope = Scope(clinic="clinic")

    clinic = models.ForeignKey(
        Clinic, on_delete=models.PROTECT, related_name="patients", verbose_name=_("clinic")
    )
    code = models.CharField(
        _("code"),
        max_length=32,
        help_text=_("The clinic's own number for this patient, never a name."),
    )
    nickname = models.CharField(
        _("nickname"),
        max_length=32,
        help_text=_("What the screens say, so that patient and therapist can check."),
    )
    pseudonym = models.CharField(
        _("pseudonym"), max_length=16, unique=True, default=new_pseudonym, editable=False
    )
    body_mass_kg = models.FloatField(
        _("body mass (kg)"),
        null=True,
        blank=True,
        validators=[MinValueValidator(10), MaxValueValidator(300)],
        help_text=_("Needed when sensors send raw signals: A2 is power per kilogram."),
    )
    paretic_side = models.CharField(_("paretic side"), max_length=8, choices=SIDES, blank=True)
    language = models.CharField(_("language"), max_length=8, choices=LANGUAGES, default="en")
    screen_side = models.CharField(
        _("thermometer"), max_length=8, choices=ScreenSide.choices, default=ScreenSide.RIGHT
    )
    screen_text = models.CharField(
        _("size of words"), max_length=8, choices=ScreenText.choices, default=ScreenText.NORMAL
    )
    screen_still = models.BooleanField(
        _("calm page"), default=False, help_text=_("No confetti, and nothing moves but the level.")
    )
    screen_sounds = models.BooleanField(
        _("sounds"),
        default=False,
        help_text=_(
            "A soft tone a step, the higher the better; a second one for points. "
            "The patient can mute it on the page."
        ),
    )
    boards = models.CharField(
        _("leaderboards"),
        max_length=8,
        choices=Boards.choices,
        default=Boards.OWN,
        help_text=_("What the patient has agreed to. Taken back, it takes effect at once."),
    )
    alias = models.CharField(
        _("animal name"), max_length=32, unique=True, null=True, blank=True, editable=False
    )
    blinded = models.BooleanField(
        _("in a blinded study"),
        default=False,
        help_text=_("No leaderboards and no scores: the patient sees none and stands on none."),
    )
    simulated = models.BooleanField(_("simulated"), default=False, editable=False)
    original_id = models.BigIntegerField(
        null=True, editable=False, help_text=_("The participant of the original GARRY's database.")
    )
    created_at = models.DateTimeField(_("created at"), auto_now_add=True)
    ended_at = models.DateTimeField(_("program ended"), null=True, editable=False)
    ended_because = models.CharField(
        _("why it ended"), max_length=8, choices=Ending.choices, blank=True, editable=False
    )
    erased_at = models.DateTimeField(_("erased"), null=True, editable=False)
    erased_because = models.CharField(
        _("why it was erased"), max_length=9, choices=Erasing.choices, blank=True, editable=False
    )

    class Meta(ClinicRow.Meta):
        verbose_name = _("patient")
        verbose_name_plural = _("patients")
        ordering: ClassVar = ["nickname", "code"]
        constraints: ClassVar = [
            models.UniqueConstraint(fields=["clinic", "code"], name="patient_code_once_per_clinic"),
            models.UniqueConstraint(
                fields=["clinic", "original_id"], name="patient_imported_once_per_clinic"
            ),
        ]

    def __str__(self) -> str:
        return f"{self.nickname} ({self.code})"

    def save(self, *args: Any, **kwargs: Any) -> None:
        """Save the patient; who agrees to stand on boards gets an animal name first."""
        if self.boards != Boards.OWN and self.alias is None:
            self.draw_alias()
            if kwargs.get("update_fields") is not None:
                kwargs["update_fields"] = {*kwargs["update_fields"], "alias"}
        super().save(*args, **kwargs)

    @property
    def is_new(self) -> bool:
        """Whether the patient is not stored yet."""
        return self._state.adding

    def hold(self) -> None:
        """Read the row anew, and let nobody else alter it until the transaction ends."""
        self.refresh_from_db(from_queryset=_held())

    def keep(self, *fields: str) -> None:
        """Store what somebody wrote in these fields, and nothing else that was read before.

        Raises PersonErased where the person has been erased meanwhile.
        """
        with transaction.atomic():
            if _held().get(pk=self.pk).erased_at is not None:
                raise PersonErased
            self.save(update_fields=fields)

    def clean(self) -> None:
        """Refuse boards with others before the patient agreed to them, and to bring anyone back."""
        if self.erased_at is not None:
            raise PersonErased
        if self.boards == Boards.OWN or self.simulated:
            return
        agreed = self.pk and self.consents.filter(purpose="boards", withdrawn_at=None).exists()
        if not agreed:
            raise ValidationError(
                {
                    "boards": _(
                        "Boards with others need the patient's consent to boards. Note it on the "
                        "patient's consent page first."
                    )
                }
            )

    def draw_alias(self) -> None:
        """Give the patient another animal name, one that nobody on this server has."""
        self.alias = draw_alias(lambda name: Patient.everywhere.filter(alias=name).exists())


def _held() -> models.QuerySet[Patient]:
    """Give patients to hold: rows of other tables may still point to them meanwhile."""
    return Patient.everywhere.select_for_update(no_key=True)
