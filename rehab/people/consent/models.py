"""Consents of patients: to what, to which text, recorded by whom, and until when."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from django.db import models
from django.db.models import Exists, OuterRef, Q
from django.utils import timezone
from django.utils.translation import gettext_lazy as _

from rehab.people.append_only import Allowed, AppendOnlyModel
from rehab.people.field_policy import personal_fields, retained
from rehab.people.models import BoardsConsent, Clinic, Patient, User
from rehab.people.models.hidden_patients import hidden_patients
from rehab.people.roles import Role
from rehab.people.scope import Scope, ScopedModel


class Purpose(models.TextChoices):
    """What a patient consents to."""

    CARE = "care", _("Care")
    RESEARCH = "research", _("Research")
    BOARDS = "boards", _("Boards")
    REMOTE = "remote", _("Remote view")
    FAMILY = "family", _("Family view")


class ConsentText(AppendOnlyModel):
    """A version of the text that patients of a clinic agree to. It never changes."""

    scope = Scope(clinic="clinic")
    allowed_changes = (Allowed(("written_by",), "NEW.written_by_id IS NULL"),)

    clinic = models.ForeignKey(
        Clinic, on_delete=models.PROTECT, related_name="consent_texts", verbose_name=_("clinic")
    )
    version = models.PositiveSmallIntegerField(_("version"))
    text = models.TextField(_("words"), max_length=10_000)
    written_by = models.ForeignKey(
        User, on_delete=models.SET_NULL, related_name="+", null=True, verbose_name=_("written by")
    )
    written_at = models.DateTimeField(_("written at"), default=timezone.now)

    class Meta(AppendOnlyModel.Meta):
        ordering: ClassVar = ["-version"]
        constraints: ClassVar = [
            models.UniqueConstraint(
                fields=["clinic", "version"], name="consent_text_version_once_per_clinic"
            )
        ]

    def __str__(self) -> str:
        return f"{self.version}"


class Consent(ScopedModel):
    """A patient's consent to one purpose, until it is withdrawn; at once: the patient said no."""

    scope = Scope(clinic="patient__clinic")

    patient = models.ForeignKey(
        Patient, on_delete=models.CASCADE, related_name="consents", verbose_name=_("patient")
    )
    purpose = models.CharField(_("to what"), max_length=8, choices=Purpose.choices)
    # For boards only.
    level = models.CharField(_("how far"), max_length=8, choices=BoardsConsent.choices, blank=True)
    # None: given before GARRY stored the text.
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

    personal = personal_fields(
        {
            "patient purpose level text given_at withdrawn_at": retained(
                "proves what was agreed to, in the clinic's own words", shown=True, research=False
            ),
            "recorded_by withdrawn_by": retained("staff", shown=False, research=False),
        }
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

    @property
    def is_refusal(self) -> bool:
        """Whether the patient was asked and said no; such a row never allows anything."""
        return self.given_at == self.withdrawn_at


def has_consented(purpose: Purpose, patient: str = "pk") -> Exists:
    """Return the condition that a patient consents now; ``patient`` is the lookup of the key."""
    rows = Consent.everywhere.filter(purpose=purpose, withdrawn_at__isnull=True)
    return Exists(rows.filter(patient=OuterRef(patient)))


@dataclass(frozen=True)
class PatientScope(Scope):
    """Rows of patients' sessions: researchers see those of patients who consent to research.

    ``patient`` is the lookup of the patient. Simulated patients need no consent, and a clinic may
    require none (`Clinic.research_needs_consent`). ``tells_condition``: the rows betray what a
    study hides from its assessors, who see none of them.
    """

    patient: str = "patient"
    tells_condition: bool = True

    def member_filter(self, user: User) -> Q:
        """Return the condition that no study hides a row from an account."""
        if not self.tells_condition:
            return Q()
        return ~Q(**{f"{self.patient}__in": hidden_patients(user)})

    def role_filter(self, role: Role) -> Q:
        """Return the condition for a role, besides that of the clinic."""
        if role != Role.RESEARCHER:
            return Q()
        return (
            Q(has_consented(Purpose.RESEARCH, f"{self.patient}_id"))
            | Q(**{f"{self.patient}__simulated": True})
            | Q(**{f"{self.patient}__clinic__research_needs_consent": False})
        )
