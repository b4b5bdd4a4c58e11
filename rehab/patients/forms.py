"""Forms about a patient: details, screen, end of the program, erasure."""

from __future__ import annotations

from datetime import datetime
from typing import Any, ClassVar, cast

from django import forms
from django.core.exceptions import ValidationError
from django.db import IntegrityError, transaction
from django.utils.translation import gettext_lazy as _

from rehab.people.access import clinic_of
from rehab.people.consent.models import Purpose
from rehab.people.consent.services import (
    MEANINGS,
    TOTALS_ONLY,
    list_answers,
    offered_purposes,
    record_answer,
)
from rehab.people.field_policy import details
from rehab.people.models import SIDES, EndReason, ErasureReason, Patient, User
from rehab.people.ranges import say_ranges
from rehab.people.web.row_forms import MonthField


class _PatientFieldsForm(forms.ModelForm):
    """Fields of a patient. Of one who is stored already it saves its own fields alone."""

    instance: Patient

    def __init__(self, *args: Any, **options: Any) -> None:
        super().__init__(*args, **options)
        say_ranges(self)

    def save(self, commit: bool = True) -> Patient:
        """Store the patient. Raises PatientErased, and IntegrityError where a code is taken."""
        if self.instance.is_new:
            patient: Patient = super().save(commit)
            return patient
        self.instance.save_fields(*self.fields)
        return self.instance

    def save_or_report(self) -> bool:
        """Save a valid form. Return whether it worked; ``errors`` has the reason if it did not."""
        if not self.is_valid():
            return False
        try:
            with transaction.atomic():
                self.save()
        except ValidationError as problem:
            self.add_error(None, problem)
        except IntegrityError:
            self.full_clean()  # another request has taken the code meanwhile; it is found now
            if self.is_valid():
                raise
        return self.is_valid()


class _SpokenForm(_PatientFieldsForm):
    """A form with the patient's language: of a new patient the clinic's, unless one is chosen."""

    def clean_language(self) -> str:
        """Return the language; what was sent without one leaves it as it is."""
        given: str = self.cleaned_data["language"]
        return given or self.instance.language

    def offer_language(self) -> None:
        """Let the language be left out, and offer the clinic's to a new patient."""
        self.fields["language"].required = False
        if self.instance.is_new:
            self.instance.language = self.initial["language"] = self.instance.clinic.language


FIRST = ("nickname", "code", "paretic_side", "body_mass_kg")  # the others can wait
CONSENT = "consent_"  # before a purpose: the name of its field


class PatientForm(_SpokenForm):
    """A patient of the PT's clinic, new or to be edited."""

    field_order = FIRST  # then as in the model

    class Meta:
        model = Patient
        fields: ClassVar = [*details(Patient), "language"]
        field_classes: ClassVar = {"stroke_month": MonthField}
        widgets: ClassVar = {"paretic_side": forms.RadioSelect}
        help_texts: ClassVar = {
            "body_mass_kg": _("Needed for some sensors; you can add it later."),
        }

    def __init__(self, *args: Any, by: User, now: datetime, **options: Any) -> None:
        super().__init__(*args, **options)
        self.instance.clinic = clinic_of(by)
        self._by, self._now = by, now
        self.offer_language()
        side = cast("forms.ChoiceField", self.fields["paretic_side"])
        side.required, side.choices = True, SIDES
        self.fields["nickname"].widget.attrs["autofocus"] = True
        if self.instance.is_new:
            clinic = self.instance.clinic
            for purpose in offered_purposes(clinic):
                answers = list_answers(purpose, clinic.boards_across)
                meaning = str(MEANINGS[purpose])
                if purpose == Purpose.BOARDS:
                    meaning += f" {TOTALS_ONLY}"
                self.fields[f"{CONSENT}{purpose}"] = forms.ChoiceField(
                    label=purpose.label,
                    help_text=meaning,
                    choices=[("", _("not asked yet")), *answers],
                    required=False,
                    widget=forms.RadioSelect,
                )

    @property
    def first(self) -> list[forms.BoundField]:
        """The fields that are always shown."""
        return [self[name] for name in FIRST]

    @property
    def more(self) -> list[forms.BoundField]:
        """The fields that can wait."""
        return [field for field in self if field not in [*self.first, *self.consents]]

    @property
    def consents(self) -> list[forms.BoundField]:
        """The questions to a new patient, one per purpose."""
        return [field for field in self if field.name.startswith(CONSENT)]

    def clean(self) -> dict[str, Any]:
        """Return the cleaned data. Refuses a birth or a stroke that is still to come."""
        data: dict[str, Any] = super().clean() or {}
        born, month, today = data.get("birth_year"), data.get("stroke_month"), self._now.date()
        if born is not None and born > today.year:
            self.add_error("birth_year", _("This year is still to come. Give the year of birth."))
        if month is not None and month > today:
            self.add_error("stroke_month", _("This month is still to come. Give a past one."))
        elif month is not None and born is not None and month.year < born:
            self.add_error("stroke_month", _("This is before the birth. Correct one of the two."))
        return data

    def clean_code(self) -> str:
        """Return the code. Refuses one that is taken, with the name of its patient."""
        code: str = self.cleaned_data["code"]
        others = Patient.objects.visible_to(self._by).filter(code=code).exclude(pk=self.instance.pk)
        if (other := others.first()) is not None:
            message = _("Code %(code)s already exists: it is %(nickname)s's.")
            raise ValidationError(message % {"code": code, "nickname": other.nickname})
        return code

    def save(self, commit: bool = True) -> Patient:
        """Store the patient, and a new one's consents."""
        with transaction.atomic():
            patient = super().save(commit)
            for field in self.consents:
                if answer := self.cleaned_data[field.name]:
                    purpose = Purpose(field.name.removeprefix(CONSENT))
                    record_answer(patient, purpose, answer, self._by, self._now)
        return patient


class ScreenForm(_SpokenForm):
    """How the patient's page looks and sounds for this patient."""

    def __init__(self, *args: Any, **options: Any) -> None:
        super().__init__(*args, **options)
        self.offer_language()

    class Meta:
        model = Patient
        fields: ClassVar = [
            "language",
            "screen_side",
            "screen_text",
            "screen_still",
            "screen_sounds",
        ]
        widgets: ClassVar = {"screen_side": forms.RadioSelect, "screen_text": forms.RadioSelect}
        help_texts: ClassVar = {
            "screen_side": _(
                "In one half alone, Pause and Stop are there as well, and words are largest on a "
                "tablet that lies on its side."
            )
        }


class EndProgramForm(forms.Form):
    """Why the program ends."""

    reason = forms.ChoiceField(label=_("Why?"), choices=EndReason.choices, widget=forms.RadioSelect)


class ErasureForm(forms.Form):
    """Why a patient is erased; the code must be typed as confirmation."""

    reason = forms.ChoiceField(
        label=_("Why?"),
        choices=[
            choice for choice in ErasureReason.choices if choice[0] != ErasureReason.RETENTION
        ],
        widget=forms.RadioSelect,
    )
    code = forms.CharField(
        label=_("Type the patient's code again"),
        max_length=32,
        widget=forms.TextInput(attrs={"autocomplete": "off"}),
    )

    def __init__(self, *args: Any, patient: Patient, **options: Any) -> None:
        super().__init__(*args, **options)
        self.label_suffix = ""
        self.patient = patient

    def clean_code(self) -> str:
        """Return the code. Refuses any other than the patient's."""
        code: str = self.cleaned_data["code"]
        if code != self.patient.code:
            message = _("That is not %(patient)s's code. Nothing was erased.")
            raise ValidationError(message % {"patient": self.patient.nickname})
        return code
