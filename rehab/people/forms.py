"""Forms for patients and for the consent text."""

from __future__ import annotations

from typing import Any

from django import forms
from django.core.exceptions import ValidationError
from django.db import IntegrityError, transaction
from django.utils.translation import gettext_lazy as _

from rehab.people.models import Patient
from rehab.people.ranges import say_ranges


class PatientFieldsForm(forms.ModelForm):
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


class ConsentTextForm(forms.Form):
    """The text that patients agree to."""

    text = forms.CharField(
        label=_("Words"), max_length=10_000, widget=forms.Textarea(attrs={"rows": 18})
    )

    def clean_text(self) -> str:
        """Normalize line ends."""
        return str(self.cleaned_data["text"]).replace("\r\n", "\n")
