"""Sessions in the layout of BIDS for motion: each stride a sample, with its own latency.

Source: Brain Imaging Data Structure, specification of motion (bids-specification.readthedocs.io).
Strides do not come at a fixed rate: the channel ``latency`` tells when each did, and the sampling
frequency is the mean cadence of the file.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator
from datetime import datetime
from pathlib import Path
from typing import Any

from rehab.exports.research.recordings import PLACES
from rehab.exports.research.sinks import Rows
from rehab.people.models import Patient
from rehab.people.policy import covariates
from rehab.people.web.csv_tables import format_cell

BIDS_VERSION = "1.10.0"
TASK, SYSTEM = "walking", "strides"
MISSING = "n/a"
# Name, type and unit of each channel ("": the measure's), in the order of the columns.
CHANNELS = (
    ("latency", "LATENCY", "s"),
    ("number", "MISC", MISSING),
    ("right_leg", "MISC", MISSING),
    ("trained", "MISC", MISSING),
    ("value", "MISC", ""),
    ("gain", "MISC", MISSING),
    ("shown", "MISC", ""),
    ("goal", "MISC", ""),
    ("performance", "MISC", MISSING),
    ("hit", "MISC", MISSING),
    ("points", "MISC", MISSING),
    ("valid", "MISC", MISSING),
    ("phase", "MISC", MISSING),
)
PLAIN_CHANNELS = [name for name, _type, _unit in CHANNELS if name in PLACES]


def subject_of(pseudonym: str) -> str:
    """Return a pseudonym as BIDS writes labels: letters and digits alone."""
    return "sub-" + "".join(filter(str.isalnum, pseudonym))


class MotionSink:
    """Rows of ``STEPS`` as one run of motion data, with its sidecars; no files without strides."""

    def __init__(self, folder: Path, pseudonym: str, session: int, unit: str) -> None:
        self.subject, self._unit = subject_of(pseudonym), unit
        place = folder / self.subject / f"ses-{session}" / "motion"
        place.mkdir(parents=True)
        stem = f"{self.subject}_ses-{session}_task-{TASK}"
        self._stem, self.events = place / f"{stem}_tracksys-{SYSTEM}", place / f"{stem}_events.tsv"
        self._file = self._path("motion.tsv").open("w", encoding="utf-8", newline="")
        self.first_at: datetime | None = None
        self._first_s = self._last_s = 0.0
        self.count = 0

    def _path(self, suffix: str) -> Path:
        return self._stem.with_name(f"{self._stem.name}_{suffix}")

    def write(self, rows: Rows) -> None:
        """Write some strides."""
        for row in rows:
            time_s = row[PLACES["time"]]
            if self.first_at is None:
                self.first_at, self._first_s = row[PLACES["received_at"]], time_s
            self._last_s = time_s
            self.count += 1
            cells = dict(zip(PLAIN_CHANNELS, (row[PLACES[n]] for n in PLAIN_CHANNELS), strict=True))
            cells |= {
                "latency": time_s - self._first_s,
                "right_leg": row[PLACES["side"]] == "right",
            }
            self._file.write("\t".join(_format(cells[n]) for n, _t, _u in CHANNELS) + "\n")

    def close(self) -> None:
        """Close the run and describe it; without strides, remove it."""
        self._file.close()
        if not self.count:
            self._path("motion.tsv").unlink()
            self._stem.parent.rmdir()
            return
        lasted_s = self._last_s - self._first_s
        sidecar = {
            "TaskName": TASK,
            "TaskDescription": "Walking with feedback on each step of the trained leg.",
            "TrackingSystemName": SYSTEM,
            "SamplingFrequency": (self.count - 1) / lasted_s if lasted_s > 0 else 1.0,
            "MotionChannelCount": len(CHANNELS),
            "LATENCYChannelCount": 1,
            "MISCChannelCount": len(CHANNELS) - 1,
            "TrackedPointsCount": 0,
            "RecordingType": "discontinuous",
            "MissingValues": MISSING,
        }
        self._path("motion.json").write_text(json.dumps(sidecar, indent=2) + "\n", "utf-8")
        own_unit = format_cell(" ".join(self._unit.split()))  # a clinic's own words
        lines = ["name\tcomponent\ttype\ttracked_point\tunits"]
        for name, kind, unit in CHANNELS:
            lines.append(f"{name}\t{MISSING}\t{kind}\t{MISSING}\t{unit or own_unit or MISSING}")
        self._path("channels.tsv").write_text("\n".join(lines) + "\n", "utf-8")


class EventSink:
    """Rows of ``EVENTS`` as BIDS events; times are from the first stride that was received."""

    def __init__(self, motion: MotionSink) -> None:
        self._motion = motion
        self._lines: list[tuple[float, str]] = []

    def write(self, rows: Rows) -> None:
        """Take some events; a session has some hundred of them."""
        began = self._motion.first_at
        for _session, _patient, at, _after, kind, _old, value, *_rest in rows:
            if began is not None:
                onset = (at - began).total_seconds()
                self._lines.append((onset, f"{onset}\t0\t{kind}\t{_format(value)}"))

    def close(self) -> None:
        """Write the file, in the order of time."""
        if self._motion.count:
            lines = [line for _onset, line in sorted(self._lines)]
            text = "\n".join(["onset\tduration\ttrial_type\tvalue", *lines])
            self._motion.events.write_text(text + "\n", "utf-8")


def _format(value: Any) -> str:
    if value is None:
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
    columns = {each.name: each.meaning for each in covariates(Patient).values()}
    yield "participants.json", _json({k: {"Description": v} for k, v in columns.items()})
    lines = ["\t".join(["participant_id", *columns])]
    for row in participants:
        cells = [row["participant_id"], *(row.get(name) or MISSING for name in columns)]
        lines.append("\t".join(map(str, cells)))
    yield "participants.tsv", "\n".join(lines) + "\n"
    events = {
        "onset": {"Description": "Seconds from the first stride that was received."},
        "trial_type": {"Description": "What was done, noted, or done by the robot."},
        "value": {"Description": "Value after a change; of a remark its strength."},
    }
    yield f"task-{TASK}_events.json", _json(events)


def _json(data: Any) -> str:
    return json.dumps(data, indent=2, ensure_ascii=False) + "\n"
