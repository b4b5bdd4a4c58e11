"""The set-up options that say how the patient walks."""

from __future__ import annotations

from django.utils.translation import gettext_lazy as _

from rehab.sessions.setup.option import Group, Option, OptionColumn
from rehab.sessions.setup.walking_conditions import (
    BELT_M_S,
    MAX_DEVICE_LETTERS,
    SUPPORT_PERCENT,
)
from rehab.training.heart_rate_limit import LIMIT_RANGE

WALKING_OPTIONS = (
    Option(
        name="device",
        label=_("Device (treadmill, orthosis, cane …)"),
        help="What the patient walks on or with.",
        default="",
        max_length=MAX_DEVICE_LETTERS,
        place="walking.device",
        group=Group.WALKING,
        is_of_patient=True,
        column=OptionColumn("device", "", "What the patient walked on or with."),
    ),
    Option(
        name="belt_speed",
        label=_("Belt speed, m/s"),
        help="Of the treadmill.",
        kind=float,
        nullable=True,
        least=BELT_M_S[0],
        most=BELT_M_S[1],
        unit="m/s",
        place="walking.belt_speed_m_s",
        group=Group.WALKING,
        is_of_patient=True,
        column=OptionColumn("belt_speed", "m/s", "Speed of the treadmill's belt."),
    ),
    Option(
        name="weight_support",
        label=_("Body-weight support, %"),
        help="Percent of the body's weight.",
        kind=float,
        nullable=True,
        least=SUPPORT_PERCENT[0],
        most=SUPPORT_PERCENT[1],
        unit="%",
        place="walking.weight_support_percent",
        group=Group.WALKING,
        is_of_patient=True,
        column=OptionColumn("weight_support", "%", "Body weight that a harness carried."),
    ),
    Option(
        name="heart_rate_limit",
        label=_("Pause above a heart rate of, per minute"),
        help="A stride with a higher heart rate pauses the session; needs a heart-rate sensor.",
        kind=int,
        nullable=True,
        least=LIMIT_RANGE[0],
        most=LIMIT_RANGE[1],
        unit=_("per minute"),
        place="heart_rate_limit",
        group=Group.WALKING,
        is_of_patient=True,
        column=OptionColumn("heart_rate_limit", "1/min", "Heart rate that pauses the session."),
    ),
)
