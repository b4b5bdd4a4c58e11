"""Proposes which column is which channel, with unit, sign, leg, mass and delay."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from rehab.gait.one_leg import GRAVITY_M_S2
from rehab.gait.settings import MASS_MAX_KG, MASS_MIN_KG, RATE_MAX_HZ, RATE_MIN_HZ
from rehab.gait.setup.guess import Guess
from rehab.gait.setup.shapes import SHAPES, find_likeness, make_profile
from rehab.gait.setup.sides import name_sides
from rehab.gait.setup.units import (
    ANGLE_RAD,
    ANGLE_SPREAD,
    ANGLE_UNITS,
    FORCE_BY_MASS,
    FORCE_UNITS,
    LEVER_M,
    LEVER_SPREAD,
    MASS_USUAL_KG,
    MOMENT_BY_MASS,
    MOMENT_UNITS,
    TIME_UNITS,
)
from rehab.gait.signals.clock import find_period
from rehab.gait.signals.filters import Floats
from rehab.gait.signals.frames import find_frame_problem
from rehab.gait.strides import GaitInputError

LIKE = 0.8  # correlation with a shape from which a column may be that channel
CERTAIN_LIKE, CERTAIN_LEAD = 0.88, 0.05  # and by how much it leads the next shape
SWING = (0.15, 0.7)  # of the time a plate is unloaded, in walking
# Of each channel, the shapes that a column may have instead.
RIVALS = {"moment": ("force", "forward", "knee angle"), "angle": ("knee angle", "hip angle")}


@dataclass(frozen=True, slots=True)
class Proposal:
    """What a recording's columns are thought to be.

    Attributes
    ----------
    time, time_factor
        Name of the time column and its factor to seconds.
    rate_hz
        Of the samples.
    mass_kg, is_mass_measured
        Body mass; whether it is from the plates.
    guesses
        By side and channel.
    frame
        Name of the column that counts the samples, if there is one.
    """

    time: str
    time_factor: float
    rate_hz: float
    mass_kg: float
    is_mass_measured: bool
    guesses: dict[tuple[str, str], Guess]
    frame: str | None = None


def propose(columns: Mapping[str, Floats], mass_kg: float | None = None) -> Proposal:
    """Return what columns are thought to be, from half a minute of walking or more.

    Parameters
    ----------
    columns
        By name, shape (n,) each.
    mass_kg
        Body mass if known; else it is measured with the plates.

    Raises
    ------
    GaitInputError
        With the cure, where no time goes on or no plate carries a walker.
    """
    time_name, time_factor = _find_time(columns)
    time_s = columns[time_name] * time_factor
    period_s = find_period(time_s) or 0.01
    forces = _find_forces(columns, time_name, time_s)
    if not forces:
        raise GaitInputError(
            "No column is a vertical force: none is zero in swing and has two humps in stance. "
            "Walk for half a minute with the plates on, and send their vertical force."
        )
    sides = name_sides([name for name, *_ in forces])
    scale, unit, mass, measured = _find_force_unit(columns, time_s, forces, mass_kg)
    light = ""
    if measured and mass < MASS_USUAL_KG[0]:
        light = f"in lbf or kgf it would carry a grown-up, in {unit} {mass:.1f} kg; give the mass"
    guesses = {}
    for (name, sign, likeness, contacts), side in zip(forces, sides, strict=True):
        guesses[side, "force"] = Guess(
            name,
            side,
            "force",
            sign * scale,
            unit,
            likeness,
            likeness > CERTAIN_LIKE and not light,
            light,
        )
        taken = {time_name, *(one[0] for one in forces)}
        force_n = columns[name] * sign * scale
        for channel in RIVALS:
            others = {c: v for c, v in columns.items() if c not in taken}
            guess = _find_channel(others, channel, side, time_s, contacts, force_n, mass)
            if guess is not None:
                guesses[side, channel] = guess
                taken.add(guess.column)
    frame = _find_frame(columns, time_name, time_s)
    return Proposal(time_name, time_factor, 1 / period_s, mass, measured, guesses, frame)


def _find_frame(columns: Mapping[str, Floats], time_name: str, time_s: Floats) -> str | None:
    """Return the column called a frame that counts the samples."""
    for name, values in columns.items():
        if "frame" in name.lower() and name != time_name and not find_frame_problem(time_s, values):
            return name
    return None


def _find_time(columns: Mapping[str, Floats]) -> tuple[str, float]:
    """Return the time's column and factor; what counts by one is a time if nothing else is."""
    counts = [name for name, values in columns.items() if find_period(values[:1000]) == 1.0]
    for name in (*(name for name in columns if name not in counts), *counts):
        values = columns[name]
        if len(values) < 100 or not np.isfinite(values).all():
            continue
        steps = np.diff(values)
        period = find_period(values)
        if not (steps > 0).mean() > 0.99 or period is None or steps.std() > 20 * period:
            continue
        for factor in TIME_UNITS.values():
            rate_hz = 1 / (period * factor)
            is_frame = factor == 1.0 and period == 1.0
            if RATE_MIN_HZ <= rate_hz <= RATE_MAX_HZ and not is_frame:
                return name, factor
    raise GaitInputError(
        "No column is a time that goes on. Send the device's own times in seconds, or give the "
        "rate of rows that are numbered: --rate 100."
    )


def _find_contacts(time_s: Floats, force: Floats) -> Floats:
    """Return when a force rises from nothing [s]."""
    high = float(np.percentile(force, 98))
    loaded = force > 0.15 * high
    rises = np.flatnonzero(loaded[1:] & ~loaded[:-1]) + 1
    kept: list[float] = []
    for at_s in time_s[rises].tolist():
        if not kept or at_s - kept[-1] > 0.5:
            kept.append(at_s)
    return np.array(kept)


def _find_forces(
    columns: Mapping[str, Floats], time_name: str, time_s: Floats
) -> list[tuple[str, float, float, Floats]]:
    """Return name, sign, likeness and contacts of the two columns most like vertical forces."""
    found = []
    for name, values in columns.items():
        if name == time_name or not np.isfinite(values).mean() > 0.95:
            continue
        for sign in (1.0, -1.0):
            force = np.nan_to_num(values * sign)
            high = float(np.percentile(force, 98))
            quiet = float((np.abs(force) < 0.06 * high).mean()) if high > 0 else 0.0
            if not SWING[0] < quiet < SWING[1] or np.percentile(force, 1) < -0.15 * high:
                continue
            contacts = _find_contacts(time_s, force)
            profile = make_profile(time_s, force, contacts)
            if profile is None:
                continue
            like = {shape: find_likeness(profile, shape) for shape in ("force", "moment")}
            if like["force"] > LIKE and like["force"] > like["moment"]:
                found.append((name, sign, like["force"], contacts))
    found.sort(key=lambda one: -one[2])
    kept: list[tuple[str, float, float, Floats]] = []
    for one in found:
        is_same = any(_is_in_phase(one[3], other[3]) for other in kept)
        if not is_same and len(kept) < 2:
            kept.append(one)
    return kept


def _is_in_phase(one: Floats, other: Floats) -> bool:
    """Return whether contacts come at the same times."""
    if not len(one) or not len(other):
        return False
    gaps = [float(np.abs(other - at_s).min()) for at_s in one]
    return float(np.median(gaps)) < 0.1


def _find_force_unit(
    columns: Mapping[str, Floats],
    time_s: Floats,
    forces: list[tuple[str, float, float, Floats]],
    mass_kg: float | None,
) -> tuple[float, str, float, bool]:
    """Return the force's factor to newtons, its unit, the body mass and whether that is measured.

    Over whole strides both plates carry the body's weight, one plate half of it.
    """
    contacts = forces[0][3]
    part = slice(*np.searchsorted(time_s, (contacts[0], contacts[-1])))
    load = sum(float(np.nanmean(columns[name][part] * sign)) for name, sign, *_ in forces)
    load *= 2 / len(forces)
    units = FORCE_UNITS | (
        {unit: one * mass_kg for unit, one in FORCE_BY_MASS.items()} if mass_kg else {}
    )
    masses = {unit: load * factor / GRAVITY_M_S2 for unit, factor in units.items()}
    if mass_kg is not None:
        unit = min(masses, key=lambda one: abs(math.log(max(masses[one], 1e-9) / mass_kg)))
        return units[unit], unit, mass_kg, False
    low, high = MASS_USUAL_KG
    for unit in ("N", "kN", "mN"):
        if low <= masses[unit] <= high:
            return units[unit], unit, masses[unit], True
    if MASS_MIN_KG <= masses["N"] <= MASS_MAX_KG:
        return 1.0, "N", masses["N"], True
    raise GaitInputError(
        f"The plates carry {load:.3g} of an unknown unit on average. Weigh the patient and give "
        f"the mass (--mass 75): forces by body mass, in kgf or in lbf are told by it."
    )


def _find_channel(
    columns: Mapping[str, Floats],
    channel: str,
    side: str,
    time_s: Floats,
    contacts: Floats,
    force_n: Floats,
    mass_kg: float,
) -> Guess | None:
    """Return the column that is most like a channel of a leg, None without one."""
    ranked = []
    for name, values in columns.items():
        profile = make_profile(time_s, values, contacts)
        if profile is None or not np.ptp(profile) > 0:
            continue
        likeness = {shape: find_likeness(profile, shape) for shape in SHAPES}
        own = likeness[channel]
        rival = max(RIVALS[channel], key=lambda s: abs(likeness[s]))
        if abs(own) > LIKE and abs(own) > abs(likeness[rival]):
            lead = abs(own) - abs(likeness[rival])
            ranked.append((abs(own), name, own, profile, lead, rival))
    if not ranked:
        return None
    ranked.sort(key=lambda one: (-one[0], one[1]))
    best, name, own, profile, lead, rival = ranked[0]
    size = float(np.ptp(profile))
    if channel == "moment":
        stance_n = make_profile(time_s, force_n, contacts)
        at = int(np.abs(profile).argmax())
        expected = LEVER_M * float(stance_n[at]) if stance_n is not None else 1.2 * mass_kg
        units = MOMENT_UNITS | {unit: one * mass_kg for unit, one in MOMENT_BY_MASS.items()}
        size, spread = float(np.abs(profile).max()), LEVER_SPREAD
    else:
        expected, units, spread = ANGLE_RAD, ANGLE_UNITS, ANGLE_SPREAD
    off = {unit: abs(math.log(size * factor / expected)) for unit, factor in units.items()}
    unit, second = sorted(units, key=lambda one: off[one])[:2]
    doubts = []
    if off[unit] > spread:
        doubts.append(f"its size is {math.exp(off[unit]):.1f} times off what is usual")
    if off[second] < off[unit] + 2 * spread and off[second] < 2 * spread:
        doubts.append(f"{second} would be as likely as {unit}")
    if best < CERTAIN_LIKE or lead < CERTAIN_LEAD:
        doubts.append(f"it is almost as much like a {rival}")
    if len(ranked) > 1 and best - ranked[1][0] < CERTAIN_LEAD / 2:
        doubts.append(f"{ranked[1][1]} looks the same")
    factor = units[unit] * (1.0 if own > 0 else -1.0)
    return Guess(name, side, channel, factor, unit, best, not doubts, "; ".join(doubts))
