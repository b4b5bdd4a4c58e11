"""C3D files: analog channels, and the model's moments and angles, as columns. Needs ezc3d."""

from __future__ import annotations

import importlib
from pathlib import Path
from typing import Any

import numpy as np

from rehab.gait.recordings.rates import resample_channel
from rehab.gait.signals.filters import Floats
from rehab.gait.strides import GaitInputError


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
    return columns


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
