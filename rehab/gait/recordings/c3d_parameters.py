"""Parameters of a C3D file, as ezc3d reads them."""

from __future__ import annotations

from typing import Any

import numpy as np

from rehab.gait.settings import MASS_MAX_KG, MASS_MIN_KG

# Where Nexus, Qualisys, Visual3D and Motive store the body mass [kg].
MASSES = (
    ("PROCESSING", "Bodymass"), ("PROCESSING", "BodyMass"), ("SUBJECTS", "MASS"),
    ("SUBJECTS", "WEIGHT"), ("SUBJECTS", "Bodymass"), ("SUBJECT", "MASS"), ("SUBJECT", "WEIGHT"),
)  # fmt: skip


def read_mass(file: Any) -> float | None:
    """Return the body mass that Nexus or another program has stored [kg], None without one."""
    for group, name in MASSES:
        value = np.asarray(read_values(file, group, name)).ravel()
        if len(value) == 1 and value.dtype.kind in "if":
            return float(value[0]) if MASS_MIN_KG <= value[0] <= MASS_MAX_KG else None
    return None


def read_values(file: Any, group: str, name: str) -> Any:
    """Return the values of a parameter; ``?`` stands for a byte that is no character."""
    values = file["parameters"].get(group, {}).get(name, {}).get("value", [])
    return [
        value.encode(errors="replace").decode() if isinstance(value, str) else value
        for value in values
    ]


def read_rate(file: Any, group: str) -> float:
    """Return the rate of points or analog channels [Hz], 0 without one."""
    value = read_values(file, group, "RATE")
    return float(value[0]) if len(value) else 0.0


def read_labels(file: Any, group: str, name: str = "LABELS") -> list[str]:
    """Return the labels of a group, of which there are more with each 255."""
    return [
        str(label).strip()
        for number in ("", *range(2, 20))
        for label in read_values(file, group, f"{name}{number}")
    ]
