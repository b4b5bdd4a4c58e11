"""Checks of what a JSON frame holds."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Mapping
from typing import Any, NoReturn

from robot.wire.limits import MAX_FRAME_BYTES, MAX_NAME_CHARS

MAX_NESTING = 8  # of objects and lists in a report
NAME = re.compile(rf"[A-Za-z0-9_.:-]{{1,{MAX_NAME_CHARS}}}")
# What no text in a database may hold: NUL, and single halves of surrogate pairs (a whole pair is
# one character). Only an escape can write them.
NO_TEXT = re.compile("[\0\ud800-\udfff]")


class BadFrame(ValueError):
    """A frame that breaks the protocol; the message says what to send instead.

    Parameters
    ----------
    message
        The cure, for people.
    code
        The ``code`` of the ``error`` message that answers it.
    """

    def __init__(self, message: str, code: str = "bad_frame") -> None:
        super().__init__(message)
        self.code = code


def _refuse_constant(name: str) -> NoReturn:
    raise BadFrame(f"{name} is not JSON. Send null for a missing value.")


_decode = json.JSONDecoder(parse_constant=_refuse_constant).decode


def read_object(text: str | None) -> dict[str, Any]:
    """Return a frame as a JSON object with a type.

    Raises
    ------
    BadFrame
        For a binary frame (None), one that is too long, and anything but such an object; also for
        NaN and Infinity, which JSON does not know.
    """
    if text is None:
        raise BadFrame("Send text frames, not binary ones.")
    if len(text) > MAX_FRAME_BYTES:
        raise BadFrame(f"A frame has at most {MAX_FRAME_BYTES} characters; send smaller ones.")
    try:
        message = _decode(text)
    except BadFrame:
        raise
    except (ValueError, RecursionError):
        raise BadFrame("A frame is one JSON object, as /help/protocol/ shows.") from None
    if not isinstance(message, dict) or not isinstance(message.get("type", ""), str):
        raise BadFrame('A frame is a JSON object with a "type".')
    return message


def read_name(message: Mapping[str, Any], name: str) -> str:
    """Return the field ``name`` of ``message``, which holds a short name. Raises BadFrame."""
    value = message.get(name)
    if not isinstance(value, str) or not NAME.fullmatch(value):
        raise BadFrame(f'"{name}" is a text of 1 to {MAX_NAME_CHARS} letters, digits or _ . : -')
    return value


def read_whole(message: Mapping[str, Any], name: str, *, low: int, high: int = 2**31 - 1) -> int:
    """Return a whole number of a message, from ``low`` to ``high``. Raises BadFrame.

    Parameters
    ----------
    message
        The message.
    name
        The field's name.
    low, high
        The least and the largest number, included.
    """
    value = message.get(name)
    if not isinstance(value, int) or isinstance(value, bool) or not low <= value <= high:
        upto = f"{low} or more" if high == 2**31 - 1 else f"{low} to {high}"
        raise BadFrame(f'"{name}" is a whole number of {upto}.')
    return value


def to_number(value: Any, low: float = -math.inf, high: float = math.inf) -> float | None:
    """Return a value as a finite number within bounds; None for anything else.

    Parameters
    ----------
    value
        Any JSON value; true and false are no numbers.
    low, high
        The least and the largest number, included.
    """
    if not isinstance(value, int | float) or isinstance(value, bool):
        return None
    try:
        number = float(value)
    except OverflowError:
        return None
    return number if math.isfinite(number) and low <= number <= high else None


def read_number(
    message: Mapping[str, Any], name: str, low: float = -math.inf, high: float = math.inf
) -> float:
    """Return a finite number of a message.

    Parameters
    ----------
    message
        The message.
    name
        The field's name.
    low, high
        The least and the largest number, included.

    Raises
    ------
    BadFrame
        For anything else.
    """
    number = to_number(message.get(name), low, high)
    if number is not None:
        return number
    if math.isinf(low) and math.isinf(high):
        raise BadFrame(f'"{name}" is a finite number.')
    raise BadFrame(f'"{name}" is a number from {low:g} to {high:g}.')


def read_flag(message: Mapping[str, Any], name: str) -> bool:
    """Return a field that is true or false; a missing one is false. Raises BadFrame."""
    value = message.get(name, False)
    if not isinstance(value, bool):
        raise BadFrame(f'"{name}" is true or false.')
    return value


def check_values(value: Any, depth: int = MAX_NESTING) -> None:
    """Check that a value can be passed on.

    Parameters
    ----------
    value
        Any JSON value. Numbers have to be finite, and texts without characters that no database
        stores.
    depth
        How deep objects and lists may nest.

    Raises
    ------
    BadFrame
        For any other value.
    """
    if isinstance(value, str) and NO_TEXT.search(value):
        raise BadFrame("Texts hold no NUL and no half of a surrogate pair. Leave it out.")
    if isinstance(value, float) and not math.isfinite(value):
        raise BadFrame("Numbers are finite. Send null for a missing value.")
    if isinstance(value, dict | list):
        if not depth:
            raise BadFrame(f"Objects and lists nest at most {MAX_NESTING} deep here.")
        for item in (*value, *value.values()) if isinstance(value, dict) else value:
            check_values(item, depth - 1)
