"""What a patient has agreed to: to which words, for what, noted by whom, and until when."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime
from typing import Any, ClassVar

from django.db import models, transaction
from django.db.models import Exists, OuterRef, Q
from django.utils import timezone
from django.utils.translation import gettext_lazy as _
from django.utils.translation import override

from rehab.people.models import Boards, Clinic, Patient, User
from rehab.people.networks import is_within
from rehab.people.roles import Role
from rehab.people.scope import Scope, ScopedModel

REMOTE_WORDS = _("Remote view: your therapist may watch a session from another place.")
# What a clinic begins with, in its language. It is its own to change.
FIRST_WORDS = (
    _(
        "GARRY measures your steps while you walk on the treadmill: how strongly you push off, "
        "when, and how your therapist set the goal. The clinic keeps this under a nickname and a "
        "number, never your full name."
    ),
    _("Care: your therapists use your sessions to plan your training."),
    _(
        "Research: researchers of this clinic see your sessions under a made-up name. They never "
        "see your nickname or number."
    ),
    _(
        "Boards: your results stand beside those of others, under the name of an animal. You can "
        "leave at any time, also by yourself on the tablet."
    ),
    REMOTE_WORDS,
    _(
        "You may say no to any of these, and change your mind at any time. Your care does not "
        "depend on research, boards or remote view."
    ),
)


class Purpose(models.TextChoices):
    """What somebody agrees to."""

    CARE = "care", _("Care")
    RESEARCH = "research", _("Research")
    BOARDS = "boards", _("Boards")
    REMOTE = "remote", _("Remote view")


class FixedText(TypeError):
    """A version of the words that somebody tried to change."""


class ConsentText(ScopedModel):
    """The words that patients of a clinic agree to. A version never changes; a new one is made."""

    scope = Scope(clinic="clinic")

    clinic = models.ForeignKey(
        Clinic, on_delete=models.PROTECT, related_name="consent_texts", verbose_name=_("clinic")
    )
    version = models.PositiveSmallIntegerField(_("version"))
    text = models.TextField(_("words"), max_length=10_000)
    written_by = models.ForeignKey(
        User, on_delete=models.SET_NULL, related_name="+", null=True, verbose_name=_("written by")
    )
    written_at = models.DateTimeField(_("written at"), default=timezone.now)

    class Meta(ScopedModel.Meta):
        ordering: ClassVar = ["-version"]
        constraints: ClassVar = [
            models.UniqueConstraint(
                fields=["clinic", "version"], name="consent_text_version_once_per_clinic"
            )
        ]

    def __str__(self) -> str:
        return f"{self.version}"

    def save(self, *args: Any, **kwargs: Any) -> None:
        """Store a new version. Raises FixedText for one that is there already."""
        if not self._state.adding:
            raise FixedText("People have agreed to these words. Write a new version.")
        super().save(*args, **kwargs)


class Consent(ScopedModel):
    """That a patient agrees to something, from one moment on until it is withdrawn."""

    scope = Scope(clinic="patient__clinic")

    patient = models.ForeignKey(
        Patient, on_delete=models.CASCADE, related_name="consents", verbose_name=_("patient")
    )
    purpose = models.CharField(_("to what"), max_length=8, choices=Purpose.choices)
    # Of boards: on which.
    level = models.CharField(_("how far"), max_length=8, choices=Boards.choices, blank=True)
    # None: agreed before GARRY kept the words.
    text = models.ForeignKey(
        ConsentText, on_delete=models.PROTECT, related_name="+", null=True, verbose_name=_("text")
    )
    given_at = models.DateTimeField(_("given at"))
    recorded_by = models.ForeignKey(
        User, on_delete=models.SET_NULL, related_name="+", null=True, verbose_name=_("recorded by")
    )
    withdrawn_at = models.DateTimeField(_("withdrawn at"), null=True)
    withdrawn_by = models.ForeignKey(
        User, on_delete=models.SET_NULL, related_name="+", null=True, verbose_name=_("withdrawn by")
    )

    class Meta(ScopedModel.Meta):
        ordering: ClassVar = ["-given_at", "-pk"]
        constraints: ClassVar = [
            models.UniqueConstraint(
                fields=["patient", "purpose"],
                condition=Q(withdrawn_at__isnull=True),
                name="consent_holds_once",
            )
        ]

    def __str__(self) -> str:
        return str(self.get_purpose_display())


def agreed(purpose: Purpose, patient: str = "pk") -> Exists:
    """Give the condition that a patient agrees to something now; ``patient`` leads to the key."""
    rows = Consent.everywhere.filter(purpose=purpose, withdrawn_at__isnull=True)
    return Exists(rows.filter(patient=OuterRef(patient)))


@dataclass(frozen=True)
class PatientScope(Scope):
    """Rows of patients' sessions: researchers see those of patients who agreed to research.

    ``patient`` is the lookup that leads to the patient. Simulated patients agree to everything, and
    a clinic may do without (`Clinic.research_needs_consent`).
    """

    patient: str = "patient"

    def narrow(self, role: Role) -> Q:
        """Give what must hold besides the clinic."""
        if role != Role.RESEARCHER:
            return Q()
        return (
            Q(agreed(Purpose.RESEARCH, f"{self.patient}_id"))
            | Q(**{f"{self.patient}__simulated": True})
            | Q(**{f"{self.patient}__clinic__research_needs_consent": False})
        )


def _is_said(clinic: Clinic, said: Any) -> bool:
    return said is not REMOTE_WORDS or Purpose.REMOTE in offered(clinic)


def current_text(clinic: Clinic) -> ConsentText:
    """Give the words in force; a clinic's first ones are made on first use."""
    text = ConsentText.everywhere.filter(clinic=clinic).first()
    if text is None:
        with override(clinic.language):
            words = "\n\n".join(str(said) for said in FIRST_WORDS if _is_said(clinic, said))
        text, _made = ConsentText.everywhere.get_or_create(
            clinic=clinic, version=1, defaults={"text": words}
        )
    return text


def write_text(clinic: Clinic, text: str, by: User | None, now: datetime) -> ConsentText:
    """Put new words in force, unless they are the same. Who agreed to older ones still has."""
    with transaction.atomic():
        Clinic.everywhere.select_for_update().get(pk=clinic.pk)
        current = current_text(clinic)
        if current.text == text:
            return current
        return ConsentText.everywhere.create(
            clinic=clinic, version=current.version + 1, text=text, written_by=by, written_at=now
        )


def holding(patient: Patient) -> dict[str, Consent]:
    """Give what a patient agrees to now, by purpose."""
    rows = Consent.everywhere.filter(patient=patient, withdrawn_at=None).select_related("text")
    return {row.purpose: row for row in rows}


def offered(clinic: Clinic) -> list[Purpose]:
    """Give what patients of a clinic are asked for: remote view where it makes a difference."""
    return [one for one in Purpose if clinic.networks or one is not Purpose.REMOTE]


def may_be_watched(patient: Patient, address: str) -> bool:
    """Whether a person at this address may watch: from elsewhere with the patient's consent."""
    networks = patient.clinic.networks
    if not networks or patient.simulated or is_within(networks, address):
        return True
    return Purpose.REMOTE in holding(patient)


def may_be_cared_for(patient: Patient) -> bool:
    """Whether sessions may be set up: with the patient's consent, where the clinic needs that."""
    needed = patient.clinic.care_needs_consent and not patient.simulated
    return not needed or Purpose.CARE in holding(patient)


def give(
    patient: Patient, purpose: Purpose, by: User | None, now: datetime, level: str = ""
) -> None:
    """Note that a patient agrees to the words in force; again, if it was to older ones or to
    another ``level`` of boards. Nobody agrees for a person who is erased.
    """
    with transaction.atomic():
        patient.hold()
        if patient.erased_at is not None:
            return
        text = current_text(patient.clinic)
        held = Consent.everywhere.filter(patient=patient, purpose=purpose, withdrawn_at=None)
        if held.filter(text=text, level=level).exists():
            return
        held.update(withdrawn_at=now, withdrawn_by=by)  # replaced by what follows
        Consent.everywhere.create(
            patient=patient,
            purpose=purpose,
            level=level,
            text=text,
            given_at=now,
            recorded_by=by,
        )


def withdraw(patient: Patient, purpose: Purpose, by: User | None, now: datetime) -> None:
    """Note that a patient no longer agrees. It takes effect at once: boards lose the rows."""
    with transaction.atomic():
        patient.hold()
        Consent.everywhere.filter(patient=patient, purpose=purpose, withdrawn_at=None).update(
            withdrawn_at=now, withdrawn_by=by
        )
        if purpose == Purpose.BOARDS and patient.boards != Boards.OWN:
            patient.boards = Boards.OWN
            patient.save(update_fields=["boards"])


def join_boards(patient: Patient, boards: Boards, by: User | None, now: datetime) -> None:
    """Note on which boards a patient agrees to stand; OWN takes the consent back."""
    if boards == Boards.OWN:
        withdraw(patient, Purpose.BOARDS, by, now)
        return
    with transaction.atomic():
        give(patient, Purpose.BOARDS, by, now, boards.value)
        if patient.erased_at is None:
            patient.boards = boards
            patient.save(update_fields=["boards"])
