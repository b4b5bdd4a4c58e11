"""The form of a leaderboard."""

from __future__ import annotations

from typing import Any

from django import forms
from django.utils.translation import gettext_lazy as _

from rehab.boards.choices import Participants
from rehab.people.web.row_forms import ClinicForm
from rehab.training.valences import VALENCES

MAX_GROUP = 1_000  # the preview's URL contains each key; servers refuse URLs beyond 16 kB


class LeaderboardForm(ClinicForm):
    """All settings of a board on one page; the defaults are safe ones."""

    valences = forms.MultipleChoiceField(
        label=_("Which types"),
        choices=[(valence.slug, _(valence.label)) for valence in VALENCES.values()],
        widget=forms.CheckboxSelectMultiple,
        required=False,
    )

    def clean(self) -> dict[str, Any]:
        """Refuse a group that is too small ever to be shown, or too large to be sent."""
        cleaned: dict[str, Any] = super().clean() or self.cleaned_data
        group = cleaned.get("group")
        if group is not None:
            self.instance.chosen = [patient.pk for patient in group]
        fewest = cleaned.get("min_participants") or 0
        if cleaned.get("among") == Participants.GROUP and len(group or []) < fewest:
            few = _("Choose at least %(fewest)d patients.") % {"fewest": fewest}
            self.add_error("group", few)
        elif len(group or []) > MAX_GROUP:
            many = _("Choose at most %(most)d patients, or all of the clinic.")
            self.add_error("group", many % {"most": MAX_GROUP})
        return cleaned
