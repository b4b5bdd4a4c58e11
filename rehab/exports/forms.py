"""What is asked before a patient's time with GARRY ends."""

from __future__ import annotations

from typing import Any

from django import forms
from django.core.exceptions import ValidationError
from django.utils.translation import gettext_lazy as _

from rehab.people.models import Ending, Erasing, Patient


class EndingForm(forms.Form):
    """Why the program ends."""

    because = forms.ChoiceField(
        label=_("Why?"), choices=Ending.choices, initial=Ending.DONE, widget=forms.RadioSelect
    )


class ErasingForm(forms.Form):
    """Why a patient is erased; the code, typed once more, says that it is meant."""

    because = forms.ChoiceField(
        label=_("Why?"),
        choices=[choice for choice in Erasing.choices if choice[0] != Erasing.RETENTION],
        widget=forms.RadioSelect,
    )
    code = forms.CharField(
        label=_("The patient's code, once more"),
        max_length=32,
        widget=forms.TextInput(attrs={"autocomplete": "off"}),
    )

    def __init__(self, *args: Any, patient: Patient, **options: Any) -> None:
        super().__init__(*args, **options)
        self.label_suffix = ""
        self.patient = patient

    def clean_code(self) -> str:
        """Refuse any other code."""
        code: str = self.cleaned_data["code"]
        if code != self.patient.code:
            said = _("That is not %(patient)s's code. Nothing was erased.")
            raise ValidationError(said % {"patient": self.patient.nickname})
        return code
