"""The form of the consent text."""

from __future__ import annotations

from django import forms
from django.utils.translation import gettext_lazy as _


class ConsentTextForm(forms.Form):
    """The text that patients agree to."""

    text = forms.CharField(
        label=_("Words"), max_length=10_000, widget=forms.Textarea(attrs={"rows": 18})
    )

    def clean_text(self) -> str:
        """Normalize line ends."""
        return str(self.cleaned_data["text"]).replace("\r\n", "\n")
