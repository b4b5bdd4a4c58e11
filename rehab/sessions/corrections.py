"""Corrections of sessions that have ended: who walked, whether it counts, a note.

The log stays as it is. Each correction is a row of its own with author, time, reason and the
previous value; figures, boards and trends change in the same transaction.
"""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime
from typing import Any, ClassVar

from django.core.exceptions import ValidationError
from django.db import models, transaction
from django.utils.translation import gettext
from django.utils.translation import gettext_lazy as _

from rehab.people.append_only import ACCOUNT_DELETED, Allowed, AppendOnlyModel
from rehab.people.consent.models import PatientScope
from rehab.people.field_policy import erased_by, personal_fields, retained
from rehab.people.models import Patient, User
from rehab.people.roles import may_see_names
from rehab.sessions.formatting import clinic_time
from rehab.sessions.log import figures_stored
from rehab.sessions.models import TrainingSession
from rehab.training.changes import OPEN_STATES, State


class CorrectedField(models.TextChoices):
    """What may be corrected."""

    PATIENT = "patient", _("Who walked")
    COUNTS = "counts", _("Counts")
    NOTE = "note", _("Note")


Values = dict[CorrectedField, str]  # as corrections store them: see `SessionCorrection`


# By an erasure: words are emptied, and a patient's pseudonym is replaced.
ANONYMIZED = Allowed(
    ("old", "new", "reason"),
    "NEW.reason IN ('', OLD.reason) AND (OLD.field = 'patient' "
    "OR (NEW.old IN ('', OLD.old) AND NEW.new IN ('', OLD.new)))",
)


def anonymize_corrections(patient: Patient, pseudonym: str) -> None:
    """Remove free text from a patient's corrections and replace the old ``pseudonym``."""
    rows = SessionCorrection.everywhere
    rows.filter(session__patient=patient).update(reason="")
    rows.filter(session__patient=patient, field=CorrectedField.NOTE).update(old="", new="")
    for column in ("old", "new"):
        named = rows.filter(field=CorrectedField.PATIENT, **{column: pseudonym})
        named.update(**{column: patient.pseudonym})


class SessionCorrection(AppendOnlyModel):
    """One correction of a session. Rows are only ever added.

    ``old`` and ``new``: a patient's pseudonym, `yes` or `no`, or the text of the note.
    """

    scope = PatientScope(clinic="session__clinic", patient="session__patient")
    allowed_changes = (ANONYMIZED, ACCOUNT_DELETED)

    session = models.ForeignKey(
        TrainingSession,
        on_delete=models.PROTECT,
        related_name="corrections",
        verbose_name=_("session"),
    )
    field = models.CharField(_("what"), max_length=16, choices=CorrectedField.choices)
    old = models.TextField(_("before"), blank=True)
    new = models.TextField(_("after"), blank=True)
    reason = models.TextField(_("reason"))
    by = models.ForeignKey(
        User, on_delete=models.SET_NULL, related_name="+", null=True, verbose_name=_("by")
    )
    at = models.DateTimeField(_("at"))

    personal = personal_fields(
        {
            "old new reason": erased_by(anonymize_corrections, shown=True, research=True),
            "session field at": retained("what was corrected, and when", shown=True, research=True),
            "by": retained("staff", shown=True, research=False),
        }
    )

    class Meta(AppendOnlyModel.Meta):
        verbose_name = _("correction")
        verbose_name_plural = _("corrections")
        ordering: ClassVar = ["session", "pk"]

    def __str__(self) -> str:
        return self.get_field_display()


@dataclass(frozen=True, slots=True)
class DescribedCorrection:
    """A correction with its values, and who made it, as a reader may see them."""

    row: SessionCorrection
    old: str
    new: str
    by: str

    @property
    def at(self) -> datetime:
        """When it was made, in the clinic's time zone."""
        return clinic_time(self.row.at, self.row.session.clinic)


def current_note(session: TrainingSession, reader: Any) -> str:
    """Return the note in force; empty for none."""
    rows = SessionCorrection.objects.visible_to(reader).filter(session=session)
    notes = rows.filter(field=CorrectedField.NOTE).order_by("-pk")
    return notes.values_list("new", flat=True).first() or ""


def current_values(session: TrainingSession, reader: Any) -> Values:
    """Return a session's values in force, in the form that corrections store."""
    return {
        CorrectedField.PATIENT: session.patient.pseudonym,
        CorrectedField.COUNTS: "no" if session.excluded else "yes",
        CorrectedField.NOTE: normalize_newlines(current_note(session, reader)),
    }


def normalize_newlines(text: str) -> str:
    """Return text with LF line ends, as they are stored; browsers send CR LF."""
    return text.replace("\r\n", "\n")


def can_correct(session: TrainingSession) -> bool:
    """Return whether a session can be corrected: one that still runs must be ended first."""
    return State(session.state) not in OPEN_STATES


@transaction.atomic
def correct_session(
    session: TrainingSession,
    changes: Values,
    reason: str,
    by: User,
    now: datetime,
    expected: Values | None = None,
) -> list[SessionCorrection]:
    """Store corrections and apply them to the session, both or neither.

    ``expected`` are the values that ``by`` saw. Raises ValidationError where the session has
    others by now, where it still runs, and for a patient whom ``by`` cannot see.
    """
    rows = TrainingSession.objects.visible_to(by).select_for_update(of=("self",))
    stored = rows.select_related("patient").get(pk=session.pk)
    if not can_correct(stored):
        raise ValidationError(gettext("This session is still running. End it first."))
    before, walker = current_values(stored, by), stored.patient_id
    if expected is not None and expected != before:
        raise ValidationError(_describe_conflict(stored, before, expected, by))
    if CorrectedField.PATIENT in changes:
        patients = Patient.objects.visible_to(by).filter(erased_at=None)
        patient = patients.filter(pseudonym=changes[CorrectedField.PATIENT]).first()
        if patient is None:
            raise ValidationError(gettext("There is no such patient. Choose one of your clinic."))
        stored.patient = patient
    if CorrectedField.COUNTS in changes:
        stored.excluded = changes[CorrectedField.COUNTS] == "no"
    stored.save(update_fields=["patient", "excluded"])
    corrections = [
        SessionCorrection(
            session=stored, field=field, old=before[field], new=new, reason=reason, by=by, at=now
        )
        for field, new in changes.items()
        if new != before[field]
    ]
    for correction in corrections:
        correction.save()
    figures_stored.send(TrainingSession, patients={walker, stored.patient_id}, corrected=True)
    return corrections


@transaction.atomic
def add_note(session: TrainingSession, line: str, by: User, now: datetime) -> str:
    """Add a line to a session's note, with its time of day; return the note. It may still run."""
    rows = TrainingSession.objects.visible_to(by).select_for_update(of=("self",))
    stored = rows.select_related("clinic").get(pk=session.pk)
    old = current_note(stored, by)
    said = f"{clinic_time(now, stored.clinic):%H:%M} {normalize_newlines(line)}"
    note = f"{old}\n{said}" if old else said
    SessionCorrection(
        session=stored, field=CorrectedField.NOTE, old=old, new=note, by=by, at=now
    ).save()
    return note


def _describe_conflict(
    session: TrainingSession, before: Values, expected: Values, reader: User
) -> str:
    """Return a message with what was changed since the form was opened, and by whom."""
    corrections = describe_corrections(session, reader)
    found = []
    for field in (field for field in CorrectedField if before[field] != expected[field]):
        newest = next((one for one in corrections if one.row.field == field), None)
        if newest is not None:
            found.append(f"{field.label}: {newest.new or '–'} ({newest.by or '–'})")
    message = gettext(
        "Someone else has corrected this session in the meantime. %(what)s. Below is what "
        "applies now, with your changes. Check it and correct it again."
    )
    return message % {"what": " · ".join(found) or "–"}


def describe_corrections(session: TrainingSession, reader: User) -> list[DescribedCorrection]:
    """Return a session's corrections, newest first; patients by name for who may see it."""
    rows = list(
        SessionCorrection.objects.visible_to(reader)
        .filter(session=session)
        .select_related("by", "session__clinic")
        .order_by("-pk")
    )
    of_patient = [row for row in rows if row.field == CorrectedField.PATIENT]
    pseudonyms = {name for row in of_patient for name in (row.old, row.new)}
    labels: dict[str, str] = {}
    if pseudonyms:
        patients = Patient.objects.visible_to(reader).filter(pseudonym__in=pseudonyms)
        labels |= {patient.pseudonym: patient.nickname for patient in patients}
    labels |= {"yes": gettext("counts"), "no": gettext("left out")}

    def describe(row: SessionCorrection, value: str) -> str:
        return value if row.field == CorrectedField.NOTE else labels.get(value, value)

    named = may_see_names(reader.role)
    return [
        DescribedCorrection(
            row,
            old=describe(row, row.old),
            new=describe(row, row.new),
            by=str(row.by or "") if named else "",
        )
        for row in rows
    ]
