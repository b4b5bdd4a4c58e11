"""Rows with named cells, and how a stride is read from one."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from rehab.training.steps import InvalidReason, Measurement, Side
from robot.wire.frames import NAME
from robot.wire.limits import MAX_EXTRA, MAX_REASONS, TIME_MAX_S

Cell = float | str | None

VALUE = "value"
TIMES = ("time_s", "time", "t")
# Cells of a stride that are not sent as extra values.
_KNOWN = frozenset({VALUE, "side", "valid", "reason", "number", *TIMES})
_SIDES = {"l": Side.LEFT, "left": Side.LEFT, "r": Side.RIGHT, "right": Side.RIGHT}
_NO = frozenset({"0", "0.0", "false", "no"})


class BadRow(ValueError):
    """A row that cannot be used; the message says how to send it."""


def read_number(cells: Mapping[str, Cell], name: str) -> float | None:
    """Return a cell's number, None where it is blank. Raises BadRow for text."""
    cell = cells.get(name)
    if isinstance(cell, str):
        raise BadRow(f"{name} is {cell[:40]!r}, which is no number. Send a number or nothing.")
    return cell


def read_time(cells: Mapping[str, Cell], name: str) -> float:
    """Return a row's time [s]. Raises BadRow where there is none."""
    time_s = read_number(cells, name)
    if time_s is None or not -TIME_MAX_S <= time_s <= TIME_MAX_S:
        raise BadRow(
            f"{name} is {'missing' if time_s is None else f'{time_s:g}'}, which is no time in "
            "seconds. Send the device's own clock, in seconds."
        )
    return time_s


def read_sample(
    cells: Mapping[str, Cell], time: str, names: Sequence[str]
) -> tuple[float, list[float | None]]:
    """Return a sample's time, and the cells of these names. Raises BadRow."""
    if time not in cells:
        raise BadRow(
            f"Samples come without {time}. Send the device's own time in seconds: when they arrive "
            "says too little."
        )
    return read_time(cells, time), [read_number(cells, name) for name in names]


def read_stride(
    cells: Mapping[str, Cell], number: int, side: Side, now_s: float
) -> tuple[Measurement, list[str]]:
    """Return the stride in a row, and the names of cells that cannot be sent with it.

    Parameters
    ----------
    cells
        ``value``, and as far as there are any ``time_s`` [s], ``side``, ``valid``, ``reason``; all
        others are further named values.
    number
        Of the stride.
    side, now_s
        For rows without a side, or without a time.

    Raises
    ------
    BadRow
        For a row that cannot be a stride.
    """
    value = read_number(cells, VALUE)
    time_name = next((name for name in TIMES if name in cells), None)
    reasons = _read_reasons(cells)
    excluded = []
    extra: dict[str, float] = {}
    for name, cell in cells.items():
        if name in _KNOWN or cell is None:
            continue
        if not NAME.fullmatch(name) or isinstance(cell, str) or len(extra) >= MAX_EXTRA:
            excluded.append(name)
        elif math.isfinite(cell):
            extra[name] = cell
    stride = Measurement(
        number=number,
        time_s=now_s if time_name is None else read_time(cells, time_name),
        side=_read_side(cells.get("side"), side),
        value=None if value is None or math.isnan(value) else value,
        reasons=reasons,
        extra=extra,
    )
    return stride, excluded


def _read_side(cell: Cell, side: Side) -> Side:
    if cell is None:
        return side
    named = _SIDES.get(str(cell).lower())
    if named is None:
        raise BadRow(f"{str(cell)[:40]!r} is no leg. Send left or right as side.")
    return named


def _read_reasons(cells: Mapping[str, Cell]) -> tuple[str, ...]:
    """Return the reasons why the sender calls the stride invalid."""
    reasons = tuple(str(cells.get("reason") or "").split())
    if not all(NAME.fullmatch(reason) for reason in reasons):
        raise BadRow("A reason is a word of letters, digits or _, with blanks between several.")
    is_doubted = str(cells.get("valid", "")).lower() in _NO
    if is_doubted and not reasons:
        return (InvalidReason.FLAGGED,)
    return reasons[:MAX_REASONS]
