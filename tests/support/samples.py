"""Writes the data to try things with that pages offer: `python -m tests.support.samples`."""

from __future__ import annotations

import csv
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from rehab.sources.synthetic import walk
from rehab.training.phases import make_phase
from tests.support.servers import ROOT
from tests.support.synthetic_recordings import make_signals

FOLDER = ROOT / "static" / "samples"
SIGNALS = ["Time (s)"] + [
    f"{side} {name}"
    for side in ("Left", "Right")
    for name in ("Fz (N)", "AnkleMoment (Nm)", "AnkleAngle (rad)")
]
PHASES = (make_phase("baseline", strides=20), make_phase("training", strides=60))


def write(folder: Path) -> None:
    """Write both files: signals of half a minute, and strides of a session."""
    strides = list(walk(seed=7, phases=PHASES))
    recording = make_signals(strides[:28], seed=7)
    columns = [recording.t_s]
    for leg in (recording.left, recording.right):
        columns += [leg.force_n, leg.moment_nm, leg.angle_rad]
    rounded = [[f"{value:.4g}" for value in column] for column in columns[1:]]
    times = [f"{time_s:.4f}" for time_s in recording.t_s]
    _write(folder / "signals.csv", SIGNALS, zip(times, *rounded, strict=True))
    kinds = [phase.kind for phase in PHASES for _ in range(phase.strides or 0)]
    _write(
        folder / "strides.csv",
        ["time_s", "value", "number", "side", "valid", "kind"],
        (
            (
                f"{one.time_s:.3f}",
                "" if one.value is None else f"{one.value:.3f}",
                number,
                one.side.value,
                int(not one.reasons),
                kind,
            )
            for number, (one, kind) in enumerate(zip(strides, kinds, strict=True), 1)
        ),
    )


def _write(file: Path, head: list[str], rows: Iterable[Sequence[Any]]) -> None:
    with file.open("w", newline="") as out:
        writer = csv.writer(out, lineterminator="\n")
        writer.writerow(head)
        writer.writerows(rows)


if __name__ == "__main__":
    write(FOLDER)
