"""What is mended of a session that has ended: who walked it, whether it counts, a note.

The log stays as it was. Each correction is a row of its own that says who, when, why, and what
stood there before; what follows from it (figures, boards, trends) follows in the same transaction.
"""

from __future__ import annotations

import re
from datetime import datetime
from typing import Any, ClassVar

from django import forms
from django.core.exceptions import ValidationError
from django.db import models, transaction
from django.utils.translation import gettext
from django.utils.translation import gettext_lazy as _

from rehab.people.consent.models import PatientScope
from rehab.people.models import Patient, User
from rehab.people.scope import ScopedModel
from rehab.sessions.models import TrainingSession
from rehab.training.changes import OPEN_STATES, State


class Part(models.TextChoices):
    """What may be corrected."""

    PATIENT = "patient", _("Who walked")
    COUNTS = "counts", _("Counts")
    NOTE = "note", _("Note")


class SessionCorrection(ScopedModel):
    """One correction of a session. Rows are only ever added.

    ``old`` and ``new``: a patient's pseudonym, `yes` or `no`, or the words of the note.
    """

    scope = PatientScope(clinic="session__clinic", patient="session__patient")

    session = models.ForeignKey(
        TrainingSession,
        on_delete=models.PROTECT,
        related_name="corrections",
        verbose_name=_("session"),
    )
    part = models.CharField(_("what"), max_length=16, choices=Part.choices)
    old = models.TextField(_("before"), blank=True)
    new = models.TextField(_("after"), blank=True)
    reason = models.TextField(_("reason"))
    by = models.ForeignKey(
        User, on_delete=models.SET_NULL, related_name="+", null=True, verbose_name=_("by")
    )
    at = models.DateTimeField(_("at"))

    class Meta(ScopedModel.Meta):
        verbose_name = _("correction")
        verbose_name_plural = _("corrections")
        ordering: ClassVar = ["session", "pk"]

    def __str__(self) -> str:
        return self.get_part_display()

    def save(self, *args: Any, **kwargs: Any) -> None:
        """Add the row. Refuses to alter one that is there."""
        if self.pk and not kwargs.get("force_insert"):
            raise TypeError("A correction is never altered. Make another one.")
        super().save(*args, **kwargs)

    def delete(self, *args: Any, **kwargs: Any) -> Any:
        """Refuse: what was corrected stays known."""
        raise TypeError("A correction is never deleted. Make another one.")


class CorrectionForm(forms.Form):
    """The form of a correction: what is to hold from now on, and why.

    Beside each field the page sends what stood there when it was opened: only what differs from
    that is altered, and nothing where somebody else has altered the session meanwhile.
    """

    patient: forms.ModelChoiceField[Patient] = forms.ModelChoiceField(
        queryset=None, empty_label=None, label=_("Who walked"), show_hidden_initial=True
    )
    counts = forms.TypedChoiceField(
        label=_("This session"),
        choices=[
            ("yes", _("Counts in figures, boards and trends")),
            ("no", _("Is left out of figures, boards and trends")),
        ],
        widget=forms.RadioSelect,
        show_hidden_initial=True,
    )
    note = forms.CharField(
        label=_("Note"),
        required=False,
        show_hidden_initial=True,
        max_length=500,
        widget=forms.Textarea(attrs={"rows": 3}),
        help_text=_("What whoever reads this session should know."),
    )
    reason = forms.CharField(
        label=_("Reason for the correction"),
        max_length=500,
        widget=forms.Textarea(attrs={"rows": 2}),
        help_text=_("Stays with the session. Name nobody: researchers read it too."),
    )

    def __init__(self, *args: Any, session: TrainingSession, by: User, **options: Any) -> None:
        self.session, self.by = session, by
        self.holds = read_parts(session, by)
        options.setdefault(
            "initial",
            {
                "patient": session.patient_id,
                "counts": self.holds[Part.COUNTS],
                "note": self.holds[Part.NOTE],
            },
        )
        super().__init__(*args, **options)
        fields: dict[str, Any] = self.fields
        patients = Patient.objects.visible_to(by).filter(clinic=session.clinic_id)
        here = models.Q(erased_at=None) | models.Q(pk=session.patient_id)
        fields["patient"].queryset = patients.filter(here)

    def clean_note(self) -> str:
        """Refuse the patient's name in the note."""
        return _in_lines(self._nameless(self.cleaned_data["note"]))

    def clean_reason(self) -> str:
        """Refuse a patient's name in the reason."""
        return self._nameless(self.cleaned_data["reason"])

    def _nameless(self, words: str) -> str:
        for patient in (self.session.patient, self.cleaned_data.get("patient")):
            for name in (patient.nickname, patient.code) if patient else ():
                if re.search(rf"(?<!\w){re.escape(name)}(?!\w)", words, re.IGNORECASE):
                    raise ValidationError(
                        gettext("Leave out “%(name)s”: researchers read this too."),
                        params={"name": name},
                    )
        return words

    def clean(self) -> dict[str, Any]:
        """Refuse a form in which nothing is altered."""
        data: dict[str, Any] = super().clean() or {}
        if not self.errors and not self.changes():
            raise ValidationError(
                gettext("Nothing is altered. Change who walked, what counts or the note.")
            )
        return data

    @property
    def counts_seen(self) -> str:
        """Give the hidden field of ``counts``: a page that draws each choice leaves it out."""
        return self["counts"].as_hidden(only_initial=True)

    @property
    def seen(self) -> dict[Part, str]:
        """Give what stood there when the page was opened; empty for what the page did not send."""
        given = {part: self._seen_value(part) for part in Part}
        walkers: Any = self.fields["patient"]
        key = given[Part.PATIENT]
        walker = walkers.queryset.filter(pk=key).first() if key.isdecimal() else None
        return given | {Part.PATIENT: walker.pseudonym if walker else ""}

    def _seen_value(self, part: Part) -> str:
        return _in_lines(str(self.data.get(self.add_initial_prefix(part.value), "")).strip())

    def changes(self) -> dict[Part, str]:
        """Give what is altered of what was seen, as corrections write it."""
        wanted = {
            Part.PATIENT: self.cleaned_data["patient"].pseudonym,
            Part.COUNTS: self.cleaned_data["counts"],
            Part.NOTE: self.cleaned_data["note"],
        }
        seen = self.seen
        return {part: new for part, new in wanted.items() if new != seen[part]}

    def create(self, now: datetime) -> bool:
        """Correct the session, or say in ``errors`` what hinders."""
        if not self.is_valid():
            return False
        changes, reason = self.changes(), self.cleaned_data["reason"]
        try:
            correct_session(self.session, changes, reason, self.by, now, self.seen)
        except ValidationError as problem:
            self.add_error(None, problem)
            self._catch_up(changes)
            return False
        return True

    def _catch_up(self, changes: dict[Part, str]) -> None:
        """Show what holds by now, but for what this person altered."""
        stored = TrainingSession.objects.visible_to(self.by).select_related("patient")
        session = stored.get(pk=self.session.pk)
        holds = read_parts(session, self.by) | {Part.PATIENT: str(session.patient_id)}
        sent: Any = self.data
        data = sent.copy()
        for part, value in holds.items():
            data[self.add_initial_prefix(part.value)] = value
            if part not in changes:
                data[self.add_prefix(part.value)] = value
        self.data = data


def _in_lines(words: str) -> str:
    """Give words as they are stored: browsers send lines that end in two characters."""
    return words.replace("\r\n", "\n")


def forget_patient(patient: Patient, pseudonym: str) -> None:
    """Let corrections lead to nobody: free words go, the pseudonym of old gives way to the new."""
    rows = SessionCorrection.everywhere
    rows.filter(session__patient=patient).update(reason="")
    rows.filter(session__patient=patient, part=Part.NOTE).update(old="", new="")
    for side in ("old", "new"):
        named = rows.filter(part=Part.PATIENT, **{side: pseudonym})
        named.update(**{side: patient.pseudonym})


def find_note(session: TrainingSession, reader: Any) -> str:
    """Give the note that holds now; empty for none."""
    notes = SessionCorrection.objects.visible_to(reader).filter(session=session, part=Part.NOTE)
    return notes.order_by("-pk").values_list("new", flat=True).first() or ""


def read_parts(session: TrainingSession, reader: Any) -> dict[Part, str]:
    """Give what holds of a session, as corrections write it."""
    return {
        Part.PATIENT: session.patient.pseudonym,
        Part.COUNTS: "no" if session.left_out else "yes",
        Part.NOTE: _in_lines(find_note(session, reader)),
    }


def may_correct(session: TrainingSession) -> bool:
    """Whether a session can be corrected: what still runs is ended first."""
    return State(session.state) not in OPEN_STATES


@transaction.atomic
def correct_session(
    session: TrainingSession,
    changes: dict[Part, str],
    reason: str,
    by: User,
    now: datetime,
    seen: dict[Part, str] | None = None,
) -> list[SessionCorrection]:
    """Put down corrections and let them take effect, both or neither.

    ``seen`` is what ``by`` took to hold. Raises ValidationError where something else does, for a
    session that still runs, and for a patient whom ``by`` cannot see.
    """
    rows = TrainingSession.objects.visible_to(by).select_for_update(of=("self",))
    stored = rows.select_related("patient").get(pk=session.pk)
    if not may_correct(stored):
        raise ValidationError(gettext("This session still runs. End it first."))
    before = read_parts(stored, by)
    if seen is not None and seen != before:
        raise ValidationError(_tell_meanwhile(stored, before, seen, by))
    if Part.PATIENT in changes:
        patients = Patient.objects.visible_to(by).filter(erased_at=None)
        walker = patients.filter(pseudonym=changes[Part.PATIENT]).first()
        if walker is None:
            raise ValidationError(gettext("There is no such patient. Choose one of your clinic."))
        stored.patient = walker
    if Part.COUNTS in changes:
        stored.left_out = changes[Part.COUNTS] == "no"
    stored.save(update_fields=["patient", "left_out"])
    made = [
        SessionCorrection(
            session=stored, part=part, old=before[part], new=new, reason=reason, by=by, at=now
        )
        for part, new in changes.items()
        if new != before[part]
    ]
    for correction in made:
        correction.save()
    return made


def _tell_meanwhile(
    session: TrainingSession, before: dict[Part, str], seen: dict[Part, str], reader: User
) -> str:
    """Say what was altered since somebody opened the form, and by whom."""
    told = tell_corrections(session, reader)
    found = []
    for part in (part for part in Part if before[part] != seen[part]):
        newest = next((one for one in told if one["row"].part == part), None)
        if newest is not None:
            found.append(f"{part.label}: {newest['new'] or '–'} ({newest['row'].by or '–'})")
    said = gettext(
        "Somebody else has corrected this session meanwhile. %(what)s. Below stands what holds "
        "now, with your changes. Look it over and correct it again."
    )
    return said % {"what": " · ".join(found) or "–"}


def tell_corrections(session: TrainingSession, reader: User) -> list[dict[str, Any]]:
    """Give a session's corrections in words, newest first; patients by name for who may see it."""
    rows = list(
        SessionCorrection.objects.visible_to(reader)
        .filter(session=session)
        .select_related("by")
        .order_by("-pk")
    )
    walkers = {name for row in rows if row.part == Part.PATIENT for name in (row.old, row.new)}
    words: dict[str, str] = {}
    if walkers:
        seen = Patient.objects.visible_to(reader).filter(pseudonym__in=walkers)
        words |= {patient.pseudonym: patient.nickname for patient in seen}
    words |= {"yes": gettext("counts"), "no": gettext("left out")}
    return [
        {
            "row": row,
            "old": row.old if row.part == Part.NOTE else words.get(row.old, row.old),
            "new": row.new if row.part == Part.NOTE else words.get(row.new, row.new),
        }
        for row in rows
    ]
