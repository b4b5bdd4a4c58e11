"""Reads the frames of clients: each is checked whole before anything is done with it.

JSON is read by msgspec (1.1 instead of 7.3 µs a step), which keeps whole numbers with all their
digits; fields are checked by it, too (fields.py).
"""

from __future__ import annotations

import math
import re
from enum import StrEnum
from typing import Annotated, Any, Literal
from urllib.parse import parse_qs

import msgspec
from msgspec import Meta, Struct

from rehab.sessions.live.protocol.fields import (
    Code,
    Count,
    Message,
    Name,
    Number,
    PartOf,
    Positive,
    Whole,
    read_fields,
)
from rehab.sessions.log import REMARK_RANGES, Remark
from rehab.training.controls import CONTROLS, ValueKind, requestable_kinds
from rehab.training.steps import Side
from robot.wire.frames import (
    BadFrame,
    check_values,
    read_name,
    read_number,
    read_object,
)
from robot.wire.incident import MAX_TEXT_CHARS, read_packed
from robot.wire.limits import MAX_FRAME_BYTES, PROTOCOL_VERSION

_Light = Literal["off", "green", "orange", "red"]
INCIDENT_AGO_S = 86_400.0  # what a robot may still send of a session
PLAIN = re.compile(r"\s*([^,\s]{1,40})\s*,\s*([^,\s]{1,40})\s*")


class Incident(Struct, frozen=True):
    """What a robot recorded around a stop: of which session, why, how long ago [s]."""

    session: Count
    reason: Name
    ago_s: Annotated[float, Meta(ge=0, le=INCIDENT_AGO_S, description="a number from 0 to 86400")]
    recording: Annotated[
        str,
        Meta(
            min_length=1,
            max_length=MAX_TEXT_CHARS,
            description=f"a text of at most {MAX_TEXT_CHARS} characters",
        ),
    ]


class Hello(Struct, frozen=True):
    """A source's first frame."""

    run: Name
    last: Whole
    session: Count | None = None
    clock_s: Number | None = None
    speed: Positive | None = 1.0  # None: as fast as it can
    clock_pauses: bool = False  # its clock stands while the session is paused
    side: Side | None = None  # of a worn sensor: on the leg that is not trained it brings contacts
    plugin: PartOf | None = None
    simulated: bool = False  # nobody walks


class RobotHello(Struct, frozen=True):
    """A robot's first frame."""

    base: Name
    plugin: PartOf | None = None


class _Pose(Struct):
    x_m: Number
    y_m: Number
    heading_rad: Number


class _Status(Struct):
    base: Name
    state: Literal["idle", "performing", "stopped", "disarmed", "away"]
    reason: Code
    pose: _Pose
    gesture: Name | None = None
    battery_v: Number | None = None
    battery_share: Number | None = None
    battery_low: bool = False
    simulated: bool = False
    open_loop: bool = False
    bumpers: bool = False
    lights: tuple[_Light, _Light] = ("off", "off")
    mood: Literal["calm", "glad", "sad"] | None = None
    look: tuple[Name, Number] | None = None
    homing: Code | None = None


class _Stop(Struct):
    reason: Name


class _Decision(Struct):
    from_s: Number
    until_s: Number
    mean: Number
    threshold: Number
    activated_share: Number
    steps: Count
    above: bool
    reason: Code
    gesture: Name | None = None
    intensity: Number | None = None
    pool: Name | None = None
    seed: Whole | None = None


class _Gesture(Struct):
    name: Name
    phase: Literal["started", "ended"]
    outcome: Code
    open_loop: bool = False
    pool: Name | None = None
    seed: Whole | None = None


class _Remark(Struct):
    what: Remark


# The fields of each kind of report that pages draw.
REPORTS: dict[str, type[Struct]] = {
    "status": _Status,
    "stop": _Stop,
    "decision": _Decision,
    "gesture": _Gesture,
}


class _Seen(Struct):
    type: Literal["seen"]
    frame: Whole


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


def is_mirror(query: bytes) -> bool:
    """Return whether a patient's page is a copy on another page, by its address."""
    return "mirror" in parse_qs(query.decode("latin-1"), keep_blank_values=True)


def read_hello(message: Message) -> Hello:
    """Return a source's hello. Raises BadFrame."""
    if message.get("version") != PROTOCOL_VERSION:
        raise BadFrame(
            f'This server speaks version {PROTOCOL_VERSION}: send "version": {PROTOCOL_VERSION}.',
            "version",
        )
    return read_fields({**message, "session": message.get("session") or None}, Hello)


class SensorTrouble(StrEnum):
    """Why strides of a sensor do not count or come; the therapist's page says what to do."""

    NONE = ""
    HIDDEN = "hidden"
    SLOW = "slow"
    GAP = "gap"
    MOVED = "moved"
    ELSEWHERE = "elsewhere"
    BATTERY = "battery"
    DOUBT = "doubt"
    ENDED = "ended"  # of a recording: it stays true when its source has left


class Played(StrEnum):
    """What walks instead of a leg, where a sensor's page is only tried."""

    NOTHING = ""
    RECORDING = "recording"
    SIMULATED = "simulated"


class SensorState(Struct, frozen=True):
    """What a worn sensor says of itself: its trouble, what plays, its rate, its clock less ours."""

    trouble: SensorTrouble
    plays: Played = Played.NOTHING
    round: Annotated[int, Meta(ge=1)] = 1  # of a recording that begins again
    rate_hz: Number | None = None
    clock_offset_s: Number | None = None
    clock_error_s: Positive | None = None


class Contact(Struct, frozen=True):
    """When the foot of the leg that is not trained met the floor, by the server's clock."""

    at_s: Number
    error_s: Positive


class _Clock(Struct):
    asked_s: Number


def read_sensor(message: Message) -> SensorState:
    """Return what a worn sensor says of itself. Raises BadFrame."""
    return read_fields(message, SensorState)


def read_contact(message: Message) -> Contact:
    """Return a contact of the other leg. Raises BadFrame."""
    return read_fields(message, Contact)


def read_clock(message: Message) -> float:
    """Return when a source asked for our time, by its clock [s]. Raises BadFrame."""
    return read_fields(message, _Clock).asked_s


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
    return kind, None if message.get("value") is None else read_number(message, "value")


def read_remark(message: Message) -> tuple[Remark, float | None]:
    """Return what a PT notes, with its value where it has one. Raises BadFrame."""
    what = read_fields(message, _Remark).what
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
    if kind in REPORTS:
        read_fields(report, REPORTS[kind])
    return report


def read_incident(message: Message) -> Incident:
    """Return a robot's incident, its recording still packed. Raises BadFrame."""
    incident = read_fields(message, Incident)
    read_packed(incident.recording)
    return incident
