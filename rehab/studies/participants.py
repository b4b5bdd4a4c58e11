"""Participants: their enrollment, allocation and visits, and what happened in the study."""

from __future__ import annotations

from typing import ClassVar

from django.db import models
from django.utils import timezone
from django.utils.translation import gettext
from django.utils.translation import gettext_lazy as _

from rehab.people.append_only import ACCOUNT_DELETED, Allowed, AppendOnlyModel
from rehab.people.audit.row_digests import ERASED, SealableModel
from rehab.people.consent.models import PatientScope
from rehab.people.field_policy import erased_by, personal_fields, retained
from rehab.people.models import Clinic, Patient, User
from rehab.people.random_codes import random_code
from rehab.people.scope import ClinicModel, ScopedModel
from rehab.sessions.models import TrainingSession
from rehab.studies.models import NOT, Arm, Study, StudyVersion

ERASED_CODE = "E-"  # prefix of an erased participant's code
OF_STUDY = retained("the study's result, under a code", shown=True, research=True)


def replace_codes(patient: Patient, _pseudonym: str) -> None:
    """Replace an erased participant's codes by random ones; the numbers of the studies stay right.

    An eraser of the field policy: ``patient`` is who is erased, ``_pseudonym`` is not used.
    """
    for enrollment in patient.enrollments.exclude(code__startswith=ERASED_CODE):
        enrollment.code = f"{ERASED_CODE}{random_code(8)}"
        enrollment.save(update_fields=["code"])


def empty_reasons(patient: Patient, _pseudonym: str) -> None:
    """Delete what was typed about an erased participant.

    An eraser of the field policy: ``patient`` is who is erased, ``_pseudonym`` is not used.
    """
    emptied = {"reason": "", "about": "", "salt": "", "erased": True}
    StudyEvent.everywhere.filter(enrollment__patient=patient).update(**emptied)


class Enrollment(ClinicModel):
    """A patient's part in a study. ``code`` names the participant wherever the arm is hidden."""

    scope = PatientScope(clinic="clinic", tells_condition=False)

    clinic = models.ForeignKey(Clinic, on_delete=models.PROTECT, related_name="+")
    study = models.ForeignKey(Study, on_delete=models.PROTECT, related_name="enrollments")
    patient = models.ForeignKey(Patient, on_delete=models.PROTECT, related_name="enrollments")
    version = models.ForeignKey(StudyVersion, on_delete=models.PROTECT, related_name="+")
    code = models.CharField(_("code"), max_length=24)
    levels = models.JSONField(default=list)
    keep_data = models.BooleanField(
        _("data may be kept after a withdrawal"),
        help_text=_("As the patient agreed. Else sessions are left out of the study's results."),
    )
    # To this study, on paper; of simulated people there is none.
    consent_version = models.CharField(_("version of the consent"), max_length=40, blank=True)
    consented_on = models.DateField(_("consented on"), null=True)
    enrolled_at = models.DateTimeField(_("enrolled"), default=timezone.now)
    enrolled_by = models.ForeignKey(User, on_delete=models.SET_NULL, related_name="+", null=True)
    withdrawn_at = models.DateTimeField(_("withdrawn"), null=True)

    personal = personal_fields(
        {
            "code": erased_by(replace_codes, shown=True, research=True),
            "study patient version levels enrolled_at withdrawn_at": OF_STUDY,
            "keep_data consent_version consented_on": retained(
                "what was agreed to", shown=True, research=False
            ),
            "clinic enrolled_by": retained("place and staff", shown=False, research=False),
        }
    )

    class Meta(ClinicModel.Meta):
        verbose_name = _("participant")
        ordering: ClassVar = ["study", "pk"]
        constraints: ClassVar = [
            models.UniqueConstraint(fields=["study", "patient"], name="enrolled_once_per_study"),
            models.UniqueConstraint(fields=["study", "code"], name="participant_code_once"),
        ]

    def __str__(self) -> str:
        return self.code

    @property
    def is_analyzed(self) -> bool:
        """Whether the sessions count in the study's results."""
        return self.withdrawn_at is None or self.keep_data


class Allocation(SealableModel):
    """The group that a participant was allocated to: an arm's code, or codes in their order."""

    scope = PatientScope(clinic="enrollment__clinic", patient="enrollment__patient")
    sealed_fields = ("enrollment", "group", "at")

    enrollment = models.OneToOneField(
        Enrollment, on_delete=models.PROTECT, related_name="allocation"
    )
    group = models.CharField(max_length=64)
    at = models.DateTimeField(default=timezone.now)

    personal = personal_fields(
        {
            "enrollment group": OF_STUDY,
            "at salt digest erased": retained("when it was allocated", shown=False, research=False),
        }
    )

    class Meta(SealableModel.Meta):
        verbose_name = _("allocation")
        ordering: ClassVar = ["pk"]

    def __str__(self) -> str:
        return f"{self.enrollment}"  # never the group: this text may be logged

    def arm_of_period(self, period: int) -> Arm:
        """Return the arm of a period, counted from 0."""
        return self.enrollment.study.arms.get(code=self.group.split("-")[period])


class Screening(AppendOnlyModel):
    """A patient who was assessed for a study: enrolled, not eligible, or not willing.

    ``unmet``: the criteria that were not met, in the words of the study.
    """

    scope = PatientScope(clinic="study__clinic", patient="patient", tells_condition=False)
    allowed_changes = (ACCOUNT_DELETED,)

    study = models.ForeignKey(Study, on_delete=models.PROTECT, related_name="screenings")
    patient = models.ForeignKey(Patient, on_delete=models.PROTECT, related_name="screenings")
    unmet = models.JSONField(default=list)
    declined = models.BooleanField(default=False)
    by = models.ForeignKey(User, on_delete=models.SET_NULL, related_name="+", null=True)
    at = models.DateTimeField(default=timezone.now)

    personal = personal_fields(
        {
            "study patient unmet declined at": retained(
                "the flow of a study's participants", shown=True, research=False
            ),
            "by": retained("staff", shown=False, research=False),
        }
    )

    class Meta(AppendOnlyModel.Meta):
        verbose_name = _("screening")
        ordering: ClassVar = ["pk"]

    def __str__(self) -> str:
        return f"{self.study.code}: {self.at:%Y-%m-%d}"

    @property
    def why_not(self) -> str:
        """Why the patient does not take part, with the answer to each criterion that failed."""
        told = []
        for one in self.unmet:
            answer = gettext("yes") if one.startswith(NOT) else gettext("no")
            told.append(f"{one.removeprefix(NOT)}: {answer}")
        return "; ".join(told) or (gettext("no, declines") if self.declined else "")


class StudyVisit(ScopedModel):
    """A visit that the study plans. An aborted session can be walked again."""

    scope = PatientScope(
        clinic="enrollment__clinic", patient="enrollment__patient", tells_condition=False
    )

    enrollment = models.ForeignKey(Enrollment, on_delete=models.PROTECT, related_name="visits")
    number = models.PositiveSmallIntegerField()
    attempt = models.PositiveSmallIntegerField(default=1)
    period = models.PositiveSmallIntegerField()
    follow_up = models.BooleanField(default=False)
    day = models.DateField(_("day"))
    session = models.OneToOneField(
        TrainingSession, on_delete=models.PROTECT, related_name="study_visit", null=True
    )
    # Which version of the study its session was created from.
    version = models.ForeignKey(StudyVersion, on_delete=models.PROTECT, related_name="+", null=True)

    personal = personal_fields(
        {"enrollment number attempt period follow_up day session version": OF_STUDY}
    )

    class Meta(ScopedModel.Meta):
        verbose_name = _("study visit")
        ordering: ClassVar = ["enrollment", "number", "attempt"]
        constraints: ClassVar = [
            models.UniqueConstraint(
                fields=["enrollment", "number", "attempt"], name="study_visit_once"
            )
        ]

    def __str__(self) -> str:
        return f"{self.enrollment} / {self.number}"

    @property
    def is_simulated(self) -> bool:
        """Whether no person walked it."""
        session = self.session
        return session is not None and (session.simulated or self.enrollment.patient.simulated)


def counts_people_alone(study: Study) -> bool:
    """Return whether simulated visits stay out of a study's results: of any with a person in it."""
    return study.enrollments.filter(patient__simulated=False).exists()


class StudyEvent(SealableModel):
    """Something that happened in a study: who did it, and why."""

    class Kind(models.TextChoices):
        """The kind of event."""

        REGISTERED = "registered", _("Registered")
        STARTED = "started", _("Started")
        REVISED = "revised", _("Changed: a new version")
        CLOSED = "closed", _("Closed")
        ENROLLED = "enrolled", _("Enrolled")
        WITHDRAWN = "withdrawn", _("Withdrew")
        MARKED = "marked", _("Mark given")
        UNMARKED = "unmarked", _("Mark taken")
        CONSENTED = "consented", _("Agreed to a new version")
        ASKED = "asked", _("A second person is asked to reveal the arm")
        UNBLINDED = "unblinded", _("Arm revealed")
        EMERGENCY = "emergency", _("Arm revealed in an emergency")
        REFUSED = "refused", _("Revealing the arm was refused")
        LOOKED = "looked", _("Looked at results before the end")
        GUESSED = "guessed", _("Group guessed")

    # Reasons may name the condition.
    scope = PatientScope(clinic="study__clinic", patient="enrollment__patient")
    allowed_changes = (
        Allowed(
            ("reason", "about", "salt", "erased"),
            f"{ERASED} AND NEW.reason = '' AND NEW.about = ''",
        ),
    )
    sealed_fields = ("study", "enrollment", "kind", "about", "reason", "by", "at")

    study = models.ForeignKey(Study, on_delete=models.PROTECT, related_name="events")
    enrollment = models.ForeignKey(
        Enrollment, on_delete=models.PROTECT, related_name="events", null=True
    )
    kind = models.CharField(_("what"), max_length=12, choices=Kind.choices)
    about = models.CharField(_("about"), max_length=120, blank=True)
    reason = models.TextField(_("reason"), max_length=1000, blank=True)
    by = models.ForeignKey(
        User, on_delete=models.PROTECT, related_name="+", null=True, verbose_name=_("by")
    )
    at = models.DateTimeField(_("at"), default=timezone.now)

    personal = personal_fields(
        {
            "reason about salt erased": erased_by(empty_reasons, shown=False, research=False),
            "study enrollment kind at digest": retained(
                "what happened, under a code", shown=True, research=False
            ),
            "by": retained("staff", shown=False, research=False),
        }
    )

    class Meta(SealableModel.Meta):
        verbose_name = _("event")
        ordering: ClassVar = ["pk"]

    def __str__(self) -> str:
        return f"{self.study.code}: {self.get_kind_display()}"

    @property
    def is_emptied(self) -> bool:
        """Whether it has no words."""
        return not self.reason and not self.about
