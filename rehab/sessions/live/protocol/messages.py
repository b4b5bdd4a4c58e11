"""Reads the frames of clients: each is checked whole before anything is done with it.

The checks are written by hand: an error says what to send instead, and the checks are those of
robots and sources (`robot.wire.frames`), which have the standard library only. Its JSON is read by
msgspec (1.1 instead of 7.3 µs a step), which keeps whole numbers with all their digits.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Annotated, Any, Literal, TypeVar
from urllib.parse import parse_qs

import msgspec

from rehab.sessions.log import REMARK_RANGES, Remark
from rehab.training.controls import CONTROLS, ValueKind, requestable_kinds
from robot.wire.frames import (
    BadFrame,
    check_values,
    read_name,
    read_number,
    read_object,
    read_whole,
)
from robot.wire.incident import MAX_TEXT_CHARS, read_packed
from robot.wire.limits import MAX_FRAME_BYTES, PROTOCOL_VERSION

T = TypeVar("T")
Message = Mapping[str, Any]
Check = Callable[[Message, str], T]  # returns a field of a message, or raises BadFrame
INCIDENT_AGO_S = 86_400.0  # what a robot may still send of a session
PLAIN = re.compile(r"\s*([^,\s]{1,40})\s*,\s*([^,\s]{1,40})\s*")


@dataclass(frozen=True, slots=True)
class Incident:
    """What a robot recorded around a stop: of which session, why, how long ago [s]."""

    session: int
    reason: str
    ago_s: float
    recording: str


@dataclass(frozen=True, slots=True)
class Hello:
    """A source's first frame."""

    run: str
    last: int
    session: int | None
    clock_s: float | None
    speed: float | None
    clock_pauses: bool = False  # its clock stands while the session is paused


class _Seen(msgspec.Struct):
    type: Literal["seen"]
    frame: Annotated[int, msgspec.Meta(ge=0, lt=2**31)]


_decode_seen = msgspec.json.Decoder(_Seen).decode
_decode = msgspec.json.Decoder().decode


def read_frame(text: str | None) -> dict[str, Any]:
    """Return a frame as a JSON object with a type. Raises what ``read_object`` raises."""
    if text is None or len(text) > MAX_FRAME_BYTES:
        return read_object(text)
    try:
        message = _decode(text)
    except (msgspec.MsgspecError, RecursionError, UnicodeError):
        return read_object(text)  # has the cure, or reads what is rare (half a surrogate pair)
    is_one = isinstance(message, dict) and isinstance(message.get("type", ""), str)
    return message if is_one else read_object(text)


def read_seen(text: str) -> int | None:
    """Return which frame a page has seen; None for any other message."""
    try:
        return _decode_seen(text).frame
    except (msgspec.MsgspecError, RecursionError, UnicodeError):
        return None


def read_after(query: bytes) -> int | None:
    """Return which step a page has already, by its address; None for a new page."""
    words = parse_qs(query.decode("latin-1")).get("after", [])
    return int(words[0]) if words and re.fullmatch("[0-9]{1,18}", words[0]) else None


def read_hello(message: Message) -> Hello:
    """Return a source's hello. Raises BadFrame."""
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
        clock_pauses=read_flag_if_there(message, "clock_pauses"),
    )


def read_plain(text: str) -> tuple[float | None, float | None] | None:
    """Return value and goal of the original's text "a2, goal"; None for any other text.

    A value or goal that is not finite is None.
    """
    match = None if text.startswith("{") else PLAIN.fullmatch(text)
    if match is None:
        return None
    try:
        value, goal = (float(word) for word in match.groups())
    except ValueError:
        return None
    return (value if math.isfinite(value) else None, goal if math.isfinite(goal) else None)


def read_change(message: Message) -> tuple[str, float | str | None]:
    """Return the kind and value of a change that a person requests. Raises BadFrame."""
    kind, known = message.get("kind"), requestable_kinds()
    if kind not in known:
        raise BadFrame(f'"kind" is one of: {", ".join(known)}.')
    if CONTROLS[kind].value is ValueKind.NAME:
        return kind, read_name(message, "value")
    return kind, _optional_number(message, "value")


def read_remark(message: Message) -> tuple[Remark, float | None]:
    """Return what a PT notes, with its value where it has one. Raises BadFrame."""
    what = Remark(_one_of(*Remark)(message, "what"))
    if what not in REMARK_RANGES:
        return what, None
    return what, read_number(message, "value", *REMARK_RANGES[what])


def read_report(message: Message) -> dict[str, Any]:
    """Return a robot's report, its fields checked by ``REPORTS``. Raises BadFrame."""
    report = message.get("report")
    if not isinstance(report, dict):
        raise BadFrame('"report" is an object.')
    check_values(report)
    kind = report.get("kind", "")
    if not isinstance(kind, str):
        raise BadFrame('"kind" of a report is a name.')
    for name, check in REPORTS.get(kind, {}).items():
        check(report, name)
    return report


def read_incident(message: Message) -> Incident:
    """Return a robot's incident, its recording still packed. Raises BadFrame."""
    recording = message.get("recording")
    if not isinstance(recording, str) or not 0 < len(recording) <= MAX_TEXT_CHARS:
        raise BadFrame(f'"recording" is a text of at most {MAX_TEXT_CHARS} characters.')
    read_packed(recording)
    return Incident(
        session=read_whole(message, "session", low=1),
        reason=read_name(message, "reason"),
        ago_s=read_number(message, "ago_s", 0, INCIDENT_AGO_S),
        recording=recording,
    )


def _one_of(*known: str) -> Check[str]:
    def check(message: Message, name: str) -> str:
        value = message.get(name)
        if value not in known:
            raise BadFrame(f'"{name}" is one of: {", ".join(known)}.')
        return str(value)

    return check


def _optional(check: Check[T]) -> Check[T | None]:
    return lambda message, name: None if message.get(name) is None else check(message, name)


def _code(message: Message, name: str) -> str:
    return "" if message.get(name) == "" else read_name(message, name)


def _flag(message: Message, name: str) -> bool:
    value = message.get(name)
    if not isinstance(value, bool):
        raise BadFrame(f'"{name}" is true or false.')
    return value


def read_flag_if_there(message: Message, name: str) -> bool:
    """Return a flag; False where the message has none. Raises BadFrame."""
    return name in message and _flag(message, name)


def _count(message: Message, name: str) -> int:
    return read_whole(message, name, low=1)


def _pose(message: Message, name: str) -> None:
    pose = message.get(name)
    for part in ("x_m", "y_m", "heading_rad"):
        read_number(pose if isinstance(pose, dict) else {}, part)


def _lights_if_there(message: Message, name: str) -> None:
    lights = message.get(name, ["off", "off"])
    colors = {"off", "green", "orange", "red"}
    is_pair = isinstance(lights, list) and len(lights) == 2
    if not is_pair or not all(isinstance(one, str) and one in colors for one in lights):
        raise BadFrame(f'"{name}" are two of: {", ".join(sorted(colors))}.')


_optional_name, _optional_number = _optional(read_name), _optional(read_number)

# The fields of each kind of report that pages draw.
REPORTS: dict[str, dict[str, Check[Any]]] = {
    "status": {
        "base": read_name,
        "state": _one_of("idle", "performing", "stopped", "disarmed", "away"),
        "reason": _code,
        "gesture": _optional_name,
        "pose": _pose,
        "battery_v": _optional_number,
        "battery_share": _optional_number,
        "battery_low": read_flag_if_there,
        "simulated": read_flag_if_there,
        "open_loop": read_flag_if_there,
        "bumpers": read_flag_if_there,
        "lights": _lights_if_there,
        "mood": _optional(_one_of("calm", "glad", "sad")),
    },
    "stop": {"reason": read_name},
    "decision": {
        "from_s": read_number,
        "until_s": read_number,
        "mean": read_number,
        "threshold": read_number,
        "activated_share": read_number,
        "steps": _count,
        "above": _flag,
        "reason": _code,
        "gesture": _optional_name,
        "intensity": _optional_number,
    },
    "gesture": {
        "name": read_name,
        "phase": _one_of("started", "ended"),
        "outcome": _code,
        "open_loop": read_flag_if_there,
    },
}


def _read_speed(message: Message) -> float | None:
    speed = _optional_number(message, "speed") if "speed" in message else 1.0
    if speed is not None and speed <= 0:
        raise BadFrame('"speed" is above 0, or null for as fast as possible.')
    return speed
