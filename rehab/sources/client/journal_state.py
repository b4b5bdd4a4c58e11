"""What a journal saves, and its lines: the CRC-32 of a JSON object, and the object."""

from __future__ import annotations

import json
import zlib
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any

Message = dict[str, Any]


@dataclass
class JournalState:
    """What a source has to know to go on where it was.

    ``unsent_from`` is the first number that was given without a word of the server since the
    program started: it may have to be given again, because what was sent just before the power
    went may be stored there and not here. None where there is no such number.
    """

    session: int | None = None
    side: str = ""
    state: str = ""
    last: int = 0
    unsent_from: int | None = None
    steps: list[Message] = field(default_factory=list)

    def after(self, entry: Message) -> JournalState:
        """Return the state after a line. Raises KeyError, TypeError or ValueError."""
        if "session" in entry:
            return JournalState(**entry)
        if "step" in entry:
            step = entry["step"]
            if step["number"] <= self.last:
                raise ValueError
            self.steps.append(step)
            self.last = step["number"]
        elif "ack" in entry:
            self.steps = [step for step in self.steps if step["number"] > entry["ack"]]
        else:
            self.state = entry["state"]
        return self

    def header(self) -> Message:
        """Return the line before the steps."""
        last = self.steps[0]["number"] - 1 if self.steps else self.last
        return {
            "session": self.session,
            "side": self.side,
            "state": self.state,
            "last": last,
            "unsent_from": self.unsent_from,
        }


def write_line(entry: Message) -> bytes:
    text = json.dumps(entry, separators=(",", ":"), allow_nan=False).encode()
    return b"%08x %b\n" % (zlib.crc32(text), text)


def read_line(line: bytes) -> Message | None:
    """Return what a line says; None for one that is torn or damaged."""
    digits, _, text = line.removesuffix(b"\n").partition(b" ")
    if not line.endswith(b"\n") or digits != b"%08x" % zlib.crc32(text):
        return None
    entry = json.loads(text)
    return entry if isinstance(entry, dict) else None


def select_fitting(
    head: Iterable[bytes], steps: list[Message], max_bytes: int
) -> tuple[list[bytes], bool]:
    """Return the lines that have room, oldest steps first, and whether these are all."""
    lines = list(head)
    size = sum(map(len, lines))
    for step in steps:
        line = write_line({"step": step})
        size += len(line)
        if size > max_bytes:
            return lines, False
        lines.append(line)
    return lines, True
