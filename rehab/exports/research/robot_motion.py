"""How a session's robot moved: as MCAP, and as a tracking system of its own in BIDS."""

from __future__ import annotations

import json
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from rehab.exports.research.bids import MISSING, TASK, MotionSink
from rehab.exports.research.dates import without_clocks
from rehab.exports.research.sinks import Rows
from robot.wire.frames import BadFrame
from robot.wire.incident import MOTION, TICK, unpack
from robot.wire.motion_file import MotionFile

SYSTEM = "robot"
# Name, component, type, tracked point and unit of each channel after the latency, as ``TICK``.
CHANNELS = (
    ("order_m_s", MISSING, "MISC", MISSING, "m/s"),
    ("order_rad_s", MISSING, "MISC", MISSING, "rad/s"),
    ("x_m", "x", "POS", "base", "m"),
    ("y_m", "y", "POS", "base", "m"),
    ("heading_rad", "z", "ORNT", "base", "rad"),
    ("speed_m_s", MISSING, "MISC", MISSING, "m/s"),
    ("turn_rad_s", MISSING, "MISC", MISSING, "rad/s"),
)
Timed = tuple[float, dict[str, Any]]  # seconds since 1970, and a record of the robot


class RobotMotionSink:
    """Rows of ``INCIDENTS``: those that are parts of its motion; no files without any.

    Parameters
    ----------
    strides
        The session's strides in BIDS, written before: their first one is the latency's zero.
    file
        Where the MCAP goes, where the server has the package mcap.
    session
        The session's number.
    hides_clocks
        Whether times since 1970 are left out of what the robot reported.
    """

    def __init__(
        self, strides: MotionSink, file: Path, session: int, *, hides_clocks: bool
    ) -> None:
        self._strides, self._path, self._session = strides, file, session
        self._hides_clocks = hides_clocks
        self._records: list[Timed] = []

    def write(self, rows: Rows) -> None:
        """Take some rows."""
        for row in rows:
            if row.reason == MOTION:
                self._records += _read_part(row.at.timestamp(), row.recording)

    def close(self) -> None:
        """Write the files."""
        if not self._records:
            return
        self._records.sort(key=lambda one: one[0])
        if find_spec("mcap") is not None:
            file = MotionFile(self._path.open("wb"), self._session)
            for at, record in self._records:
                data = without_clocks(record) if self._hides_clocks else record
                file.add(data | {"at_s": 0.0}, at)
            file.close()
        if self._strides.first_at is not None:
            self._write_bids(self._strides.first_at.timestamp())

    def _write_bids(self, first_at: float) -> None:
        ticks = [(at - first_at, one["tick"]) for at, one in self._records if "tick" in one]
        lines = ["\t".join(map(str, (round(at, 3), *tick))) for at, tick in ticks]
        lasted_s = ticks[-1][0] - ticks[0][0]
        types = [kind for _name, _component, kind, _point, _unit in CHANNELS]
        sidecar = {
            "TaskName": TASK,
            "TaskDescription": "What the robot did meanwhile: orders and odometry.",
            "TrackingSystemName": SYSTEM,
            "SamplingFrequency": (len(ticks) - 1) / lasted_s if lasted_s > 0 else 1.0,
            "MotionChannelCount": 1 + len(CHANNELS),
            "LATENCYChannelCount": 1,
            **{f"{kind}ChannelCount": types.count(kind) for kind in sorted(set(types))},
            "TrackedPointsCount": 1,
            "RecordingType": "discontinuous",
            "MissingValues": MISSING,
        }
        channels = ["name\tcomponent\ttype\ttracked_point\tunits"]
        channels.append(f"latency\t{MISSING}\tLATENCY\t{MISSING}\ts")
        channels += map("\t".join, CHANNELS)
        for suffix, text in (
            ("motion.tsv", "\n".join(lines)),
            ("motion.json", json.dumps(sidecar, indent=2)),
            ("channels.tsv", "\n".join(channels)),
        ):
            self._strides.path(suffix, SYSTEM).write_text(text + "\n", "utf-8")


def _read_part(at: float, recording: str) -> Iterator[Timed]:
    """Yield the records of a part that ended at a time; none of one that is damaged."""
    try:
        records = unpack(recording)
    except BadFrame:
        return
    for record in records:
        tick = record.get("tick")
        if tick is None or (isinstance(tick, list) and len(tick) == len(TICK)):
            yield at + record["at_s"] - records[-1]["at_s"], record
