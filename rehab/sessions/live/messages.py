"""Reads what dials in: each frame is checked whole before anything is done with it."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from typing import Any

from rehab.sessions.log import Remark
from rehab.training.controls import CONTROLS, ValueKind, requestable_kinds
from rehab.training.steps import InvalidMeasurement, Measurement, Side
from robot.wire.frames import BadFrame, check_values, read_name, read_number, read_whole
from robot.wire.limits import MAX_EXTRA, MAX_REASONS, MAX_STEPS, PROTOCOL_VERSION

ROBOT_STATES = ("idle", "performing", "stopped", "disarmed")
GESTURE_PHASES = ("started", "ended")
PLAIN = re.compile(r"\s*([^,\s]{1,40})\s*,\s*([^,\s]{1,40})\s*")


@dataclass(frozen=True, slots=True)
class Hello:
    """What a source says of itself."""

    run: str
    last: int
    session: int | None
    clock_s: float | None
    speed: float | None
    token: str | None


def read_hello(message: dict[str, Any]) -> Hello:
    """Read a source's hello. Raises BadFrame."""
    if message.get("version") != PROTOCOL_VERSION:
        raise BadFrame(
            f'This server speaks version {PROTOCOL_VERSION}: send "version": {PROTOCOL_VERSION}.',
            "version",
        )
    return Hello(
        run=read_name(message, "run"),
        last=read_whole(message, "last", low=0),
        session=read_whole(message, "session", low=1) if message.get("session") else None,
        clock_s=_optional_number(message, "clock_s"),
        speed=_read_speed(message),
        token=message.get("token"),
    )


def read_steps(message: dict[str, Any]) -> list[Measurement]:
    """Read the steps of a `step` or `steps` frame. Raises BadFrame."""
    if message["type"] == "step":
        return [read_step(message)]
    steps = message.get("steps")
    if not isinstance(steps, list) or not 1 <= len(steps) <= MAX_STEPS:
        raise BadFrame(f'"steps" is a list of 1 to {MAX_STEPS} steps.')
    return [read_step(step) for step in steps]


def read_step(step: Any) -> Measurement:
    """Read one step. Raises BadFrame."""
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
            value=_optional_number(step, "value"),
            reasons=_read_reasons(step.get("reasons", [])),
            extra=_read_extra(step.get("extra", {})),
        )
    except InvalidMeasurement as problem:
        raise BadFrame(str(problem)) from None


def read_plain(text: str) -> tuple[float | None, float | None] | None:
    """Read the original's text "a2, goal"; None where it is no such text.

    A value that is no finite number is a missing one.
    """
    match = None if text.startswith("{") else PLAIN.fullmatch(text)
    if match is None:
        return None
    try:
        value, goal = (float(word) for word in match.groups())
    except ValueError:
        return None
    return (value if math.isfinite(value) else None, goal if math.isfinite(goal) else None)


def read_change(message: dict[str, Any]) -> tuple[str, float | str | None]:
    """Read what a person wants changed. Raises BadFrame."""
    kind, known = message.get("kind"), requestable_kinds()
    if kind not in known:
        raise BadFrame(f'"kind" is one of: {", ".join(known)}.')
    if CONTROLS[kind].value is ValueKind.NAME:
        return kind, read_name(message, "value")
    return kind, _optional_number(message, "value")


BORG_MAX = 10  # CR10


def read_remark(message: dict[str, Any]) -> tuple[Remark, float | None]:
    """Read what a PT notes; exertion has its number. Raises BadFrame."""
    try:
        what = Remark(str(message.get("what")))
    except ValueError:
        raise BadFrame(f'"what" is one of: {", ".join(Remark)}.') from None
    value = message.get("value")
    if what is not Remark.BORG:
        return what, None
    if isinstance(value, bool) or not isinstance(value, int | float) or not 0 <= value <= BORG_MAX:
        raise BadFrame(f'"value" of borg is a number from 0 to {BORG_MAX}.')
    return what, float(value)


def read_order(message: dict[str, Any], *orders: str) -> str:
    """Read what is to become of the robot. Raises BadFrame."""
    order = message.get("order")
    if order not in orders:
        raise BadFrame(f'"order" is one of: {", ".join(orders)}. The robot is armed by a person.')
    return str(order)


def read_report(message: dict[str, Any]) -> dict[str, Any]:
    """Read what a robot reports; of the kinds that pages draw, every part. Raises BadFrame."""
    report = message.get("report")
    if not isinstance(report, dict):
        raise BadFrame('"report" is an object.')
    check_values(report)
    if not isinstance(report.get("kind", ""), str):
        raise BadFrame('"kind" of a report is a name.')
    match report.get("kind"):
        case "status":
            read_name(report, "base")
            _read_one_of(report, "state", ROBOT_STATES)
            _read_code(report, "reason")
            _optional_name(report, "gesture")
            pose = report.get("pose")
            for part in ("x_m", "y_m", "heading_rad"):
                read_number(pose if isinstance(pose, dict) else {}, part)
            for part in ("battery_v", "battery_share"):
                _optional_number(report, part)
            for part in ("battery_low", "simulated", "open_loop", "bumpers"):
                _optional_flag(report, part)
        case "stop":
            read_name(report, "reason")
        case "decision":
            for part in ("from_s", "until_s", "mean", "threshold", "activated_share"):
                read_number(report, part)
            read_whole(report, "steps", low=1)
            if not isinstance(report.get("above"), bool):
                raise BadFrame('"above" is true or false.')
            _read_code(report, "reason")
            _optional_name(report, "gesture")
            _optional_number(report, "intensity")
        case "gesture":
            read_name(report, "name")
            _read_one_of(report, "phase", GESTURE_PHASES)
            _read_code(report, "outcome")
            _optional_flag(report, "open_loop")
    return report


def _read_one_of(message: dict[str, Any], name: str, known: tuple[str, ...]) -> None:
    if message.get(name) not in known:
        raise BadFrame(f'"{name}" is one of: {", ".join(known)}.')


def _read_code(message: dict[str, Any], name: str) -> None:
    if message.get(name) != "":
        read_name(message, name)


def _optional_name(message: dict[str, Any], name: str) -> None:
    if message.get(name) is not None:
        read_name(message, name)


def _optional_flag(message: dict[str, Any], name: str) -> None:
    if not isinstance(message.get(name, False), bool):
        raise BadFrame(f'"{name}" is true or false.')


def _read_speed(message: dict[str, Any]) -> float | None:
    speed = _optional_number(message, "speed") if "speed" in message else 1.0
    if speed is not None and speed <= 0:
        raise BadFrame('"speed" is above 0, or null for as fast as possible.')
    return speed


def _optional_number(message: dict[str, Any], name: str) -> float | None:
    return None if message.get(name) is None else read_number(message, name)


def _read_reasons(reasons: Any) -> tuple[str, ...]:
    if not isinstance(reasons, list) or len(reasons) > MAX_REASONS:
        raise BadFrame(f'"reasons" is a list of up to {MAX_REASONS} codes.')
    return tuple(read_name({"reasons": reason}, "reasons") for reason in reasons)


def _read_extra(extra: Any) -> dict[str, float]:
    if not isinstance(extra, dict) or len(extra) > MAX_EXTRA:
        raise BadFrame(f'"extra" is an object of up to {MAX_EXTRA} named numbers.')
    for name in extra:
        read_name({"extra": name}, "extra")
    return {name: read_number(extra, name) for name in extra}
