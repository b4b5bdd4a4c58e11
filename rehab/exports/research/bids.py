"""Sessions in the layout of BIDS for motion: each stride a sample, with its own latency.

Source: Brain Imaging Data Structure, specification of motion (bids-specification.readthedocs.io).
Strides do not come at a fixed rate: the channel ``latency`` says when each did, and the sampling
frequency is the mean cadence of the file.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator
from datetime import datetime
from operator import attrgetter
from pathlib import Path
from typing import Any

from rehab.exports.research.sinks import Rows
from rehab.exports.session_table import PARTICIPANT
from rehab.exports.step_tables import STEPS
from rehab.people.web.csv_tables import format_cell
from rehab.sessions.step_columns import MEASURE_UNIT

BIDS_VERSION = "1.10.0"
TASK, SYSTEM = "walking", "strides"
MISSING = "n/a"
# The channels: latency and leg, then columns of the table of steps.
STORED = [column for column in STEPS.columns if column.is_channel]
CHANNEL_COUNT = 2 + len(STORED)
OF_STUDIES = {
    "study": "Short name of the study, or of several with blanks between.",
    "participant": "Code in the study.",
    "group": "What was allocated: an arm, or arms in the order of the periods; n/a until the study "
    "is closed.",
}
read_stored = attrgetter(*(column.name for column in STORED))


def subject_of(pseudonym: str) -> str:
    """Return a pseudonym as BIDS writes labels: letters and digits alone."""
    return "sub-" + "".join(filter(str.isalnum, pseudonym))


class MotionSink:
    """Rows of ``STEPS`` as one run of motion data, with its sidecars; no files without strides."""

    def __init__(self, folder: Path, pseudonym: str, session: str, unit: str) -> None:
        self.subject, self._unit = subject_of(pseudonym), unit
        place = folder / self.subject / f"ses-{session}" / "motion"
        place.mkdir(parents=True)
        stem = f"{self.subject}_ses-{session}_task-{TASK}"
        self._stem, self.events = place / stem, place / f"{stem}_events.tsv"
        self._file = self.path("motion.tsv").open("w", encoding="utf-8", newline="")
        self.first_at: datetime | None = None
        self._first_s = self._last_s = 0.0
        self.count = 0

    def path(self, suffix: str, system: str = SYSTEM) -> Path:
        """Return where a file of a tracking system goes."""
        return self._stem.with_name(f"{self._stem.name}_tracksys-{system}_{suffix}")

    def write(self, rows: Rows) -> None:
        """Write some strides."""
        for row in rows:
            if self.first_at is None:
                self.first_at, self._first_s = row.received_at, row.time
            self._last_s = row.time
            self.count += 1
            cells = (row.time - self._first_s, row.side == "right", *read_stored(row))
            self._file.write("\t".join(map(_format, cells)) + "\n")

    def close(self) -> None:
        """Close the run and describe it; without strides, remove it."""
        self._file.close()
        if not self.count:
            self.path("motion.tsv").unlink()
            self._stem.parent.rmdir()
            return
        lasted_s = self._last_s - self._first_s
        sidecar = {
            "TaskName": TASK,
            "TaskDescription": "Walking with feedback on each step of the trained leg.",
            "TrackingSystemName": SYSTEM,
            "SamplingFrequency": (self.count - 1) / lasted_s if lasted_s > 0 else 1.0,
            "MotionChannelCount": CHANNEL_COUNT,
            "LATENCYChannelCount": 1,
            "MISCChannelCount": CHANNEL_COUNT - 1,
            "TrackedPointsCount": 0,
            "RecordingType": "discontinuous",
            "MissingValues": MISSING,
        }
        self.path("motion.json").write_text(json.dumps(sidecar, indent=2) + "\n", "utf-8")
        own_unit = format_cell(" ".join(self._unit.split()))  # a clinic's own words
        lines = ["name\tcomponent\ttype\ttracked_point\tunits"]
        lines.append(f"latency\t{MISSING}\tLATENCY\t{MISSING}\ts")
        lines.append(f"right_leg\t{MISSING}\tMISC\t{MISSING}\t{MISSING}")
        for column in STORED:
            unit = own_unit if column.unit == MEASURE_UNIT else ""
            lines.append(f"{column.name}\t{MISSING}\tMISC\t{MISSING}\t{unit or MISSING}")
        self.path("channels.tsv").write_text("\n".join(lines) + "\n", "utf-8")


class EventSink:
    """Rows of ``EVENTS`` as BIDS events; times are from the first stride that was received."""

    def __init__(self, motion: MotionSink) -> None:
        self._motion = motion
        self._lines: list[tuple[float, str]] = []

    def write(self, rows: Rows) -> None:
        """Take some events; a session has some hundred of them."""
        began = self._motion.first_at
        for row in rows:
            if began is not None:
                onset = (row.at - began).total_seconds()
                self._lines.append((onset, f"{onset}\t0\t{row.kind}\t{_format(row.value)}"))

    def close(self) -> None:
        """Write the file, in the order of time."""
        if self._motion.count:
            lines = [line for _onset, line in sorted(self._lines)]
            text = "\n".join(["onset\tduration\ttrial_type\tvalue", *lines])
            self._motion.events.write_text(text + "\n", "utf-8")


def _format(value: Any) -> str:
    if value is None or value == "":
        return MISSING
    return str(int(value)) if isinstance(value, bool) else str(value)


def dataset_files(
    participants: Iterable[dict[str, Any]], version: str
) -> Iterator[tuple[str, str]]:
    """Yield the files about the whole data set: name and text."""
    description = {
        "Name": "Walking with feedback, from GARRY",
        "BIDSVersion": BIDS_VERSION,
        "DatasetType": "raw",
        "License": "To be set by who shares the data",
        "Authors": ["To be set by who shares the data"],
        "GeneratedBy": [{"Name": "GARRY", "Version": version}],
    }
    yield "dataset_description.json", _json(description)
    yield (
        "README",
        "Strides of people who walked with feedback on each step, exported by GARRY.\n\n"
        "A sample is a stride; the channel latency has its time. The codebook of the export, one "
        "folder above, says what each channel means.\n",
    )
    about = {
        column.name: {"Description": f"At the first session: {column.meaning}"}
        for column in PARTICIPANT
    } | {name: {"Description": meaning} for name, meaning in OF_STUDIES.items()}
    yield "participants.json", _json(about)
    lines = ["\t".join(["participant_id", *about])]
    for row in participants:
        cells = [row["participant_id"], *(_format(row.get(name)) for name in about)]
        lines.append("\t".join(cells))
    yield "participants.tsv", "\n".join(lines) + "\n"
    events = {
        "onset": {"Description": "Seconds from the first stride that was received."},
        "trial_type": {"Description": "What was done, noted, or done by the robot."},
        "value": {"Description": "Value after a change; of a remark its strength."},
    }
    yield f"task-{TASK}_events.json", _json(events)


def _json(data: Any) -> str:
    return json.dumps(data, indent=2, ensure_ascii=False) + "\n"
