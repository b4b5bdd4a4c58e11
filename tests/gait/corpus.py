"""Walks of people and systems that GARRY was not built with, and people made up between them.

Read from ``../shared/data``: moore2013 (HBM, split belt), gaitalytics (Nexus, Plug-in Gait, split
belt), BTK's two (Plug-in Gait, overground), OpenSim's subject01 (plates, overground), subject 7 of
HBM's paper (one leg on a treadmill, with the inverse dynamics that GaitAnalysisToolKit tests
itself by; its folder is not everywhere). A stride is
clean where the file's own events agree with the plates on both feet and nothing is missing.
Nothing here uses detectors of ``rehab.gait``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.io import loadmat
from scipy.signal import butter, filtfilt

from rehab.gait import LegSamples, Stride, measure_strides
from rehab.gait.recordings.readers import read_any_table
from tests.gait.walks import read_moore
from tests.support.data import DATA, signals

SIDES = ("left", "right")
DEGREES = np.pi / 180
LOADED_N = 20.0
BEFORE_S, AFTER_S = 0.02, 0.06  # of a stance, that have to be there
FREE_S = 0.15  # that a plate has borne nobody: else the other foot left it just before
GAP_S, LEAST = 0.025, 0.3  # between samples: at most, and at least in periods; else some came late
EVENT_S = 0.035  # between the file's events and the plates


@dataclass(frozen=True)
class CorpusWalk:
    """A recorded walk in SI units, with what its own file says of it.

    ``power_w_kg`` is the file's own ankle power by side, where it has one; ``events_s`` are its
    initial and terminal contacts by side, where it has any. ``known`` are the clean stances of a
    walk that was made of another one: side, begin and end [s].
    """

    name: str
    t_s: np.ndarray
    legs: dict[str, LegSamples]
    mass_kg: float
    is_overground: bool
    power_w_kg: dict[str, np.ndarray] = field(default_factory=dict)
    events_s: dict[str, dict[str, np.ndarray]] = field(default_factory=dict)
    known: tuple[tuple[str, float, float], ...] | None = None

    @property
    def rate_hz(self) -> float:
        return float(1 / np.median(np.diff(self.t_s)))

    def measure(self) -> list[Stride]:
        return measure_strides(
            self.t_s,
            self.legs,
            rate_hz=self.rate_hz,
            mass_kg=self.mass_kg,
            look_ahead_s=0.05,
            is_overground=self.is_overground,
        )


@dataclass(frozen=True)
class CleanStride:
    """A stance, and its A2 by the method of the references: 6 Hz, forward-backward, the whole."""

    side: str
    begin_s: float
    end_s: float
    a2_w_kg: float
    file_a2_w_kg: float | None


PLUG_IN_GAIT = {
    "gaitalytics treadmill": "gaitalytics_treadmill_events.c3d",
    "BTK flatfoot": "btk_pig_flatfoot_full.c3d",
    "BTK motion3": "btk_pig_motion3_ff.c3d",
}


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


def _read_hbm() -> CorpusWalk:
    """GaitAnalysisToolKit 0.2.0, octave/2d_inverse_dynamics/test: markers, plate, and results."""
    folder, mass_kg = signals(HBM), 67.2
    raw = np.loadtxt(folder / "rawdata.txt", comments="%")
    found = loadmat(folder / "refresults.mat")["refresults"]  # hip, knee, ankle of each figure
    angle, velocity, moment = found[:, 2], found[:, 5], found[:, 8]
    legs = {"right": LegSamples(raw[:, 14], moment * mass_kg, angle)}
    return CorpusWalk(
        "HBM subject 7", raw[:, 0], legs, mass_kg, False, {"right": moment * velocity}
    )


HBM = "hbm_subject7"
READERS = {
    "moore2013": _read_moore,
    "gaitalytics treadmill": _read_gaitalytics,
    "BTK flatfoot": lambda: _read_vicon("btk_pig_flatfoot_full.c3d", 47.5, "", is_overground=True),
    "BTK motion3": lambda: _read_vicon("btk_pig_motion3_ff.c3d", 74.0, "V", is_overground=True),
    "OpenSim subject01": _read_opensim,
    "HBM subject 7": _read_hbm,
}
PRESENT = [name for name in READERS if name != "HBM subject 7" or (DATA / "raw" / HBM).exists()]


@cache
def open_corpus(name: str) -> CorpusWalk:
    """Return a walk of the corpus, or skip the test where it is absent."""
    return READERS[name]()


def find_stances(walk: CorpusWalk, side: str) -> list[tuple[float, float]]:
    """Return when a leg's force was above 20 N, for a fifth of a second or more."""
    force = np.asarray(walk.legs[side].force_n)
    edges = np.flatnonzero(np.diff(np.concatenate(([False], force > LOADED_N, [False]))))
    stances: list[list[int]] = []
    for first, stop in edges.reshape(-1, 2).tolist():
        if stances and walk.t_s[first] - walk.t_s[stances[-1][1] - 1] < 0.05:
            stances[-1][1] = stop
        else:
            stances.append([first, stop])
    return [
        (float(walk.t_s[first]), float(walk.t_s[stop - 1]))
        for first, stop in stances
        if first > 0 and stop < len(force) and walk.t_s[stop - 1] - walk.t_s[first] > 0.2
    ]


def find_clean(walk: CorpusWalk) -> list[CleanStride]:
    """Return the strides that any detector should measure, with their A2."""
    known = find_clean_stances(walk) if walk.known is None else walk.known
    powers = {side: filter_power(walk, side) for side in walk.legs}
    found = []
    for side, begin_s, end_s in known:
        late_s = (begin_s + 0.4 * (end_s - begin_s), end_s)
        late = slice(*np.searchsorted(walk.t_s, late_s))
        own = walk.power_w_kg.get(side)
        file_a2 = None if own is None else float(np.nanmax(own[late]))
        found.append(CleanStride(side, begin_s, end_s, float(powers[side][late].max()), file_a2))
    return found


def find_clean_stances(walk: CorpusWalk) -> tuple[tuple[str, float, float], ...]:
    """Return side, begin and end of the stances of which nothing is missing or on both plates."""
    stances = {side: find_stances(walk, side) for side in walk.legs}
    found = []
    for side, own in stances.items():
        other = SIDES[side == "left"]
        leg = np.array([np.asarray(row, dtype=float) for row in walk.legs[side][:3]])
        off_s = -math.inf
        for begin_s, end_s in own:
            was_free, off_s = begin_s - off_s > FREE_S, end_s
            first, stop = np.searchsorted(walk.t_s, (begin_s - BEFORE_S, end_s + AFTER_S))
            steps_s = np.diff(walk.t_s[first:stop])
            is_whole = first > 0 and stop < len(walk.t_s)
            is_even = steps_s.max() < GAP_S and steps_s.min() > LEAST / walk.rate_hz
            is_known = bool(np.isfinite(leg[:, first:stop]).all())
            if not (is_whole and is_even and is_known and was_free):
                continue
            if not walk.events_s or _agrees(walk, side, other, begin_s, end_s, stances):
                found.append((side, begin_s, end_s))
    return tuple(sorted(found, key=lambda one: one[2]))


def _agrees(walk, side, other, begin_s, end_s, stances) -> bool:
    """Return whether plates and the file's events agree on this stance and the other foot's."""

    def is_near(who: str, kind: str, at_s: float) -> bool:
        events = walk.events_s[who][kind]
        return bool(len(events) and np.abs(events - at_s).min() < EVENT_S)

    if not (is_near(side, "Foot Strike", begin_s) and is_near(side, "Foot Off", end_s)):
        return False
    around = [(b, e) for b, e in stances[other] if b < end_s and e > begin_s]
    return all(
        (not begin_s < e < end_s or is_near(other, "Foot Off", e))
        and (not begin_s < b < end_s or is_near(other, "Foot Strike", b))
        for b, e in around
    )


def filter_power(walk: CorpusWalk, side: str) -> np.ndarray:
    """Return ankle power [W/kg], shape (n,), filtered at 6 Hz over the whole walk."""
    rate_hz = walk.rate_hz
    grid = np.arange(walk.t_s[0], walk.t_s[-1], 1 / rate_hz)
    b, a = butter(2, 6 / (rate_hz / 2))
    rows = []
    for row in walk.legs[side][1:3]:
        values = np.asarray(row, dtype=float)
        known = np.isfinite(values)
        rows.append(filtfilt(b, a, np.interp(grid, walk.t_s[known], values[known])))
    power = rows[0] / walk.mass_kg * np.gradient(rows[1], 1 / rate_hz)
    return np.asarray(np.interp(walk.t_s, grid, power))


def bend(walk: CorpusWalk, values: np.ndarray) -> CubicSpline:
    """Return a smooth curve through samples 10 ms apart, as motion capture takes them."""
    every = max(1, round(0.01 * walk.rate_hz))
    known = np.isfinite(values[::every])
    return CubicSpline(walk.t_s[::every][known], values[::every][known])


def vary(
    walk: CorpusWalk,
    *,
    braking_s: float = 0.0,
    tempo: float = 1.0,
    stiffness: float = 1.0,
    heavier: float = 1.0,
    is_mirrored: bool = False,
) -> CorpusWalk:
    """Return another person's walk, made of this one.

    Parameters
    ----------
    braking_s
        By how much later the ankles brake after the feet have left [s].
    tempo
        How many times as long all takes.
    stiffness
        What the ankles' motion is divided by.
    heavier
        How many times as heavy the person is: force and moment grow with it.
    is_mirrored
        Whether left and right change places.
    """
    t_s = np.arange(walk.t_s[0], walk.t_s[0] + tempo * np.ptp(walk.t_s), 1 / walk.rate_hz)
    before_s = (t_s - t_s[0]) / tempo + t_s[0]
    legs, named = {}, {}
    for side in SIDES:
        rows = [np.asarray(row, dtype=float) for row in walk.legs[side][:3]]
        moved = before_s.copy()
        for _, end_s in find_stances(walk, side) if braking_s else ():
            after_s = before_s - end_s
            rise = np.clip((after_s + 0.12) / 0.16, 0, 1)
            fall = np.clip((0.35 - after_s) / 0.25, 0, 1)
            moved -= braking_s * (1 - np.cos(np.pi * np.minimum(rise, fall))) / 2
        force = np.interp(before_s, walk.t_s, rows[0])
        moment, angle = (
            bend(walk, row)(at) for at, row in zip((before_s, moved), rows[1:], strict=True)
        )
        named[side] = SIDES[side == "left"] if is_mirrored else side
        legs[named[side]] = LegSamples(force * heavier, moment * heavier, angle / stiffness)
    known = tuple(
        (named[side], *((at_s - walk.t_s[0]) * tempo + walk.t_s[0] for at_s in times))
        for side, *times in find_clean_stances(walk)
    )
    varied = replace(walk, t_s=t_s, legs=legs, mass_kg=walk.mass_kg * heavier, known=known)
    return replace(varied, power_w_kg={}, events_s={})


def own_legs(table: Any) -> dict[str, LegSamples]:
    """Return both legs with moment and angle from plates and markers."""
    return {
        side: LegSamples(
            table[f"plates.{side}"], table[f"own.{side}_moment_nm"], table[f"own.{side}_angle_rad"]
        )
        for side in ("left", "right")
    }
