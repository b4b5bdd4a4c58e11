"""The motion of a session as MCAP: what a robot writes beside its black box, and an export has.

Orders and odometry, decisions with window, variant and seed, gestures, stops and cues, by a time of
day, from the records of ``robot.wire.incident``. Foxglove and the readers of mcap.dev open it. It
names no patient: the session's number alone. Needs the package mcap.
"""

from __future__ import annotations

import json
from typing import Any, BinaryIO

from robot.wire.incident import ASIDE, MOTION_TOPICS, TICK, Record, read_aside

CHUNK_BYTES = 64 * 1024  # so much may be lost where the power is
ORDER, ODOMETRY = "/order", "/odometry"
# Topics of what a robot reported and received, by their kind.
REPORTS = {kind: f"/{kind}" for kind in MOTION_TOPICS}
RECEIVED = {kind: f"/{kind}" for kind in ("welcome", "cue", "state")}
_NUMBERS = {ORDER: (*TICK[:2], ASIDE[0]), ODOMETRY: (*TICK[2:], ASIDE[1])}


class MotionFile:
    """Writes the records of one session.

    Parameters
    ----------
    file
        Where it goes; closed with this.
    session
        The session's number.
    """

    def __init__(self, file: BinaryIO, session: int) -> None:
        from mcap.writer import Writer  # optional

        self._file, self._channels = file, dict[str, int]()
        self._writer = Writer(file, chunk_size=CHUNK_BYTES)
        self._writer.start(library="garry")
        self._writer.add_metadata("garry", {"session": str(session)})

    def add(self, record: Record, to_epoch_s: float) -> None:
        """Write a record; one that is of no topic is left out. Raises OSError.

        Parameters
        ----------
        record
            As a black box has it.
        to_epoch_s
            Seconds from its clock to the time of day [s].
        """
        at_s = to_epoch_s + record["at_s"]
        match record:
            case {"received": {"type": str(kind)} as message} if kind in RECEIVED:
                self._write(RECEIVED[kind], at_s, message)
            case {"sent": {"kind": str(kind)} as report} if kind in REPORTS:
                self._write(REPORTS[kind], at_s, report)
            case {"tick": tick}:
                columns = dict(zip((*TICK, *ASIDE), (*tick, *read_aside(record)), strict=True))
                for topic, names in _NUMBERS.items():
                    self._write(topic, at_s, {name: columns[name] for name in names})

    def close(self) -> None:
        """End the file. Raises OSError."""
        with self._file:
            self._writer.finish()  # type: ignore[no-untyped-call]

    def _write(self, topic: str, at_s: float, message: Any) -> None:
        if topic not in self._channels:
            numbers = {name: {"type": "number"} for name in _NUMBERS.get(topic, ())}
            schema = {"type": "object", "properties": numbers}
            schema_id = self._writer.register_schema(
                f"garry{topic.replace('/', '.')}", "jsonschema", json.dumps(schema).encode()
            )
            self._channels[topic] = self._writer.register_channel(topic, "json", schema_id)
        time_ns = round(1e9 * at_s)
        self._writer.add_message(
            self._channels[topic], time_ns, json.dumps(message).encode(), time_ns
        )
