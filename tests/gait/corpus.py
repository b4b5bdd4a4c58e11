"""Walks of other people and systems than GARRY was built with, each with its own A2 to compare.

Read from ``../shared/data``. Real: moore2013 (HBM, split belt), gaitalytics (Nexus, Plug-in Gait,
split belt), BTK's two (Plug-in Gait, overground) and OpenSim's subject01 (plates, overground).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

import numpy as np
from scipy.signal import butter, filtfilt

from rehab.gait import LegSamples
from rehab.gait.recordings.tables import read_any_table
from tests.gait.walks import read_moore
from tests.support.data import signals

SIDES = ("left", "right")
DEGREES = np.pi / 180


@dataclass(frozen=True)
class CorpusWalk:
    """A recorded walk in SI units, with what its own file says of it.

    ``power_w_kg`` is the file's own ankle power by side, where it has one; ``events_s`` are its
    initial and terminal contacts by side, where it has any.
    """

    name: str
    t_s: np.ndarray
    legs: dict[str, LegSamples]
    mass_kg: float
    is_overground: bool
    power_w_kg: dict[str, np.ndarray] = field(default_factory=dict)
    events_s: dict[str, dict[str, np.ndarray]] = field(default_factory=dict)

    @property
    def rate_hz(self) -> float:
        return float(1 / np.median(np.diff(self.t_s)))


def read_lab_file(name: str) -> Path:
    return signals("lab_files") / name


def _read_vicon(name: str, mass_kg: float, ending: str, *, is_overground: bool) -> CorpusWalk:
    """Plug-in Gait: moments in N·mm/kg, power in W/kg, angles in degrees, dorsiflexion positive."""
    path = read_lab_file(name)
    table = read_any_table(path)
    time_s = table["time"]
    legs, powers = {}, {}
    for side in SIDES:
        letter = side[0].upper()
        moment = table[f"{letter}AnkleMoment.X"] * mass_kg / 1000
        angle = -table[f"{letter}AnkleAngles{ending}.X"] * DEGREES
        legs[side] = LegSamples(table[f"plates.{side}"], moment, angle)
        powers[side] = table[f"{letter}AnklePower.Z"]
    return CorpusWalk(name, time_s, legs, mass_kg, is_overground, powers, _read_events(path))


def _read_events(path: Path) -> dict[str, dict[str, np.ndarray]]:
    ezc3d = __import__("ezc3d")
    file = ezc3d.c3d(str(path))
    event = file["parameters"]["EVENT"]
    times = np.reshape(
        event["TIMES"]["value"],
        (2, -1),
        order="F" if np.ndim(event["TIMES"]["value"]) == 1 else "C",
    )[1]
    header = file["header"]["points"]
    times = times - header["first_frame"] / header["frame_rate"]
    found: dict[str, dict[str, list[float]]] = {
        side: {"Foot Strike": [], "Foot Off": []} for side in SIDES
    }
    for side, kind, at_s in zip(
        event["CONTEXTS"]["value"], event["LABELS"]["value"], times, strict=True
    ):
        found[side.lower()][kind].append(float(at_s))
    return {
        side: {kind: np.sort(at_s) for kind, at_s in kinds.items()} for side, kinds in found.items()
    }


def _read_gaitalytics() -> CorpusWalk:
    name = "gaitalytics_treadmill_events.c3d"
    return _read_vicon(name, 55.326, "", is_overground=False)


def _read_opensim() -> CorpusWalk:
    forces, moments, angles = (
        read_any_table(read_lab_file(f"g23_{kind}")) for kind in ("grf.mot", "id.sto", "ik.mot")
    )
    time_s = forces["time"]
    part = (time_s >= moments["time"][0]) & (time_s <= moments["time"][-1])
    time_s = time_s[part]

    def resample(table, name, factor):
        return np.interp(time_s, table["time"], table[name]) * factor

    legs = {
        side: LegSamples(
            forces[f"{plate}ground_force_vy"][part],
            resample(moments, f"ankle_angle_{side[0]}_moment", -1.0),
            resample(angles, f"ankle_angle_{side[0]}", -DEGREES),
        )
        for side, plate in (("right", ""), ("left", "1_"))
    }
    return CorpusWalk("g23 (OpenSim)", time_s, legs, 72.6, True)


def _read_moore() -> CorpusWalk:
    walk, _ = read_moore()
    legs = {"left": LegSamples(*walk.left), "right": LegSamples(*walk.right)}
    return CorpusWalk("moore2013", walk.t_s, legs, walk.mass_kg, False)


READERS = {
    "moore2013": _read_moore,
    "gaitalytics treadmill": _read_gaitalytics,
    "BTK flatfoot": lambda: _read_vicon(
        "btk_pig_flatfoot_full.c3d", 47.5, "", is_overground=True
    ),
    "BTK motion3": lambda: _read_vicon("btk_pig_motion3_ff.c3d", 74.0, "V", is_overground=True),
    "OpenSim subject01": _read_opensim,
}


@cache
def open_corpus(name: str) -> CorpusWalk:
    """Return a walk of the corpus, or skip the test where it is absent."""
    return READERS[name]()
