"""The form that a leaderboard is built in."""

from __future__ import annotations

from typing import Any

from django import forms
from django.utils.translation import gettext_lazy as _

from rehab.boards.models import Leaderboard
from rehab.people.web.admin_base import ClinicForm
from rehab.training.valences import VALENCES

MOST_IN_GROUP = 1_000  # the preview's address names each, and servers refuse those beyond 16 kB


class LeaderboardForm(ClinicForm):
    """All of a board on one page; what is left as it is makes a safe one."""

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
        if cleaned.get("among") == Leaderboard.Among.GROUP and len(group or []) < fewest:
            few = _("Choose at least %(fewest)d patients.") % {"fewest": fewest}
            self.add_error("group", few)
        elif len(group or []) > MOST_IN_GROUP:
            many = _("Choose at most %(most)d patients, or all of the clinic.")
            self.add_error("group", many % {"most": MOST_IN_GROUP})
        return cleaned
