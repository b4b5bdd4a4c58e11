"""C3D files: analog channels, and the model's moments and angles, as columns. Needs ezc3d."""

from __future__ import annotations

import importlib
import subprocess
import sys
from pathlib import Path

import numpy as np

from rehab.gait.recordings.c3d_parameters import read_labels, read_mass, read_rate, read_values
from rehab.gait.recordings.c3d_plates import add_plates
from rehab.gait.recordings.table import RATE_MOST_HZ, Table, resample_channel
from rehab.gait.signals.filters import Floats
from rehab.gait.strides import GaitInputError

GROUND = ("GroundReactionForce", "NormalisedGRF")


def read_table(path: Path) -> Table:
    """Return a C3D file's columns by name, with ``time`` [s], at the faster of its two rates.

    Points have three columns, ``name.X`` to ``name.Z``; of moments and angles X is the sagittal
    plane. Numbers are as the file has them, with its units and its body mass.

    Raises
    ------
    GaitInputError
        With the cure, where ezc3d is not installed or the file is no C3D.
    """
    try:
        ezc3d = importlib.import_module("ezc3d")
    except ImportError:
        raise GaitInputError(
            "C3D files need ezc3d, which is not installed. Cure: in GARRY's folder "
            ".venv/bin/pip install ezc3d, or export CSV."
        ) from None
    _try_apart(path)
    try:
        file = ezc3d.c3d(str(path))
    except (OSError, RuntimeError, ValueError) as problem:
        raise GaitInputError(f"{path.name} is no C3D file ({problem}). Export it again.") from None
    points, analogs = file["data"]["points"], file["data"]["analogs"][0]
    rates = (read_rate(file, "POINT"), read_rate(file, "ANALOG"))
    rate_hz = max(rates)
    if not 0 < rate_hz < RATE_MOST_HZ:
        raise GaitInputError(f"{path.name} has no usable rate. Export it again.")
    counts = (points.shape[2], analogs.shape[1])
    seconds = max(count / rate for count, rate in zip(counts, rates, strict=True) if rate)
    time: Floats = np.arange(round(seconds * rate_hz)) / rate_hz
    table = Table({"time": time}, mass_kg=read_mass(file))
    units = [str(unit) for unit in read_values(file, "ANALOG", "UNITS")]
    for place, (label, values) in enumerate(
        zip(read_labels(file, "ANALOG"), analogs, strict=False)
    ):
        table[label] = resample_channel(values, rates[1], time)
        table.units[label] = units[place] if place < len(units) else ""
    length = "".join(str(unit) for unit in read_values(file, "POINT", "UNITS")[:1]) or "mm"
    of_kind = {
        label: str(unit[0])
        for kind in ("ANGLE", "FORCE", "MOMENT")
        if len(unit := read_values(file, "POINT", f"{kind}_UNITS"))
        for label in read_labels(file, "POINT", f"{kind}S")
    }
    for place, label in enumerate(read_labels(file, "POINT")[: points.shape[1]]):
        if label.endswith(GROUND):  # Plug-in Gait has none while the foot swings
            points[:3, place] = np.nan_to_num(points[:3, place])
        for axis, name in enumerate("XYZ"):
            column = f"{label}.{name}"
            table[column] = resample_channel(points[axis, place], rates[0], time)
            table.units[column] = of_kind.get(label, length)
    add_plates(file, table)
    return table


def _try_apart(path: Path) -> None:
    """Parse a file in a process of its own: ezc3d ends its process for some damaged files.

    Raises GaitInputError where it does.
    """
    command = "import sys, ezc3d; ezc3d.c3d(sys.argv[1])"
    tried = subprocess.run(
        [sys.executable, "-c", command, str(path)], capture_output=True, check=False
    )
    if tried.returncode not in {0, 1}:
        raise GaitInputError(f"{path.name} is a damaged C3D file. Export it again.")
