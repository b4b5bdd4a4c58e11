"""What is asked of a plan so that the number of its participants follows."""

from __future__ import annotations

from typing import Any

from django import forms
from django.utils.translation import gettext_lazy as _

from rehab.people.ranges import NumberField
from rehab.studies.allocation.crossover import crossover_groups
from rehab.studies.registration.size import find_size

CROSSED = "correlation"
# What a study stores of its assumptions: the field, and how many of its unit are 1.
STORED = {
    "difference": ("difference", 1),
    "power": ("power_percent", 100),
    "dropout": ("dropout_percent", 100),
    CROSSED: ("correlation", 1),
}


class AssumedForm(forms.Form):
    """What the number of participants rests on; planned SD, margin and crossover are the study's.

    All is in the outcome's unit, or in percent.
    """

    difference = NumberField(
        label=_("difference that matters"),
        required=False,
        help_text=_("Between arms, of the primary outcome, in its unit."),
    )
    power_percent = NumberField(label=_("power (%)"), initial=80, required=False)
    dropout_percent = NumberField(label=_("leave before the end (%)"), initial=10, required=False)
    correlation = NumberField(
        label=_("correlation within people"),
        initial=0.5,
        required=False,
        help_text=_("Of a person’s outcomes in two arms, from 0 to 1."),
    )

    @property
    def is_crossover(self) -> bool:
        """Whether everybody walks every arm."""
        return bool(self.cleaned_data.get("crossover"))

    @property
    def assumed(self) -> dict[str, float]:
        """What a study stores of it."""
        data = self.cleaned_data
        names = {key: one for key, one in STORED.items() if self.is_crossover or key != CROSSED}
        given = {key: (data.get(name), of) for key, (name, of) in names.items()}
        return {key: value / of for key, (value, of) in given.items() if value is not None}

    @property
    def plan(self) -> dict[str, Any]:
        """All that a size rests on, as `read_assumed` takes it."""
        found = {name: self.cleaned_data.get(name) for name in ("planned_sd", "margin")}
        return found | {"assumed": self.assumed}


class SizeForm(AssumedForm):
    """All of a plan that its size rests on, as it is being typed."""

    planned_sd = NumberField(required=False)
    margin = NumberField(required=False)
    crossover = forms.BooleanField(required=False)

    def tell(self, weights: list[int]) -> tuple[str, int | None]:
        """Return how many participants are needed, in words and as a number, of these arms.

        Nothing is said while something is missing. Raises InvalidSetting for what has no size.
        """
        groups = [(weight, 1) for weight in weights]
        if self.is_crossover:
            orders = crossover_groups("ABCDEFGH"[: len(weights)])
            groups = [(order.weight, len(order.arms)) for order in orders]
        found = find_size(self.plan, groups)
        return (found[1], found[0].enrolled) if found else ("", None)
