"""What a robot recorded before and after a stop, as a file and as the text of one frame.

A recording is a list of records, oldest first, each a JSON object with ``at_s``, its time by the
robot's clock [s], and one of:

``tick``
    What was ordered and how it moved, by ``TICK``; with ``hazards`` where the base felt any, and
    with ``aside``, by ``ASIDE``, where a holonomic one was ordered to the left, or moved there.
``received``, ``sent``
    A message of the server, a report to it.
``bytes``
    What a Kobuki sent, in hexadecimal; only in the robot's own file.
``retained``
    Why the recording is retained; ``is_first`` where it is not within an earlier one's.
``lost``
    How many records before this one were dropped, because the disk was too slow.

The file has a record a line (JSON Lines).
"""

from __future__ import annotations

import base64
import json
import math
import zlib
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from robot.wire.frames import BadFrame

Record = Mapping[str, Any]

# The columns of a tick: the order [m/s, rad/s], the pose from home [m, m, rad], the velocity.
TICK = ("order_m_s", "order_rad_s", "x_m", "y_m", "heading_rad", "speed_m_s", "turn_rad_s")
# What goes to the left: the order and the velocity [m/s].
ASIDE = ("order_left_m_s", "left_m_s")

# The reason of a recording that nothing stopped: a part of its session's motion, of these reports
# and of fewer ticks.
MOTION = "motion"
MOTION_TOPICS = ("decision", "gesture", "stop")

MAX_TEXT_CHARS = 60_000  # with the rest of its message below a frame's limit
MAX_FILE_BYTES = 4_000_000  # what such a text may unpack to
_NOT_PACKED = '"recording" is packed as robot/wire/incident.py does it.'


def to_lines(records: Iterable[Record]) -> str:
    """Return records as the text of a file."""
    return "".join(json.dumps(one, separators=(",", ":")) + "\n" for one in records)


def read_lines(text: str) -> list[dict[str, Any]]:
    """Return the records of a file; a line that is no record, such as a torn one, is left out."""
    records: list[dict[str, Any]] = []
    for line in text.splitlines():
        try:
            record = json.loads(line)
        except (ValueError, RecursionError):
            continue
        if isinstance(record, dict) and isinstance(record.get("at_s"), int | float):
            records.append(record)
    return records


def read_aside(record: Record) -> tuple[float, float]:
    """Return what of a tick goes to the left, by ``ASIDE``; 0 where it says nothing of that."""
    match record.get("aside"):
        case [int() | float() as order_m_s, int() | float() as speed_m_s] if all(
            map(math.isfinite, (order_m_s, speed_m_s))
        ):
            return float(order_m_s), float(speed_m_s)
    return 0.0, 0.0


def pack(records: Sequence[Record]) -> str:
    """Return records as one text, without ``bytes``; the oldest are left out until it fits."""
    rest = [one for one in records if "bytes" not in one]
    while True:
        text = base64.b64encode(zlib.compress(to_lines(rest).encode(), 9)).decode()
        if len(text) <= MAX_TEXT_CHARS or not rest:
            return text
        rest = rest[len(rest) // 4 + 1 :]


def unpack(text: str) -> list[dict[str, Any]]:
    """Return the records of such a text. Raises BadFrame for any other."""
    try:
        unpacker = zlib.decompressobj()
        lines = unpacker.decompress(read_packed(text), MAX_FILE_BYTES)
        if unpacker.eof:
            return read_lines(lines.decode())
    except (ValueError, zlib.error):
        pass
    raise BadFrame(_NOT_PACKED)


def read_packed(text: str) -> bytes:
    """Return the bytes of such a text, still compressed. Raises BadFrame for what is no base64."""
    try:
        return base64.b64decode(text, validate=True)
    except ValueError:
        raise BadFrame(_NOT_PACKED) from None
