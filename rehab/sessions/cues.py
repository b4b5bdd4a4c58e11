"""What a PT may choose that the robot does: the usual of a feedback type, nothing, or a gesture."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from rehab.gestures.models import Gesture
from rehab.people.models import Patient, User
from rehab.training.measures import InvalidSetting
from rehab.training.valences import Cue, find_valence
from robot.gestures import GESTURES, ORIGINALS, BadGesture
from robot.trial import admit_gesture

USUAL, NOTHING = "(usual)", "(nothing)"  # choices beside gestures, none of which has such a name


def list_gestures(by: User) -> list[tuple[str, Any]]:
    """Give the choices with their words."""
    composed = Gesture.objects.visible_to(by).values_list("name", flat=True)
    return [
        (USUAL, "As usual for the feedback type"),
        (NOTHING, "Nothing"),
        *((gesture.name, gesture.label) for gesture in GESTURES.values()),
        *([("Composed here", [(name, name) for name in composed])] if composed else []),
        ("Of the paper, up to 10 s", [(one.name, one.label) for one in ORIGINALS.values()]),
    ]


def name_gestures(by: User) -> set[str]:
    """Give every choice that can be made, without its words."""
    composed = Gesture.objects.visible_to(by).values_list("name", flat=True)
    return {USUAL, NOTHING, *GESTURES, *ORIGINALS, *composed}


def to_cue(above: str, below: str, valence: str) -> Cue:
    """Give the cue for two choices."""
    usual = find_valence(valence).cue
    return Cue(_gesture(above, usual.above), _gesture(below, usual.below))


def _gesture(choice: str, usual: str | None) -> str | None:
    return usual if choice == USUAL else None if choice == NOTHING else choice


def to_choices(cue: Cue, valence: str, by: User) -> tuple[str, str]:
    """Give the choices for a cue; the usual one for a gesture that is not to be had any more."""
    usual = find_valence(valence).cue
    composed = Gesture.objects.visible_to(by).values_list("name", flat=True)
    known = {None, *GESTURES, *ORIGINALS, *composed}
    return _choice(cue.above, usual.above, known), _choice(cue.below, usual.below, known)


def _choice(gesture: str | None, usual: str | None, known: set[str | None]) -> str:
    if gesture == usual or gesture not in known:
        return USUAL
    return gesture or NOTHING


def find_composed(patient: Patient, cue: Cue) -> Iterator[dict[str, Any]]:
    """Give the gestures of the patient's clinic that a cue names, as they travel to a robot.

    Raises InvalidSetting for a gesture that nobody knows, and for one that no robot would play.
    """
    named = {name for name in (cue.above, cue.below) if name is not None}
    for name in sorted(named - GESTURES.keys() - ORIGINALS.keys()):
        row = Gesture.everywhere.filter(clinic=patient.clinic_id, name=name).first()
        if row is None:
            raise InvalidSetting(f"There is no gesture {name}. Compose it in the admin first.")
        data = row.to_data()
        try:
            admit_gesture(data)
        except BadGesture as problem:
            raise InvalidSetting(f"Gesture {name}: {problem}") from problem
        yield data
