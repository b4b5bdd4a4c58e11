"""What people type to come in, and about their own account."""

from __future__ import annotations

from django import forms
from django.core.exceptions import ValidationError
from django.db import IntegrityError, transaction
from django.utils.translation import gettext_lazy as _

from rehab.people.models import Patient


class PatientRowForm(forms.ModelForm):
    """What is written of a patient. Of one who is here it stores its own fields, nothing else."""

    instance: Patient

    def save(self, commit: bool = True) -> Patient:
        """Store the patient. Raises PersonErased, and IntegrityError where a code is taken."""
        if self.instance.is_new:
            patient: Patient = super().save(commit)
            return patient
        self.instance.keep(*self.fields)
        return self.instance

    def keep(self) -> bool:
        """Store the patient, or say in ``errors`` what hinders; whatever others do meanwhile."""
        if not self.is_valid():
            return False
        try:
            with transaction.atomic():
                self.save()
        except ValidationError as problem:
            self.add_error(None, problem)
        except IntegrityError:
            self.full_clean()  # somebody was quicker, and is found now
            if self.is_valid():
                raise
        return self.is_valid()


class ConsentTextForm(forms.Form):
    """The words that patients agree to."""

    text = forms.CharField(
        label=_("Words"), max_length=10_000, widget=forms.Textarea(attrs={"rows": 18})
    )

    def clean_text(self) -> str:
        """Keep line ends as everybody else writes them."""
        return str(self.cleaned_data["text"]).replace("\r\n", "\n")
