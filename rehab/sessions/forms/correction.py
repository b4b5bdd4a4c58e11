"""The form that corrects a session."""

from __future__ import annotations

from datetime import datetime
from typing import Any

from django import forms
from django.core.exceptions import ValidationError
from django.db.models import Q
from django.utils.translation import gettext
from django.utils.translation import gettext_lazy as _

from rehab.people.models import Patient, User
from rehab.people.row_values import read_key
from rehab.sessions.corrections import (
    CorrectedField,
    Values,
    correct_session,
    current_values,
    normalize_newlines,
)
from rehab.sessions.forms.names import refuse_names
from rehab.sessions.models import TrainingSession


class CorrectionForm(forms.Form):
    """The new values of a session, and the reason.

    The page sends each field with its initial value: only fields that differ from it are changed,
    and none is where another user has corrected the session meanwhile.
    """

    patient: forms.ModelChoiceField[Patient] = forms.ModelChoiceField(
        queryset=None,
        empty_label=None,
        label=_("Who walked"),
        show_hidden_initial=True,
        help_text=_("Only if it was somebody else: the whole session then moves to that patient."),
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
        help_text=_("For anyone who reads this session."),
    )
    reason = forms.CharField(
        label=_("Reason for the correction (required)"),
        max_length=500,
        widget=forms.Textarea(attrs={"rows": 2}),
        help_text=_("Stays with the session. Do not name anyone: researchers read it too."),
    )

    def __init__(self, *args: Any, session: TrainingSession, by: User, **options: Any) -> None:
        self.session, self.by = session, by
        current = current_values(session, by)
        options.setdefault(
            "initial",
            {
                "patient": session.patient_id,
                "counts": current[CorrectedField.COUNTS],
                "note": current[CorrectedField.NOTE],
            },
        )
        super().__init__(*args, **options)
        fields: dict[str, Any] = self.fields
        patients = Patient.objects.visible_to(by).filter(clinic=session.clinic_id)
        selectable = Q(erased_at=None) | Q(pk=session.patient_id)
        fields["patient"].queryset = patients.filter(selectable)

    def clean_note(self) -> str:
        """Return the note. Refuses one that names the patient."""
        return normalize_newlines(self._refuse_names(self.cleaned_data["note"]))

    def clean_reason(self) -> str:
        """Return the reason. Refuses one that names the patient."""
        return self._refuse_names(self.cleaned_data["reason"])

    def _refuse_names(self, text: str) -> str:
        chosen = self.cleaned_data.get("patient")
        return refuse_names(text, self.session.patient, *([chosen] if chosen else []))

    def clean(self) -> dict[str, Any]:
        """Return the cleaned data. Refuses a form in which nothing is changed."""
        data: dict[str, Any] = super().clean() or {}
        if not self.errors and not self.changes():
            raise ValidationError(
                gettext("Nothing is altered. Change who walked, what counts or the note.")
            )
        return data

    @property
    def shown(self) -> list[forms.BoundField]:
        """The fields as the page has them; they are cleaned with the patient first, whose name the
        others refuse.
        """
        return [self[name] for name in ("counts", "reason", "patient", "note")]

    @property
    def counts_initial(self) -> str:
        """The hidden initial value of ``counts``, which a template that draws each choice omits."""
        return self["counts"].as_hidden(only_initial=True)

    def initial_values(self) -> Values:
        """Return the values when the page was opened; empty where the page did not send them."""
        sent = {field: self._initial_value(field) for field in CorrectedField}
        patients: Any = self.fields["patient"]
        key = read_key(sent[CorrectedField.PATIENT])
        patient = patients.queryset.filter(pk=key).first()
        return sent | {CorrectedField.PATIENT: patient.pseudonym if patient else ""}

    def _initial_value(self, field: CorrectedField) -> str:
        return normalize_newlines(
            str(self.data.get(self.add_initial_prefix(field.value), "")).strip()
        )

    def changes(self) -> Values:
        """Return the new values of the fields that differ from their initial ones."""
        wanted = {
            CorrectedField.PATIENT: self.cleaned_data["patient"].pseudonym,
            CorrectedField.COUNTS: self.cleaned_data["counts"],
            CorrectedField.NOTE: self.cleaned_data["note"],
        }
        initial = self.initial_values()
        return {field: new for field, new in wanted.items() if new != initial[field]}

    def create(self, now: datetime) -> bool:
        """Correct the session; return False, with the reason in ``errors``, where it cannot."""
        if not self.is_valid():
            return False
        changes, reason = self.changes(), self.cleaned_data["reason"]
        try:
            correct_session(self.session, changes, reason, self.by, now, self.initial_values())
        except ValidationError as problem:
            self.add_error(None, problem)
            self._show_current_values(changes)
            return False
        return True

    def _show_current_values(self, changes: Values) -> None:
        """Show the values in force, except for the fields that this person changed."""
        stored = TrainingSession.objects.visible_to(self.by).select_related("patient")
        session = stored.get(pk=self.session.pk)
        current = current_values(session, self.by)
        current[CorrectedField.PATIENT] = str(session.patient_id)
        sent: Any = self.data
        data = sent.copy()
        for field, value in current.items():
            data[self.add_initial_prefix(field.value)] = value
            if field not in changes:
                data[self.add_prefix(field.value)] = value
        self.data = data
