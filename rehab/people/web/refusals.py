"""What the pure rules and the robot's room refuse, said in the language of the page.

They know no languages: their refusals carry an English sentence with places and what stands there.
"""

from __future__ import annotations

from django.utils.formats import number_format
from django.utils.translation import gettext

from rehab.training import marking
from rehab.training.measures import InvalidSetting
from robot.motion import gesture_errors


class _Number(float):
    """A number that is written as the page's language writes it."""

    def __format__(self, spec: str) -> str:
        return number_format(super().__format__(spec))


def in_words(problem: InvalidSetting | gesture_errors.BadGesture) -> str:
    """Say a refusal in the language in force; what was said in a language before stays as it is."""
    said = gettext(problem.template)
    if not problem.values:
        return said
    return said.format(**{name: _say(value) for name, value in problem.values.items()})


def _say(value: object) -> object:
    match value:
        case marking.Marked() | gesture_errors.Marked():
            return gettext(value)
        case marking.AnyOf():
            return f" {gettext(marking.OR)} ".join(map(gettext, value))
        case float():
            return _Number(value)
    return value
