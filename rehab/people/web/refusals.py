"""Translation of the errors of the pure rules and of the robot package.

They know no languages: their errors carry an English template and its values.
"""

from __future__ import annotations

from django.utils.formats import number_format
from django.utils.translation import gettext

from robot.marking import OR, AnyOf, Marked, TranslatableError


class _Number(float):
    """A number in the format of the page's language."""

    def __format__(self, spec: str) -> str:
        return number_format(super().__format__(spec))


def format_refusal(problem: TranslatableError) -> str:
    """Return an error in the active language; one without values may be translated already."""
    template = gettext(problem.template)
    if not problem.values:
        return template
    return template.format(**{name: _format_value(value) for name, value in problem.values.items()})


def _format_value(value: object) -> object:
    match value:
        case Marked():
            return gettext(value)
        case AnyOf():
            return f" {gettext(OR)} ".join(map(gettext, value))
        case float():
            return _Number(value)
    return value
