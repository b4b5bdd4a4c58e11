"""The gestures that can be chosen in forms."""

from __future__ import annotations

from typing import Any

from django.utils.translation import gettext_lazy as _

from rehab.gestures.models import ComposedGesture
from rehab.people.models import User
from robot.motion.gestures import GESTURES, ORIGINALS


def gesture_choices(by: User) -> list[tuple[Any, Any]]:
    """Return the robot's own gestures, those composed in the clinic, and the paper's."""
    composed = ComposedGesture.objects.visible_to(by).values_list("name", flat=True)
    return [
        *((gesture.name, _(gesture.label)) for gesture in GESTURES.values()),
        *([(_("Composed here"), [(name, name) for name in composed])] if composed else []),
        (_("Of the paper, up to 10 s"), [(one.name, _(one.label)) for one in ORIGINALS.values()]),
    ]
