"""The gestures that can be chosen in forms."""

from __future__ import annotations

from typing import Any

from django.utils.text import format_lazy
from django.utils.translation import gettext_lazy as _

from rehab.gestures.models import ComposedGesture
from rehab.people.models import User
from robot.motion.gesture_variants import POOLS, TABLE
from robot.motion.gestures import GESTURES, ORIGINALS
from robot.wire.cue_limits import VARIED


def gesture_choices(by: User) -> list[tuple[Any, Any]]:
    """Return the robot's own gestures and pools, those composed in the clinic, and the paper's."""
    composed = ComposedGesture.objects.visible_to(by).values_list("name", flat=True)
    pools = [(name, format_lazy(_("{pool}, varied"), pool=_(TABLE[name].label))) for name in POOLS]
    variants = [
        (gesture.name, format_lazy("{} {}", _(TABLE[name].label), number))
        for name, pool in POOLS.items()
        for number, gesture in enumerate(pool, start=1)
    ]
    return [
        (VARIED, _("Varied, by how the patient walks")),
        *((gesture.name, _(gesture.label)) for gesture in GESTURES.values()),
        *([(_("Composed here"), [(name, name) for name in composed])] if composed else []),
        (_("Varied within one kind"), pools),
        (_("The same each time"), variants),
        (_("Of the paper, up to 10 s"), [(one.name, _(one.label)) for one in ORIGINALS.values()]),
    ]
