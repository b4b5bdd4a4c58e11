"""The feedback types that a clinic edited. Types without a row have the defaults."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

from django.core.exceptions import ValidationError
from django.db import models
from django.dispatch import Signal
from django.utils.text import format_lazy
from django.utils.translation import gettext_lazy as _

from rehab.feedback.translation import SOURCE_LANGUAGE, pick_words, valence_choices
from rehab.people.models import Clinic
from rehab.people.ranges import between
from rehab.people.scope import ClinicModel, Scope, ScopedModel
from rehab.people.web.refusals import format_refusal
from rehab.training.feedback_bands import Band, Confetti
from rehab.training.measures import InvalidSetting
from rehab.training.valences import POINTS_MAX, VALENCES, CueGestures, Valence, edit_valence

# Sent with ``row`` (a FeedbackType, or None where a clinic went back to the defaults),
# ``clinic_id``, ``slug`` and ``by``. Receivers return the problems they met, as texts.
feedback_text_edited = Signal()


class FeedbackType(ClinicModel):
    """A clinic's own points, words, confetti and gestures for one valence."""

    scope = Scope(clinic="clinic")

    clinic = models.ForeignKey(
        Clinic, on_delete=models.CASCADE, related_name="feedback_types", verbose_name=_("clinic")
    )
    slug = models.CharField(
        _("feedback type"),
        max_length=16,
        choices=valence_choices,
    )
    hit_points = models.SmallIntegerField(
        _("points at the goal"),
        null=True,
        blank=True,
        help_text=format_lazy(_("For a step at or above the goal, 1 to {most}."), most=POINTS_MAX),
    )
    miss_points = models.SmallIntegerField(
        _("points below the goal"),
        null=True,
        blank=True,
        help_text=format_lazy(_("For a step below the goal, −1 to −{most}."), most=POINTS_MAX),
    )
    cue_above = models.CharField(_("robot, after five strong seconds"), max_length=32, blank=True)
    cue_below = models.CharField(_("robot, after five weak seconds"), max_length=32, blank=True)

    class Meta(ClinicModel.Meta):
        verbose_name = _("feedback type")
        verbose_name_plural = _("feedback types")
        ordering: ClassVar = ["pk"]
        constraints: ClassVar = [
            models.UniqueConstraint(fields=["clinic", "slug"], name="feedback_type_once_per_clinic")
        ]

    def __str__(self) -> str:
        return str(self.get_slug_display())

    def clean(self) -> None:
        """Refuse points and gestures that no valence may have."""
        try:
            self.to_valence("en", VALENCES[self.slug].bands)
        except KeyError:
            raise ValidationError({"slug": _("There is no such feedback type.")}) from None
        except InvalidSetting as problem:
            raise ValidationError(format_refusal(problem)) from problem

    def to_valence(self, language: str, bands: Sequence[Band] | None = None) -> Valence:
        """Return the valence, with words in a language; with its stored bands unless given.

        Raises InvalidSetting for points, bands or gestures that no valence may have.
        """
        if bands is None:
            rows = sorted(self.bands.all(), key=lambda band: band.from_percent)
            bands = [band.to_band(language) for band in rows]
        return edit_valence(
            self.slug,
            hit_points=self.hit_points,
            miss_points=self.miss_points,
            bands=bands,
            cue=CueGestures(self.cue_above or None, self.cue_below or None),
        )


class FeedbackBand(ScopedModel):
    """The words and confetti from a performance upwards."""

    scope = Scope(clinic="feedback_type__clinic")

    feedback_type = models.ForeignKey(
        FeedbackType,
        on_delete=models.CASCADE,
        related_name="bands",
        verbose_name=_("feedback type"),
    )
    from_percent = models.PositiveSmallIntegerField(
        _("from, % of the goal"), validators=between(most=1000, unit="%")
    )
    words = models.JSONField(_("words"), default=dict, blank=True)
    confetti = models.CharField(
        _("confetti"),
        max_length=8,
        choices=[
            (Confetti.NONE.value, _("none")),
            (Confetti.LITTLE.value, _("a little")),
            (Confetti.MUCH.value, _("much")),
            (Confetti.MOST.value, _("the most")),
        ],
        default=Confetti.NONE.value,
    )

    class Meta(ScopedModel.Meta):
        verbose_name = _("band")
        verbose_name_plural = _("bands")
        ordering: ClassVar = ["feedback_type", "from_percent"]
        constraints: ClassVar = [
            models.UniqueConstraint(
                fields=["feedback_type", "from_percent"], name="feedback_band_once_per_type"
            )
        ]

    def __str__(self) -> str:
        return str(_("from %(percent)s %%") % {"percent": self.from_percent})

    def to_band(self, language: str) -> Band:
        """Return the valence's band, with words in a language."""
        words = self.words.get(language) or self.default_words(language)
        return Band(self.from_percent / 100, words, Confetti(self.confetti))

    def default_words(self, language: str) -> str:
        """Return the words in a language in which the clinic wrote none."""
        default = VALENCES[self.feedback_type.slug].band(self.from_percent / 100).words
        others = {SOURCE_LANGUAGE: self.words.get(SOURCE_LANGUAGE, "")}
        return pick_words(language, {} if language == SOURCE_LANGUAGE else others, default)
