"""Reads the steps of a source: checked as the other frames are (messages.py)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Literal

import msgspec

from rehab.sessions.live.protocol.messages import read_flag_if_there
from rehab.training.steps import InvalidMeasurement, Measurement, Side
from robot.wire.frames import NAME, BadFrame, read_name, read_number, read_whole
from robot.wire.limits import MAX_EXTRA, MAX_FRAME_BYTES, MAX_REASONS, MAX_STEPS

Message = Mapping[str, Any]


# 64 bits, as the database has them; the error of read_steps has the cure for more.
_Whole = Annotated[int, msgspec.Meta(ge=-(2**63), le=2**63 - 1)]
_Name = Annotated[str, msgspec.Meta(pattern=rf"\A(?:{NAME.pattern})\Z")]


class _StepFrame(msgspec.Struct):
    """A frame of one step without faults, as most are: checked while it is read, in C."""

    type: Literal["step"]
    number: Annotated[int, msgspec.Meta(ge=1, lt=2**31)]
    time_s: float
    side: Side
    value: float | None = None
    reasons: tuple[()] = ()
    extra: Annotated[dict[_Name, _Whole | float], msgspec.Meta(max_length=MAX_EXTRA)] = {}
    late: bool = False


_decode_step = msgspec.json.Decoder(_StepFrame).decode


def read_single_step(text: str) -> Measurement | None:
    """Return a frame's step, the same as ``read_steps`` does.

    None for any other frame, also for one of a step with a fault (``read_steps`` names it), and
    for one that its source calls late.
    """
    if len(text) > MAX_FRAME_BYTES:
        return None
    try:
        step = _decode_step(text)
    except (msgspec.MsgspecError, RecursionError, UnicodeError):
        return None
    if step.late:
        return None
    try:
        return Measurement(step.number, step.time_s, step.side, step.value, (), step.extra)
    except InvalidMeasurement:
        return None


def read_steps(message: Message) -> list[Measurement]:
    """Return the steps of a `step` or `steps` frame. Raises BadFrame."""
    if message["type"] == "step":
        return [read_step(message)]
    steps = message.get("steps")
    if not isinstance(steps, list) or not 1 <= len(steps) <= MAX_STEPS:
        raise BadFrame(f'"steps" is a list of 1 to {MAX_STEPS} steps.')
    return [read_step(step) for step in steps]


def read_late_marks(message: Message) -> list[bool]:
    """Return which steps of a frame that was read the source itself calls late. Raises BadFrame."""
    steps = [message] if message["type"] == "step" else message["steps"]
    return [read_flag_if_there(step, "late") for step in steps]


def read_step(step: Any) -> Measurement:
    """Return one step. Raises BadFrame."""
    if not isinstance(step, dict):
        raise BadFrame("A step is a JSON object.")
    side = step.get("side")
    if side not in ("left", "right"):
        raise BadFrame('A step\'s "side" is "left" or "right".')
    try:
        return Measurement(
            number=read_whole(step, "number", low=1),
            time_s=read_number(step, "time_s"),
            side=Side(side),
            value=None if step.get("value") is None else read_number(step, "value"),
            reasons=_read_reasons(step.get("reasons", [])),
            extra=_read_extra(step.get("extra", {})),
        )
    except InvalidMeasurement as problem:
        raise BadFrame(str(problem)) from None


def _read_reasons(reasons: Any) -> tuple[str, ...]:
    if not isinstance(reasons, list) or len(reasons) > MAX_REASONS:
        raise BadFrame(f'"reasons" is a list of up to {MAX_REASONS} codes.')
    return tuple(read_name({"reasons": reason}, "reasons") for reason in reasons)


def _read_extra(extra: Any) -> dict[str, float]:
    if not isinstance(extra, dict) or len(extra) > MAX_EXTRA:
        raise BadFrame(f'"extra" is an object of up to {MAX_EXTRA} named numbers.')
    for name in extra:
        read_name({"extra": name}, "extra")
    return {name: _read_exactly(extra, name) for name in extra}


def _read_exactly(message: Message, name: str) -> float:
    """Return a number; a whole one with all its digits, which a float may not have."""
    value = message[name]
    if isinstance(value, int) and not isinstance(value, bool):
        if -(2**63) <= value < 2**63:
            return value
        raise BadFrame(f'"{name}" has too many digits: send it as a decimal, or leave it out.')
    return read_number(message, name)
