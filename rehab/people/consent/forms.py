"""The form of the consent text."""

from __future__ import annotations

from collections.abc import Collection
from typing import Any

from django import forms
from django.utils.translation import gettext
from django.utils.translation import gettext_lazy as _


class ConsentTextForm(forms.Form):
    """The text that patients agree to; ``purposes``: how its paragraphs begin."""

    text = forms.CharField(
        label=_("Words"), max_length=10_000, widget=forms.Textarea(attrs={"rows": 18})
    )

    def __init__(self, *args: Any, purposes: Collection[str], **options: Any) -> None:
        super().__init__(*args, **options)
        self.fields["text"].help_text = gettext(
            "A paragraph that begins with one of these words stands beside that answer: %(words)s "
            "The others are read out before and after."
        ) % {"words": " ".join(f"“{purpose}:”" for purpose in purposes)}

    def clean_text(self) -> str:
        """Normalize line ends."""
        return str(self.cleaned_data["text"]).replace("\r\n", "\n")
