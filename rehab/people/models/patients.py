"""Patients: how a clinic knows them, and how their pages look."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, ClassVar

from django.conf import settings
from django.core.exceptions import NON_FIELD_ERRORS, ValidationError
from django.db import models, transaction
from django.utils.translation import gettext_lazy as _

from rehab.people.aliases import draw_alias
from rehab.people.covariates import age_band, months_since
from rehab.people.field_policy import (
    Covariate,
    FieldPolicy,
    erased,
    erased_by,
    personal_fields,
    retained,
)
from rehab.people.models.choices import (
    DEMO_NAMES,
    SIDES,
    BoardsConsent,
    EndReason,
    ErasureReason,
    ScreenSide,
    ScreenText,
    Severity,
)
from rehab.people.models.clinics import Clinic, language_choices
from rehab.people.random_codes import random_code
from rehab.people.ranges import between
from rehab.people.scope import ClinicModel, Scope


def generate_pseudonym() -> str:
    """Return a random name that reveals nothing about a patient."""
    return "P-" + random_code(8)


def rename_erased(patient: Patient, _pseudonym: str) -> None:
    """Replace an erased patient's pseudonym and code by one new pseudonym."""
    patient.pseudonym = patient.code = generate_pseudonym()


def _detail(policy: Callable[..., FieldPolicy], *what: Any, **where: Any) -> FieldPolicy:
    """Return the policy of a field that people enter, and may see and look up."""
    usual = {"shown": True, "research": False, "history": True, "is_detail": True}
    return policy(*what, **usual | where)


def _setting(reason: str, **where: Any) -> FieldPolicy:
    """Return the policy of a field that stays, is shown, and whose changes are recorded."""
    return retained(reason, **{"shown": True, "research": False, "history": True} | where)


class PatientErased(ValidationError):
    """A change to a patient who has been erased."""

    def __init__(self) -> None:
        super().__init__({NON_FIELD_ERRORS: _("This person is erased. Take a new patient in.")})


class Patient(ClinicModel):
    """A person who walks, known by the clinic's code and a nickname, never a full name."""

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
        help_text=_("Shown on the screens, so that patient and therapist can check."),
    )
    pseudonym = models.CharField(
        _("pseudonym"), max_length=16, unique=True, default=generate_pseudonym, editable=False
    )
    own_goal = models.CharField(
        _("goal in the patient’s words"),
        max_length=80,
        blank=True,
        default="",
        help_text=_("“Walk to the bakery”. The patient reads it at the start and at the end."),
    )
    body_mass_kg = models.FloatField(
        _("body mass (kg)"),
        null=True,
        blank=True,
        validators=between(10, 300, "kg"),
        help_text=_("Needed when sensors send raw signals: A2 is power per kilogram."),
    )
    paretic_side = models.CharField(_("paretic side"), max_length=8, choices=SIDES, blank=True)
    birth_year = models.PositiveSmallIntegerField(
        _("year of birth"),
        null=True,
        blank=True,
        validators=between(1900, 2100),
        help_text=_("Researchers see only the decade of age."),
    )
    stroke_month = models.DateField(
        _("month of the stroke"),
        null=True,
        blank=True,
        help_text=_("Researchers see only the months since then."),
    )
    severity = models.CharField(_("severity"), max_length=8, choices=Severity.choices, blank=True)
    language = models.CharField(_("language"), max_length=8, choices=language_choices, default="en")
    screen_side = models.CharField(
        _("where things are"), max_length=8, choices=ScreenSide.choices, default=ScreenSide.RIGHT
    )
    screen_text = models.CharField(
        _("size of words"), max_length=8, choices=ScreenText.choices, default=ScreenText.NORMAL
    )
    screen_still = models.BooleanField(
        _("calm page"),
        default=False,
        help_text=_("No confetti, and nothing moves except the level."),
    )
    screen_sounds = models.BooleanField(
        _("sounds"),
        default=False,
        help_text=_(
            "A soft tone for each step, the higher the better; a second one for points. The "
            "patient can mute it on the page."
        ),
    )
    boards = models.CharField(
        _("leaderboards"),
        max_length=8,
        choices=BoardsConsent.choices,
        default=BoardsConsent.OWN,
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
    legacy_id = models.BigIntegerField(
        null=True, editable=False, help_text=_("The participant of the original GARRY's database.")
    )
    created_at = models.DateTimeField(_("created at"), auto_now_add=True)
    ended_at = models.DateTimeField(_("program ended"), null=True, editable=False)
    end_reason = models.CharField(
        _("why it ended"), max_length=8, choices=EndReason.choices, blank=True, editable=False
    )
    erased_at = models.DateTimeField(_("erased"), null=True, editable=False)
    erasure_reason = models.CharField(
        _("why it was erased"),
        max_length=9,
        choices=ErasureReason.choices,
        blank=True,
        editable=False,
    )

    personal = personal_fields(
        {
            "nickname": _detail(erased, _("Erased")),
            "code": _detail(erased_by, rename_erased),
            "own_goal": _detail(erased, ""),
            "pseudonym": erased_by(rename_erased, shown=True, research=True, history=True),
            "clinic": _setting("tells where, and nothing of whom"),
            "body_mass_kg": _detail(erased),
            "birth_year": _detail(
                erased,
                research=Covariate(
                    "age_band",
                    "years",
                    "Age when it began, by calendar years, in bands of ten.",
                    value=age_band,
                ),
            ),
            "stroke_month": _detail(
                erased,
                research=Covariate(
                    "months_since_stroke",
                    "months",
                    "From the stroke to its beginning.",
                    "integer",
                    value=months_since,
                ),
            ),
            "severity": _detail(
                erased,
                "",
                research=Covariate(
                    "severity", "", "mild, moderate or severe, as the clinic judges it now."
                ),
            ),
            "paretic_side": _detail(
                retained,
                "half of all people have the same; studies adjust by it",
                research=Covariate("paretic_side", "", "The leg that the stroke weakened."),
            ),
            "language screen_side screen_text screen_still screen_sounds": _setting(
                "a setting that many people share"
            ),
            "boards": _setting("erasure withdraws the consent first", shown="leaderboards"),
            "alias": erased(shown="animal_name", research=False, history=True),
            "blinded": _setting("the study's, and many people's", shown="in_a_blinded_study"),
            "simulated": _setting("no person", research=True),
            "legacy_id": erased(shown="participant_of_the_original", research=False, history=True),
            "created_at": _setting("the sessions' days tell as much", history=False),
            "ended_at": _setting("what was done, and when", shown="program_ended_at"),
            "end_reason": _setting("one of five words", shown="program_end_reason"),
            "erased_at erasure_reason": _setting("what was done, and when"),
        }
    )

    class Meta(ClinicModel.Meta):
        verbose_name = _("patient")
        verbose_name_plural = _("patients")
        ordering: ClassVar = ["nickname", "code"]
        constraints: ClassVar = [
            models.UniqueConstraint(fields=["clinic", "code"], name="patient_code_once_per_clinic"),
            models.UniqueConstraint(
                fields=["clinic", "legacy_id"], name="patient_imported_once_per_clinic"
            ),
        ]

    def __str__(self) -> str:
        return f"{self.nickname} ({self.code})"

    def save(self, *args: Any, **kwargs: Any) -> None:
        """Save the patient; one who has agreed to boards first gets an animal name."""
        if self.boards != BoardsConsent.OWN and self.alias is None:
            self.draw_alias()
            if kwargs.get("update_fields") is not None:
                kwargs["update_fields"] = {*kwargs["update_fields"], "alias"}
        super().save(*args, **kwargs)

    @property
    def is_new(self) -> bool:
        """Return whether the patient is not stored yet."""
        return self._state.adding

    def lock(self) -> None:
        """Reload the row and lock it until the end of the transaction."""
        self.refresh_from_db(from_queryset=_locked())

    def save_fields(self, *fields: str) -> None:
        """Save these fields alone, so that other fields are not reset to what was read earlier.

        Raises PatientErased where the patient has been erased meanwhile.
        """
        with transaction.atomic():
            if _locked().get(pk=self.pk).erased_at is not None:
                raise PatientErased
            self.save(update_fields=fields)

    def clean(self) -> None:
        """Refuse boards with others without consent, and any change to an erased patient.

        Of a date within the month of the stroke the day is dropped.
        """
        if self.erased_at is not None:
            raise PatientErased
        if settings.DEMO and not (self.nickname in DEMO_NAMES and self.code.startswith("demo")):
            raise ValidationError(
                {
                    "nickname": _("This is a demonstration. Take one of: %(names)s; code: demo-1.")
                    % {"names": ", ".join(DEMO_NAMES)}
                }
            )
        if self.stroke_month is not None:
            self.stroke_month = self.stroke_month.replace(day=1)
        if self.boards == BoardsConsent.OWN or self.simulated:
            return
        has_consent = self.pk and self.consents.filter(purpose="boards", withdrawn_at=None).exists()
        if not has_consent:
            raise ValidationError(
                {
                    "boards": _(
                        "Boards with others need the patient's consent to boards. Note it on the "
                        "patient's consent page first."
                    )
                }
            )

    def draw_alias(self) -> None:
        """Set another animal name, one that no patient on this server has."""
        self.alias = draw_alias(lambda name: Patient.everywhere.filter(alias=name).exists())


def _locked() -> models.QuerySet[Patient]:
    """Return patients to lock; rows of other tables may still refer to them meanwhile."""
    return Patient.everywhere.select_for_update(no_key=True)
