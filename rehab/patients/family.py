"""Links by which a patient's family looks at how training goes: who has one, and until when.

A link is a token of 256 bits, of which only the hash is stored. It shows nothing unless the patient
consents to it now, is in no blinded study, and the program goes on. Who has left a study has none
until it is closed: whoever assesses there may have kept a link from before.
"""

from __future__ import annotations

import secrets
from datetime import datetime, timedelta
from typing import Any, ClassVar

from django.db import models, transaction
from django.db.models import F, Q
from django.utils.translation import gettext_lazy as _

from rehab.people.audit.audit_log import Act, build_entry, record, record_counted
from rehab.people.consent.models import Purpose
from rehab.people.consent.services import active_consents, consent_withdrawn
from rehab.people.field_policy import deleted, personal_fields
from rehab.people.models import Clinic, Patient, User
from rehab.people.models.hidden_patients import hidden_patients, is_in_running_study
from rehab.people.scope import ClinicModel, Scope
from rehab.people.sign_in.tokens import TOKEN_BYTES, hash_token

WEEKS = (2, 4, 12)  # for which a link may be given
AT_ONCE = 5  # links of one patient


class FamilyLinkRefused(ValueError):
    """A link that cannot be given; the message says why."""


class FamilyLink(ClinicModel):
    """A link that somebody was given, until it expires or is ended."""

    actor_kind = "family"  # which sees no rows by itself
    scope = Scope(clinic="clinic")

    clinic = models.ForeignKey(
        Clinic, on_delete=models.PROTECT, related_name="+", verbose_name=_("clinic")
    )
    patient = models.ForeignKey(
        Patient,
        on_delete=models.CASCADE,
        related_name="family_links",
        verbose_name=_("patient"),
    )
    token_hash = models.CharField(max_length=64, unique=True, editable=False)
    shows_name = models.BooleanField(_("with the nickname"), default=True)
    created_by = models.ForeignKey(
        User, on_delete=models.SET_NULL, related_name="+", null=True, verbose_name=_("given by")
    )
    created_at = models.DateTimeField(_("created at"))
    expires_at = models.DateTimeField(_("valid until"))
    ended_at = models.DateTimeField(_("ended"), null=True)
    opened_at = models.DateTimeField(_("last opened"), null=True)
    opened = models.PositiveIntegerField(_("times opened"), default=0)

    personal = personal_fields(
        {
            "patient shows_name created_at expires_at ended_at opened_at opened": deleted(
                shown=True, research=False
            ),
            "clinic token_hash created_by": deleted(shown=False, research=False),
        }
    )

    class Meta(ClinicModel.Meta):
        verbose_name = _("family link")
        ordering: ClassVar = ["-created_at", "-pk"]

    def __str__(self) -> str:
        return f"{self._meta.verbose_name} {self.pk}"

    def is_over(self, now: datetime) -> bool:
        """Return whether it has expired or was ended."""
        return self.ended_at is not None or self.expires_at <= now


NOT_AGREED = _("The patient has not agreed to the family view yet.")


def refusal_reason(patient: Patient) -> str:
    """Return why a patient's family sees nothing now; empty where it may."""
    if patient.erased_at is not None or patient.ended_at is not None:
        return str(_("The program has ended: the family sees nothing any more."))
    if patient.blinded or is_in_running_study(patient):
        return str(
            _("In a blinded study there is no family view: points and hits would tell too much.")
        )
    if Purpose.FAMILY not in active_consents(patient):
        return str(NOT_AGREED)
    return ""


def give_link(
    patient: Patient, weeks: int, by: User, address: str, now: datetime, *, shows_name: bool
) -> str:
    """Store a new link and return its token, which is shown once. Raises FamilyLinkRefused."""
    with transaction.atomic():
        patient.lock()
        if reason := refusal_reason(patient):
            raise FamilyLinkRefused(reason)
        if hidden_patients(by).filter(pk=patient.pk).exists():
            raise FamilyLinkRefused(_("A study hides this patient's sessions from you."))
        if weeks not in WEEKS:
            raise FamilyLinkRefused(_("Choose for how long."))
        if open_links(patient, now).count() >= AT_ONCE:
            raise FamilyLinkRefused(_("Five links are in use. End one first."))
        token = secrets.token_urlsafe(TOKEN_BYTES)
        link = FamilyLink.everywhere.create(
            clinic_id=patient.clinic_id,
            patient=patient,
            token_hash=hash_token(token),
            shows_name=shows_name,
            created_by=by,
            created_at=now,
            expires_at=now + timedelta(weeks=weeks),
        )
        _record(Act.FAMILY_LINK, by, link, address, now)
    return token


def end_link(link: FamilyLink, by: User, address: str, now: datetime) -> None:
    """End a link at once."""
    with transaction.atomic():
        if FamilyLink.everywhere.filter(pk=link.pk, ended_at=None).update(ended_at=now):
            _record(Act.FAMILY_END, by, link, address, now)


def end_links(patient: Patient, by: User | None, now: datetime) -> None:
    """End all links of a patient; in the transaction of what ends them."""
    for link in open_links(patient, now):
        FamilyLink.everywhere.filter(pk=link.pk).update(ended_at=now)
        _record(Act.FAMILY_END, by, link, "", now)


def open_links(patient: Patient, now: datetime) -> models.QuerySet[FamilyLink]:
    """Return the links of a patient that are not over."""
    return FamilyLink.everywhere.filter(
        Q(expires_at__gt=now), patient=patient, ended_at=None
    ).select_related("patient__clinic")


def find_link(token: str, now: datetime) -> FamilyLink | None:
    """Return the link of a token, if it shows something now."""
    hashed = hash_token(token)
    rows = FamilyLink.everywhere.select_related("patient__clinic")
    link = rows.filter(token_hash=hashed).first()
    # A digest of 256 random bits: how long the database takes to find it reveals nothing.
    if link is None or not secrets.compare_digest(link.token_hash, hashed):
        return None
    return None if link.is_over(now) or refusal_reason(link.patient) else link


def note_opening(link: FamilyLink, address: str, now: datetime) -> None:
    """Note that somebody has looked."""
    FamilyLink.everywhere.filter(pk=link.pk).update(opened_at=now, opened=F("opened") + 1)
    patient_id, about = link.patient_id, str(link)
    record_counted(
        build_entry(
            Act.FAMILY_VIEW, link, patient_id=patient_id, about=about, address=address, now=now
        )
    )


def _record(act: Act, by: User | None, link: FamilyLink, address: str, now: datetime) -> None:
    patient_id, clinic_id = link.patient_id, link.clinic_id
    details: dict[str, Any] = {"patient_id": patient_id, "clinic_id": clinic_id, "now": now}
    record(act, by, about=str(link), address=address, **details)


def connect_receivers() -> None:
    """End the links of whoever withdraws the consent."""
    consent_withdrawn.connect(on_withdrawal)


def on_withdrawal(
    sender: Any, patient: Patient, purpose: str, by: User | None, now: datetime, **_: Any
) -> None:
    """End a patient's links with the consent to them."""
    if purpose == Purpose.FAMILY:
        end_links(patient, by, now)
