"""The form of a feedback type: its points and gestures, and a row for each band."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from django import forms
from django.core.exceptions import ValidationError
from django.utils.translation import gettext_lazy as _

from rehab.feedback.models import FeedbackBand, FeedbackType
from rehab.people.models import LANGUAGES
from rehab.people.web.refusals import format_refusal
from rehab.people.web.row_forms import ClinicForm
from rehab.training.feedback_bands import TEXT_MAX, Band
from rehab.training.measures import InvalidSetting
from rehab.training.phrases import LENGTHS
from rehab.training.valences import VALENCES

POOL_MAX = 40  # phrases of a band
ABOUT_WORDS = _(
    "One phrase a line; they take turns. If you leave it empty, the default words are shown."
)


def word_fields() -> dict[str, str]:
    """Return the names of the fields for words, each with its language."""
    return {f"words_{language}": language for language, _name in LANGUAGES}


class FeedbackTypeForm(ClinicForm):
    """Points and gestures, where the type has them; the type itself cannot be changed."""

    class Meta:
        model = FeedbackType
        exclude = ("clinic",)
        widgets = {"slug": forms.HiddenInput}

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        fixed = self.instance.pk is not None
        slug = self.instance.slug if fixed else self.initial.get("slug") or self.data.get("slug")
        self.default = VALENCES.get(str(slug))
        fields: dict[str, Any] = self.fields
        if fixed and "slug" in fields:
            fields["slug"].disabled = True
        for name in self.unused_fields():
            fields.pop(name, None)

    def unused_fields(self) -> Iterator[str]:
        """Yield the fields that this type does not use."""
        default = self.default
        if default is None:
            return
        if not default.hit_points:
            yield "hit_points"
        if not default.miss_points:
            yield "miss_points"
        if not default.has_points:
            yield from ("cue_above", "cue_below")

    def _post_clean(self) -> None:
        # Fields that the form leaves out keep their defaults.
        if self.default is not None:
            for name in ("hit_points", "miss_points"):
                if name not in self.fields:
                    setattr(self.instance, name, getattr(self.default, name))
        super()._post_clean()  # type: ignore[misc]  # Django's hook between form and model


class BandForm(forms.ModelForm):
    """A band with its words in each language."""

    class Meta:
        model = FeedbackBand
        fields = ("from_percent", "confetti")

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        for name, language in word_fields().items():
            if self.instance.pk is not None:
                self.initial.setdefault(name, self.instance.words.get(language, ""))
            self.fields[name].widget.attrs |= {
                "lang": language,
                "class": "vTextField",
                "rows": 4,
            }
            if self.instance.pk is not None:  # the words where the clinic writes none
                placeholder = self.instance.default_words(language)
                self.fields[name].widget.attrs["placeholder"] = placeholder
        self.fields[next(iter(word_fields()))].help_text = ABOUT_WORDS

    def clean(self) -> dict[str, Any]:
        """Collect the words of all languages."""
        cleaned: dict[str, Any] = super().clean() or self.cleaned_data
        words = {language: cleaned.get(name, "") for name, language in word_fields().items()}
        for name, language in word_fields().items():
            longest, word = LENGTHS.get(language, LENGTHS["fr"])
            for phrase in words[language].splitlines():
                if len(phrase) > longest or max(map(len, phrase.split()), default=0) > word:
                    message = _(
                        "“%(phrase)s” is too long: at most %(longest)s letters, and %(word)s in a "
                        "word, fit a tablet in the largest size."
                    )
                    values = {"phrase": phrase, "longest": longest, "word": word}
                    self.add_error(name, message % values)
                    break
        self.instance.words = {language: text for language, text in words.items() if text}
        return cleaned


for _field, _language in word_fields().items():
    BandForm.base_fields[_field] = forms.CharField(
        label=dict(LANGUAGES)[_language],
        max_length=POOL_MAX * TEXT_MAX,
        required=False,
        widget=forms.Textarea,
    )
    BandForm.declared_fields[_field] = BandForm.base_fields[_field]


class BandFormSet(forms.BaseInlineFormSet):
    """The bands of one type, which must make a valid valence together with it."""

    def rows_to_store(self) -> list[FeedbackBand]:
        """Return the bands that would be stored, in their order."""
        rows = [
            form.instance
            for form in self.forms
            if form not in self.deleted_forms and (form.instance.pk or form.has_changed())
        ]
        return sorted(rows, key=lambda row: row.from_percent)

    def bands(self, language: str) -> list[Band]:
        """Return them as a valence has them, with words in a language."""
        return [row.to_band(language) for row in self.rows_to_store()]

    def clean(self) -> None:
        """Refuse bands that no valence may have."""
        super().clean()
        if any(self.errors):
            return
        try:
            self.instance.to_valence("en", self.bands("en"))
        except InvalidSetting as problem:
            raise ValidationError(format_refusal(problem)) from problem
