"""Reads the steps of a source."""

from __future__ import annotations

from typing import Annotated, Any, Literal

import msgspec
from msgspec import Meta, Struct

from rehab.sessions.live.protocol.fields import (
    NAME_WORDS,
    Count,
    Message,
    Name,
    Number,
    read_fields,
)
from rehab.training.steps import InvalidMeasurement, Measurement, Side
from robot.wire.frames import BadFrame
from robot.wire.limits import MAX_EXTRA, MAX_FRAME_BYTES, MAX_REASONS, MAX_STEPS

# 64 bits, as the database has them.
_Whole = Annotated[int, Meta(ge=-(2**63), le=2**63 - 1)]
_Extra = Annotated[
    dict[Name, _Whole | Number],
    Meta(
        max_length=MAX_EXTRA,
        description=f"an object of up to {MAX_EXTRA} named finite numbers; one with more than 64 "
        "bits has too many digits: send it as a decimal, or leave it out",
    ),
]
_Reasons = Annotated[
    tuple[Name, ...],
    Meta(
        max_length=MAX_REASONS,
        description=f"a list of up to {MAX_REASONS} codes, each {NAME_WORDS}",
    ),
]


class _Step(Struct):
    number: Count
    time_s: Number
    side: Side
    value: Number | None = None
    reasons: _Reasons = ()
    extra: _Extra = {}
    late: bool = False


class _StepFrame(_Step, kw_only=True):
    """A frame of one step without reasons, as most are: checked while it is read, in C."""

    type: Literal["step"]
    reasons: tuple[()] = ()


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
        return _to_measurement(step)
    except InvalidMeasurement:
        return None


def read_steps(message: Message) -> list[tuple[Measurement, bool]]:
    """Return the steps of a `step` or `steps` frame, each with whether its source calls it late.

    Raises BadFrame.
    """
    if message["type"] == "step":
        return [_read_step(message)]
    steps = message.get("steps")
    if not isinstance(steps, list) or not 1 <= len(steps) <= MAX_STEPS:
        raise BadFrame(f'"steps" is a list of 1 to {MAX_STEPS} steps.')
    return [_read_step(step) for step in steps]


def _read_step(message: Any) -> tuple[Measurement, bool]:
    step = read_fields(message, _Step)
    try:
        return _to_measurement(step), step.late
    except InvalidMeasurement as problem:
        raise BadFrame(str(problem)) from None


def _to_measurement(step: _Step) -> Measurement:
    return Measurement(step.number, step.time_s, step.side, step.value, step.reasons, step.extra)
