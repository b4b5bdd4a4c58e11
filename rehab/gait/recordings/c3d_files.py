"""C3D files: analog channels, and the model's moments and angles, as columns. Needs ezc3d."""

from __future__ import annotations

import importlib
from pathlib import Path
from typing import Any

import numpy as np

from rehab.gait.recordings.plates import assign_plates
from rehab.gait.recordings.rates import resample_channel
from rehab.gait.signals.filters import Floats
from rehab.gait.strides import GaitInputError

PLATE_TYPES = (2, 4)  # of the C3D manual: forces and moments, as they act on the plate
ANKLE_MARKERS = ("ANK", "LM", "ANKL", "LMAL")  # lateral, after the letter of the side


def read_table(path: Path) -> dict[str, Floats]:
    """Return a C3D file's columns by name, with ``time`` [s], at the faster of its two rates.

    Points have three columns, ``name.X`` to ``name.Z``; of moments and angles X is the sagittal
    plane. Units are as the file has them.

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
    try:
        file = ezc3d.c3d(str(path))
    except (OSError, RuntimeError, ValueError) as problem:
        raise GaitInputError(f"{path.name} is no C3D file ({problem}). Export it again.") from None
    points, analogs = file["data"]["points"], file["data"]["analogs"][0]
    rates = (_read_rate(file, "POINT"), _read_rate(file, "ANALOG"))
    rate_hz = max(rates)
    if not rate_hz > 0:
        raise GaitInputError(f"{path.name} tells no rate. Export it again.")
    seconds = max(
        points.shape[2] / rates[0] if rates[0] else 0.0,
        analogs.shape[1] / rates[1] if rates[1] else 0.0,
    )
    time: Floats = np.arange(round(seconds * rate_hz)) / rate_hz
    columns = {"time": time}
    for label, values in zip(_read_labels(file, "ANALOG"), analogs, strict=False):
        columns[label] = resample_channel(values, rates[1], time)
    for place, label in enumerate(_read_labels(file, "POINT")[: points.shape[1]]):
        for axis, name in enumerate("XYZ"):
            columns[f"{label}.{name}"] = resample_channel(points[axis, place], rates[0], time)
    return columns | _read_plates(file, columns)


def _read_plates(file: Any, columns: dict[str, Floats]) -> dict[str, Floats]:
    """Return the vertical force of each leg [N] as ``plates.left`` and ``plates.right``.

    Empty where the file does not say where its plates are, or has no markers at the ankles.
    """
    group = file["parameters"].get("FORCE_PLATFORM", {})
    corners = np.asarray(group.get("CORNERS", {}).get("value", []), dtype=np.float64)
    channels = np.asarray(group.get("CHANNEL", {}).get("value", []), dtype=np.int64)
    types = np.asarray(group.get("TYPE", {}).get("value", []), dtype=np.int64).ravel()
    if corners.ndim != 3 or channels.ndim != 2 or not np.isin(types, PLATE_TYPES).all():
        return {}
    labels = _read_labels(file, "ANALOG")
    vertical = channels[2] - 1
    if not ((vertical >= 0) & (vertical < len(labels))).all():
        return {}
    markers = {
        side: name
        for side, letter in (("left", "L"), ("right", "R"))
        for name in reversed(ANKLE_MARKERS)
        if f"{letter}{name}.Z" in columns
    }
    if len(markers) < 2:
        return {}
    ankles = {
        side: np.array([columns[f"{side[0].upper()}{name}.{axis}"] for axis in "XYZ"])
        for side, name in markers.items()
    }
    up_n = -np.array([columns[labels[place]] for place in vertical.tolist()])
    forces, _ = assign_plates(up_n, corners.transpose(2, 1, 0)[:, :, :2], ankles)
    return {f"plates.{side}": force for side, force in forces.items()}


def _read_rate(file: Any, group: str) -> float:
    value = file["parameters"].get(group, {}).get("RATE", {}).get("value", [0.0])
    return float(value[0]) if len(value) else 0.0


def _read_labels(file: Any, group: str) -> list[str]:
    """Return the labels of a group, of which there are more with each 255."""
    parameters = file["parameters"].get(group, {})
    labels: list[str] = []
    for number in range(1, 20):
        more = parameters.get("LABELS" if number == 1 else f"LABELS{number}", {}).get("value", [])
        labels += [str(label).strip() for label in more]
    return labels
