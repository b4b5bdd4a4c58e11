"""The choices of a robot's gestures: the default of a valence, none, or a certain gesture."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from django.utils.translation import gettext
from django.utils.translation import gettext_lazy as _

from rehab.feedback.clinic_valences import valences_of
from rehab.gestures.choices import gesture_choices
from rehab.gestures.models import ComposedGesture
from rehab.people.models import Patient, User
from rehab.people.web.refusals import format_refusal
from rehab.training.measures import InvalidSetting
from rehab.training.valences import CueGestures
from robot.motion.dry_run import validate_gesture
from robot.motion.gesture_errors import BadGesture
from robot.motion.gesture_variants import POOLS, VARIANTS
from robot.motion.gestures import GESTURES, ORIGINALS, known_names
from robot.wire.cue_limits import VARIED

# Choices beside gestures, whose names have no parentheses.
DEFAULT_GESTURE, NO_GESTURE = "(usual)", "(nothing)"
# For programs; the variants of a pool are joy_1, joy_2, …
GESTURE_NAMES = (
    f"{DEFAULT_GESTURE}, {NO_GESTURE}, {VARIED}, one composed in the clinic, a pool "
    f"({', '.join(POOLS)}), one of its variants ({next(iter(VARIANTS))}, …), or one of: "
    f"{', '.join((*GESTURES, *ORIGINALS))}."
)


def robot_gesture_choices(by: User) -> list[tuple[str, Any]]:
    """Return the choices with their labels."""
    return [
        (DEFAULT_GESTURE, _("As usual for the feedback type")),
        (NO_GESTURE, _("Nothing")),
        *gesture_choices(by),
    ]


def known_gesture_choices(by: User) -> set[str]:
    """Return all choices without their labels."""
    composed = ComposedGesture.objects.visible_to(by).values_list("name", flat=True)
    return {DEFAULT_GESTURE, NO_GESTURE, *known_names(), *composed}


def cue_from_choices(above: str, below: str, valence: str, patient: Patient) -> CueGestures:
    """Return the cue for two choices, with the defaults of the patient's clinic."""
    default = valences_of(patient.clinic_id)[valence].cue
    return CueGestures(_gesture(above, default.above), _gesture(below, default.below))


def _gesture(choice: str, default: str | None) -> str | None:
    return default if choice == DEFAULT_GESTURE else None if choice == NO_GESTURE else choice


def choices_from_cue(cue: CueGestures, valence: str, patient: Patient, by: User) -> tuple[str, str]:
    """Return the choices for a cue; the default for a gesture that was deleted."""
    default = valences_of(patient.clinic_id)[valence].cue
    composed = ComposedGesture.objects.visible_to(by).values_list("name", flat=True)
    known = {None, *known_names(), *composed}
    return _choice(cue.above, default.above, known), _choice(cue.below, default.below, known)


def _choice(gesture: str | None, default: str | None, known: set[str | None]) -> str:
    if gesture == default or gesture not in known:
        return DEFAULT_GESTURE
    return gesture or NO_GESTURE


def composed_gestures(patient: Patient, cue: CueGestures) -> Iterator[dict[str, Any]]:
    """Yield the composed gestures of the patient's clinic that a cue names, as sent to a robot.

    Raises InvalidSetting for an unknown gesture, and for one that no robot would play.
    """
    named = {name for name in (cue.above, cue.below) if name is not None}
    for name in sorted(named - known_names()):
        row = ComposedGesture.everywhere.filter(clinic=patient.clinic_id, name=name).first()
        if row is None:
            raise InvalidSetting(
                gettext("There is no gesture %(name)s. Compose it in the admin, or choose another.")
                % {"name": name}
            )
        data = row.to_data()
        try:
            validate_gesture(data)
        except BadGesture as problem:
            raise InvalidSetting(
                gettext("Gesture %(name)s: %(problem)s")
                % {"name": name, "problem": format_refusal(problem)}
            ) from problem
        yield data


def silence_cue(cue: CueGestures, default: CueGestures, chosen: CueGestures) -> CueGestures:
    """Return the cue of another valence that a session may be changed to.

    Where the PT chose no gesture although ``default`` has one, the result has none either: a robot
    that was set to stand still must not move after a change of the feedback.
    """
    return CueGestures(
        None if default.above and not chosen.above else cue.above,
        None if default.below and not chosen.below else cue.below,
    )
