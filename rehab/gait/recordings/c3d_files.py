"""C3D files: analog channels, and the model's moments and angles, as columns. Needs ezc3d."""

from __future__ import annotations

import importlib
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np

from rehab.gait.recordings.plates import assign_plates
from rehab.gait.recordings.table import RATE_MOST_HZ, Table, resample_channel
from rehab.gait.settings import MASS_MAX_KG, MASS_MIN_KG
from rehab.gait.signals.filters import Floats
from rehab.gait.strides import GaitInputError

# By the C3D manual's type of a plate, the rows of its channels that are vertical; of the fourth
# after its calibration.
CALIBRATED = 4
VERTICAL = {1: slice(2, 3), 2: slice(2, 3), 3: slice(4, 8), CALIBRATED: slice(2, 3)}
# Where Nexus, Qualisys, Visual3D and Motive store the body mass [kg].
MASSES = (
    ("PROCESSING", "Bodymass"), ("PROCESSING", "BodyMass"), ("SUBJECTS", "MASS"),
    ("SUBJECTS", "WEIGHT"), ("SUBJECTS", "Bodymass"), ("SUBJECT", "MASS"), ("SUBJECT", "WEIGHT"),
)  # fmt: skip
# Lateral malleoli, else heels, after the letter of the side.
ANKLE_MARKERS = (
    "ANK", "LM", "ANKL", "LMAL", "LANK", "ANKLE", "LMALL", "MALL", "_ANK", "_LM", "_LMAL", "_ANKLE",
    "_FAL", "FAL", "HEE", "_HEE", "HEEL", "_HEEL", "_FCC", "FCC", "_CAL", "CAL",
)  # fmt: skip


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
            "C3D files need ezc3d, which is not installed. Cure: pip install ezc3d, or export CSV."
        ) from None
    _try_apart(path)
    try:
        file = ezc3d.c3d(str(path))
    except (OSError, RuntimeError, ValueError) as problem:
        raise GaitInputError(f"{path.name} is no C3D file ({problem}). Export it again.") from None
    points, analogs = file["data"]["points"], file["data"]["analogs"][0]
    rates = (_read_rate(file, "POINT"), _read_rate(file, "ANALOG"))
    rate_hz = max(rates)
    if not 0 < rate_hz < RATE_MOST_HZ:
        raise GaitInputError(f"{path.name} has no usable rate. Export it again.")
    seconds = max(
        points.shape[2] / rates[0] if rates[0] else 0.0,
        analogs.shape[1] / rates[1] if rates[1] else 0.0,
    )
    time: Floats = np.arange(round(seconds * rate_hz)) / rate_hz
    table = Table({"time": time}, mass_kg=_read_mass(file))
    units = [str(unit) for unit in _read_values(file, "ANALOG", "UNITS")]
    for place, (label, values) in enumerate(
        zip(_read_labels(file, "ANALOG"), analogs, strict=False)
    ):
        table[label] = resample_channel(values, rates[1], time)
        table.units[label] = units[place] if place < len(units) else ""
    of_kind = {
        label: str(unit[0])
        for kind in ("ANGLE", "FORCE", "MOMENT")
        if len(unit := _read_values(file, "POINT", f"{kind}_UNITS"))
        for label in _read_labels(file, "POINT", f"{kind}S")
    }
    for place, label in enumerate(_read_labels(file, "POINT")[: points.shape[1]]):
        for axis, name in enumerate("XYZ"):
            column = f"{label}.{name}"
            table[column] = resample_channel(points[axis, place], rates[0], time)
            table.units |= {column: of_kind[label]} if label in of_kind else {}
    _add_plates(file, table)
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


def _add_plates(file: Any, table: Table) -> None:
    """Add the vertical force of each leg [N] as ``plates.left`` and ``plates.right``.

    None where the file has no places of its plates, or no markers at the ankles.
    """
    corners = np.asarray(_read_values(file, "FORCE_PLATFORM", "CORNERS"), dtype=np.float64)
    channels = np.asarray(_read_values(file, "FORCE_PLATFORM", "CHANNEL"), dtype=np.int64)
    types = np.asarray(_read_values(file, "FORCE_PLATFORM", "TYPE"), dtype=np.int64).ravel()
    calibration = np.asarray(_read_values(file, "FORCE_PLATFORM", "CAL_MATRIX"), dtype=np.float64)
    labels = _read_labels(file, "ANALOG")
    if corners.ndim != 3 or channels.ndim != 2 or not np.isin(types, tuple(VERTICAL)).all():
        return
    if not ((channels >= 0) & (channels <= len(labels))).all() or not len(types):
        return
    markers = {name.rpartition(":")[2].upper(): name for name in _read_labels(file, "POINT")}
    unit = _read_values(file, "POINT", "UNITS")
    scale = {"m": 1000.0, "cm": 10.0}.get(str(unit[0]).strip(), 1.0) if len(unit) else 1.0
    ankles = {
        side: scale * np.array([table[f"{markers[letter + name]}.{axis}"] for axis in "XYZ"])
        for side, letter in (("left", "L"), ("right", "R"))
        for name in reversed(ANKLE_MARKERS)
        if f"{markers.get(letter + name)}.Z" in table
    }
    if len(ankles) < 2:
        return
    up_n = []
    for plate, kind in enumerate(types.tolist()):
        rows = np.array([table[labels[place - 1]] for place in channels[:, plate] if place])
        if kind == CALIBRATED and calibration.ndim == 3:
            rows = calibration[:, :, plate] @ rows[: calibration.shape[1]]
        force = rows[VERTICAL[kind]].sum(axis=0)
        up_n.append(force if force.max() > -force.min() else -force)  # some store the reaction
    forces, unknown = assign_plates(
        np.array(up_n), scale * corners.transpose(2, 1, 0)[:, :, :2], ankles
    )
    for side, force in forces.items():
        if force.any():
            table[f"plates.{side}"] = force
            table.units[f"plates.{side}"] = (
                "N" if CALIBRATED in types else table.units.get(labels[channels[2, 0] - 1], "")
            )
    if unknown:
        table.notes = (
            f"{unknown} contacts of a plate are of both feet or of neither, and left out",
        )


def _read_mass(file: Any) -> float | None:
    """Return the body mass that Nexus or another program has stored [kg], None without one."""
    for group, name in MASSES:
        value = np.asarray(_read_values(file, group, name)).ravel()
        if len(value) == 1 and value.dtype.kind in "if":
            return float(value[0]) if MASS_MIN_KG <= value[0] <= MASS_MAX_KG else None
    return None


def _read_values(file: Any, group: str, name: str) -> Any:
    """Return the values of a parameter; ``?`` stands for a byte that is no character."""
    values = file["parameters"].get(group, {}).get(name, {}).get("value", [])
    return [
        value.encode(errors="replace").decode() if isinstance(value, str) else value
        for value in values
    ]


def _read_rate(file: Any, group: str) -> float:
    value = _read_values(file, group, "RATE")
    return float(value[0]) if len(value) else 0.0


def _read_labels(file: Any, group: str, name: str = "LABELS") -> list[str]:
    """Return the labels of a group; each parameter holds 255, those after it have numbers."""
    return [
        str(label).strip()
        for number in ("", *range(2, 20))
        for label in _read_values(file, group, f"{name}{number}")
    ]
