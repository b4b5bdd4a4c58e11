"""The part of set-ups that says how somebody walks: device, belt speed, body-weight support."""

from __future__ import annotations

from django import forms
from django.utils.translation import gettext_lazy as _

from rehab.people.ranges import NumberField
from rehab.sessions.setup.walking import (
    BELT_M_S,
    MAX_DEVICE_LETTERS,
    SUPPORT_PERCENT,
    WalkingConditions,
)


class WalkingFields(forms.Form):
    """How somebody walks. All of it may be left empty."""

    device = forms.CharField(
        label=_("Device (treadmill, orthosis, cane …)"),
        max_length=MAX_DEVICE_LETTERS,
        required=False,
    )
    belt_speed = NumberField(
        label=_("Belt speed, m/s"),
        least=BELT_M_S[0],
        most=BELT_M_S[1],
        unit="m/s",
        required=False,
    )
    weight_support = NumberField(
        label=_("Body-weight support, %"),
        least=SUPPORT_PERCENT[0],
        most=SUPPORT_PERCENT[1],
        unit="%",
        required=False,
    )

    def chosen_walking(self) -> WalkingConditions:
        """Return what was given, once the form is valid."""
        data = self.cleaned_data
        return WalkingConditions(
            data.get("device", ""), data.get("belt_speed"), data.get("weight_support")
        )
