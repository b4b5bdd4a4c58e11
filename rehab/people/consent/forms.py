"""The form of the consent text."""

from __future__ import annotations

from collections.abc import Collection
from typing import Any

from django import forms
from django.core.exceptions import ValidationError
from django.utils.translation import gettext
from django.utils.translation import gettext_lazy as _

from rehab.people.consent.services import split_paragraphs


class ConsentTextForm(forms.Form):
    """The text that patients agree to; ``purposes``: how its paragraphs begin."""

    text = forms.CharField(
        label=_("Words"), max_length=10_000, widget=forms.Textarea(attrs={"rows": 18})
    )

    def __init__(self, *args: Any, purposes: Collection[str], **options: Any) -> None:
        super().__init__(*args, **options)
        self.purposes = purposes
        begun = self._beginnings(str(self.initial["text"]))
        kept = " ".join(f"“{purpose}:”" for purpose in purposes if purpose in begun)
        if kept:
            self.fields["text"].help_text = gettext(
                "Keep these words at the beginning of their paragraphs, which stand beside that "
                "answer: %(words)s The others are read out before and after."
            ) % {"words": kept}

    def clean_text(self) -> str:
        """Normalize line ends. Refuses the words in force, and those that lost a beginning."""
        text = str(self.cleaned_data["text"]).replace("\r\n", "\n")
        in_force = str(self.initial["text"])
        if text.strip() == in_force.strip():
            raise ValidationError(gettext("These words are in force already. Change them first."))
        if lost := self._beginnings(in_force) - self._beginnings(text):
            words = ", ".join(f"“{purpose}:”" for purpose in self.purposes if purpose in lost)
            message = gettext("A paragraph that begins with %(words)s is missing: put it back.")
            raise ValidationError(message % {"words": words})
        return text

    def _beginnings(self, text: str) -> set[str]:
        begun = {paragraph.partition(":")[0].strip() for paragraph in split_paragraphs(text)}
        return begun & set(self.purposes)
