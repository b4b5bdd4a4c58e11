"""Changes of a session as text, for every control alike (``rehab.training.controls``)."""

from __future__ import annotations

from typing import Any

from django.utils.translation import gettext

from rehab.sessions.formatting import format_number, format_quantity, format_rate
from rehab.training.changes import ChangeValue
from rehab.training.controls import CONTROLS, TYPE_MARK, ChartMark, Choices, Control, ValueFormat
from rehab.training.plans import SessionPlan


def describe_change(
    control: Control, old: ChangeValue, value: ChangeValue, plan: SessionPlan
) -> str:
    """Return a change as text: what it was, and from which value to which."""
    label = gettext(control.review_label)
    new = _format_value(control, control.value_format, control.part_shown(value), plan)
    if not control.shows_old:
        return f"{label}{control.joint}{new}" if new else label
    if old is None:
        return f"{label} {new}"
    # The unit stands once, behind the new value.
    with_unit = control.value_format is ValueFormat.QUANTITY
    old_format = ValueFormat.NUMBER if with_unit else control.value_format
    return f"{label} {_format_value(control, old_format, control.part_shown(old), plan)} → {new}"


def _format_value(control: Control, style: ValueFormat, value: Any, plan: SessionPlan) -> str:
    match style:
        case ValueFormat.NUMBER:
            return format_number(value)
        case ValueFormat.QUANTITY:
            return format_quantity(value, plan.measure.unit)
        case ValueFormat.PERCENT:
            return format_rate(value)
        case ValueFormat.CHOICE:
            if value in control.choices:
                return gettext(control.choices[value])
            return "" if value is None else str(value)
        case ValueFormat.PHASE:
            return gettext(plan.phases[int(value or 0)].name)
        case ValueFormat.NONE:
            return ""


def chart_marks() -> dict[str, dict[str, Any]]:
    """Return how charts point out changes, by kind, in the page's language (for its scripts)."""
    marks = {kind: control.mark for kind, control in CONTROLS.items()} | {"type": TYPE_MARK}
    return {str(kind): _describe_mark(mark) for kind, mark in marks.items() if mark is not None}


def _describe_mark(mark: ChartMark) -> dict[str, Any]:
    return {
        "badge": mark.badge,
        "label": gettext(mark.label),
        "format": mark.value_format.value,
        "choices": _translate(mark.choices),
    }


def _translate(choices: Choices) -> dict[str, str]:
    """Return the labels of values, numbers as a script writes them: 1, 0.5."""
    return {
        value if isinstance(value, str) else f"{value:g}": gettext(label)
        for value, label in choices.items()
    }
