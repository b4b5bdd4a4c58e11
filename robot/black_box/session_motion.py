"""The motion of each session as a file of its own, in MCAP: what a study can cite, and replay.

A file has the orders and the odometry, 50 times a second while it moved, each decision with its
window, variant and seed, each gesture and stop, and the cues that it followed, by the time of day.
It names no patient: the session's number alone. Foxglove and the readers of mcap.dev open it.
"""

from __future__ import annotations

import json
from collections.abc import Iterable
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

from robot.wire.incident import TICK, Record

if TYPE_CHECKING:
    from mcap.writer import Writer

MAX_FILES = 500  # sessions, the newest; some 1 MB for ten minutes
CHUNK_BYTES = 64 * 1024  # so much may be lost where the power is

ORDER, ODOMETRY = "/order", "/odometry"
# Topics of what it reported and received, by their kind.
REPORTS = {kind: f"/{kind}" for kind in ("decision", "gesture", "stop")}
RECEIVED = {kind: f"/{kind}" for kind in ("welcome", "cue", "state")}
_NUMBERS = {
    ORDER: TICK[:2],
    ODOMETRY: TICK[2:],
}


class SessionMotion:
    """Writes what a black box records into the file of the session that it is of.

    Needs the package mcap.

    Parameters
    ----------
    folder
        Where the files are.
    to_epoch_s
        Seconds from a record's clock to the time of day [s].
    """

    def __init__(self, folder: Path, to_epoch_s: float) -> None:
        import mcap.writer  # optional: without it this fails here, and not in a session

        self._mcap = mcap.writer
        self._folder, self._to_epoch_s = folder, to_epoch_s
        self._session: int | None = None
        self._file: BinaryIO | None = None
        self._writer: Writer | None = None
        self._channels: dict[str, int] = {}

    def add(self, records: Iterable[Record]) -> None:
        """Write records, oldest first; those without a session are left out. Raises OSError."""
        for record in records:
            match record:
                case {"received": {"type": "welcome", "session": session}}:
                    if session != self._session:
                        self._begin(session, record["at_s"])
                    self._write(RECEIVED["welcome"], record["at_s"], record["received"])
                case {"received": {"type": str(kind)} as message} if kind in RECEIVED:
                    self._write(RECEIVED[kind], record["at_s"], message)
                case {"sent": {"kind": str(kind)} as report} if kind in REPORTS:
                    self._write(REPORTS[kind], record["at_s"], report)
                case {"tick": tick}:
                    columns = dict(zip(TICK, tick, strict=True))
                    for topic, names in _NUMBERS.items():
                        numbers = {name: columns[name] for name in names}
                        self._write(topic, record["at_s"], numbers)

    def close(self) -> None:
        """End the file. Raises OSError."""
        writer, file = self._writer, self._file
        self._writer = self._file = self._session = None
        if writer is not None and file is not None:
            with file:
                writer.finish()  # type: ignore[no-untyped-call]

    def _begin(self, session: int | None, at_s: float) -> None:
        self.close()
        if session is None:
            return
        began = datetime.fromtimestamp(self._to_epoch_s + at_s, UTC)
        self._folder.mkdir(parents=True, exist_ok=True)
        path = self._folder / f"session-{began:%Y%m%dT%H%M%S%fZ}-{session}.mcap"
        self._file = path.open("wb")
        self._session, self._channels = session, {}
        self._writer = self._mcap.Writer(self._file, chunk_size=CHUNK_BYTES)
        self._writer.start(library="garry")
        self._writer.add_metadata("garry", {"session": str(session)})
        for old in sorted(self._folder.glob("session-*.mcap"))[:-MAX_FILES]:
            old.unlink()

    def _write(self, topic: str, at_s: float, message: Any) -> None:
        if self._writer is None:
            return
        if topic not in self._channels:
            numbers = {name: {"type": "number"} for name in _NUMBERS.get(topic, ())}
            schema = {"type": "object", "properties": numbers}
            schema_id = self._writer.register_schema(
                f"garry{topic.replace('/', '.')}", "jsonschema", json.dumps(schema).encode()
            )
            self._channels[topic] = self._writer.register_channel(topic, "json", schema_id)
        time_ns = round(1e9 * (self._to_epoch_s + at_s))
        self._writer.add_message(
            self._channels[topic], time_ns, json.dumps(message).encode(), time_ns
        )
