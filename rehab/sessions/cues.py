"""What a PT may choose that the robot does: the usual of a feedback type, nothing, or a gesture."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from django.utils.translation import gettext
from django.utils.translation import gettext_lazy as _

from rehab.feedback.clinic_valences import valences_of
from rehab.gestures.choices import gesture_choices
from rehab.gestures.models import Gesture
from rehab.people.models import Patient, User
from rehab.people.web.refusals import in_words
from rehab.training.measures import InvalidSetting
from rehab.training.valences import CueGestures
from robot.gestures import GESTURES, ORIGINALS, BadGesture
from robot.trial import admit_gesture

USUAL, NOTHING = "(usual)", "(nothing)"  # choices beside gestures, none of which has such a name


def list_gestures(by: User) -> list[tuple[str, Any]]:
    """Give the choices with their words."""
    return [
        (USUAL, _("As usual for the feedback type")),
        (NOTHING, _("Nothing")),
        *gesture_choices(by),
    ]


def name_gestures(by: User) -> set[str]:
    """Give every choice that can be made, without its words."""
    composed = Gesture.objects.visible_to(by).values_list("name", flat=True)
    return {USUAL, NOTHING, *GESTURES, *ORIGINALS, *composed}


def to_cue(above: str, below: str, valence: str, patient: Patient) -> CueGestures:
    """Give the cue for two choices, by what is usual in the patient's clinic."""
    usual = valences_of(patient.clinic_id)[valence].cue
    return CueGestures(_gesture(above, usual.above), _gesture(below, usual.below))


def _gesture(choice: str, usual: str | None) -> str | None:
    return usual if choice == USUAL else None if choice == NOTHING else choice


def to_choices(cue: CueGestures, valence: str, patient: Patient, by: User) -> tuple[str, str]:
    """Give the choices for a cue; the usual one for a gesture that is not to be had any more."""
    usual = valences_of(patient.clinic_id)[valence].cue
    composed = Gesture.objects.visible_to(by).values_list("name", flat=True)
    known = {None, *GESTURES, *ORIGINALS, *composed}
    return _choice(cue.above, usual.above, known), _choice(cue.below, usual.below, known)


def _choice(gesture: str | None, usual: str | None, known: set[str | None]) -> str:
    if gesture == usual or gesture not in known:
        return USUAL
    return gesture or NOTHING


def find_composed(patient: Patient, cue: CueGestures) -> Iterator[dict[str, Any]]:
    """Give the gestures of the patient's clinic that a cue names, as they travel to a robot.

    Raises InvalidSetting for a gesture that nobody knows, and for one that no robot would play.
    """
    named = {name for name in (cue.above, cue.below) if name is not None}
    for name in sorted(named - GESTURES.keys() - ORIGINALS.keys()):
        row = Gesture.everywhere.filter(clinic=patient.clinic_id, name=name).first()
        if row is None:
            raise InvalidSetting(
                gettext("There is no gesture %(name)s. Compose it in the admin, or choose another.")
                % {"name": name}
            )
        data = row.to_data()
        try:
            admit_gesture(data)
        except BadGesture as problem:
            raise InvalidSetting(
                gettext("Gesture %(name)s: %(problem)s")
                % {"name": name, "problem": in_words(problem)}
            ) from problem
        yield data


def quiet_cue(cue: CueGestures, usual: CueGestures, chosen: CueGestures) -> CueGestures:
    """Give the cue of a type that a session may be changed to.

    What was silenced for the session, where its type would usually have a gesture, stays silent:
    no change of the feedback makes a robot move that was told to stand still.
    """
    return CueGestures(
        None if usual.above and not chosen.above else cue.above,
        None if usual.below and not chosen.below else cue.below,
    )
