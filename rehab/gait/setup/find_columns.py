"""Proposes which column is which channel, with unit, sign, leg and mass.

What the file says comes first: labels (``names``), units, plates, mass. The shape of a column over
a stride confirms that, chooses between columns of the same label, and proposes alone where no
label says anything; it overrules no label.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from rehab.gait.one_leg import GRAVITY_M_S2
from rehab.gait.recordings.columns import REQUIRED, SIDES
from rehab.gait.recordings.table import Table
from rehab.gait.settings import MASS_MAX_KG, MASS_MIN_KG, RATE_MAX_HZ, RATE_MIN_HZ
from rehab.gait.setup.guess import Guess
from rehab.gait.setup.names import Label, names_another, read_label, read_unit
from rehab.gait.setup.shapes import Stances, find_likeness, find_stances, make_profile
from rehab.gait.setup.units import (
    ANGLE_RAD,
    ANGLE_SPREAD,
    ANGLE_UNITS,
    BY_MASS,
    FORCE_SPREAD,
    FORCE_UNITS,
    LEVER_M,
    LEVER_SPREAD,
    MASS_USUAL_KG,
    MOMENT_UNITS,
    STANCE_LOAD,
    TIME_UNITS,
)
from rehab.gait.signals.clock import find_period
from rehab.gait.signals.filters import Floats
from rehab.gait.signals.frames import find_frame_problem
from rehab.gait.strides import GaitInputError

LIKE = 0.8  # correlation with a shape from which a column without a label may be that channel
NAMED_LIKE = 0.6  # and from which a shape does not contradict a label
CERTAIN_LIKE, CERTAIN_LEAD = 0.88, 0.05  # and by how much it leads the next shape
OTHER_PLANE = 0.15  # by how much more alike another plane than the label's has to be
SWING = (0.15, 0.98)  # of the time a plate is unloaded
LOADED = 0.9  # of the time on a treadmill somebody loads the plates
# Of each channel, the shapes that a column may have instead.
RIVALS = {"moment": ("force", "forward", "knee angle"), "angle": ("knee angle", "hip angle")}
OTHER_SIDE = {"left": "right", "right": "left"}


@dataclass(frozen=True, slots=True)
class Proposal:
    """What a recording's columns are thought to be.

    Attributes
    ----------
    time, time_factor
        Name of the time column and its factor to seconds.
    rate_hz
        Of the samples.
    mass_kg, mass_source
        Body mass, and who says so: "given", "file" or "plates".
    is_overground
        Whether it is a few steps over plates, not a walk on a treadmill.
    guesses
        By side and channel.
    frame
        Name of the column that counts the samples, if there is one.
    notes
        What else a person should know of the file.
    """

    time: str
    time_factor: float
    rate_hz: float
    mass_kg: float
    mass_source: str
    is_overground: bool
    guesses: dict[tuple[str, str], Guess]
    frame: str | None = None
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class _Force:
    """A column that may be a vertical force: its name, label, sign, likeness and stances."""

    name: str
    label: Label | None
    sign: float
    likeness: float
    stances: Stances


def propose(columns: Mapping[str, Floats], mass_kg: float | None = None) -> Proposal:
    """Return what columns are thought to be, from walking.

    Parameters
    ----------
    columns
        By name, shape (n,) each; a ``Table`` says more.
    mass_kg
        Body mass if known; else it is the file's, or measured with the plates.

    Raises
    ------
    GaitInputError
        With the cure, where no time goes on, no plate carries a walker or no mass is known.
    """
    table = columns if isinstance(columns, Table) else Table(columns)
    time_name, time_factor = _find_time(table)
    time_s = table[time_name] * time_factor
    labels = {name: read_label(name) for name in table if name != time_name}
    forces = _find_forces(table, labels, time_s)
    if not forces:
        raise GaitInputError(_describe_no_force(labels))
    sides, doubts = _name_sides(table, labels, time_s, forces)
    is_overground = _is_overground(table, time_s, forces)
    source = "given" if mass_kg is not None else "file"
    mass_kg = mass_kg if mass_kg is not None else table.mass_kg
    units = [read_unit(force.name, table.units) for force in forces]
    scale, unit, mass, doubt = _find_force_unit(
        table, time_s, forces, units, mass_kg, is_overground
    )
    guesses: dict[tuple[str, str], Guess] = {}
    for force, side, turned in zip(forces, sides, doubts, strict=True):
        is_named = force.label is not None
        weak = is_named and force.likeness < NAMED_LIKE and "its curve is not a vertical force's"
        why = [one for one in (doubt, turned, weak) if one]
        guesses[side, "force"] = Guess(
            force.name, side, "force", force.sign * scale, unit, force.likeness, is_named,
            "; ".join(why),
        )  # fmt: skip
    taken = {time_name, *(force.name for force in forces)}
    for force, side in zip(forces, sides, strict=True):
        force_n = table[force.name] * force.sign * scale
        for channel in RIVALS:
            rest = {name: label for name, label in labels.items() if name not in taken}
            guess = _find_channel(table, rest, channel, side, time_s, force.stances, force_n, mass)
            if guess is not None:
                guesses[side, channel] = guess
                taken.add(guess.column)
    return Proposal(
        time_name,
        time_factor,
        1 / (find_period(time_s) or 0.01),
        mass,
        source if mass_kg is not None else "plates",
        is_overground,
        guesses,
        _find_frame(table, time_name, time_s),
        table.notes,
    )


def _describe_no_force(labels: dict[str, Label | None]) -> str:
    """Return what a file without a vertical force lacks, and the cure."""
    named = {
        channel: [
            name for name, one in labels.items() if one is not None and one.channel == channel
        ]
        for channel in REQUIRED
    }
    if named["force"]:
        return (
            f"{', '.join(named['force'][:3])} should be a vertical force, but none shows a stance "
            "from its beginning to its end. Record walking over the plates."
        )
    has = [
        f"an ankle {channel} ({named[channel][0]})" for channel in REQUIRED[1:] if named[channel]
    ]
    if has:
        return (
            f"This file has {' and '.join(has)}, but no vertical force. Give the files that belong "
            "together in one command: check FORCES MOMENTS ANGLES."
        )
    return (
        "No column is a vertical force: none is zero in swing and has two humps in stance. "
        "Walk for half a minute with the plates on, and send their vertical force."
    )


def _find_frame(columns: Mapping[str, Floats], time_name: str, time_s: Floats) -> str | None:
    """Return the column called a frame that counts the samples."""
    for name, values in columns.items():
        if "frame" in name.lower() and name != time_name and not find_frame_problem(time_s, values):
            return name
    return None


def _find_time(columns: Mapping[str, Floats]) -> tuple[str, float]:
    """Return the time's column and factor; what counts by one is a time if nothing else is."""
    counts = [name for name, values in columns.items() if find_period(values[:1000]) == 1.0]
    ranked = sorted(columns, key=lambda name: (name in counts, "time" not in name.lower()))
    for name in ranked:
        values = columns[name]
        if len(values) < 30 or not np.isfinite(values).all():
            continue
        steps = np.diff(values)
        period = find_period(values)
        if not (steps > 0).mean() > 0.99 or not period or steps.std() > 20 * period:
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


def _find_forces(
    columns: Mapping[str, Floats], labels: Mapping[str, Label | None], time_s: Floats
) -> list[_Force]:
    """Return the one or two columns that are vertical forces: those assigned to legs, else those
    with a label, else those with the shape.
    """
    found = []
    for name, label in labels.items():
        if (label and label.channel != "force") or (not label and names_another(name)):
            continue
        for sign in (1.0, -1.0):
            force = _find_force(name, label, sign, time_s, columns[name])
            if force is not None:
                found.append(force)
    # A label with a leg before one without, and one before none; then the shape.
    found.sort(key=lambda one: (-_rank(one), -one.likeness))
    kept: list[_Force] = []
    for one in found:
        is_same = any(_is_in_phase(one.stances, other.stances) for other in kept)
        if not is_same and len(kept) < 2 and (not kept or _rank(one) == _rank(kept[0])):
            kept.append(one)
    return kept


def _rank(force: _Force) -> int:
    if force.label is None:
        return 0
    return 3 if force.name.startswith("plates.") else 2 if force.label.side else 1


def _find_force(
    name: str, label: Label | None, sign: float, time_s: Floats, values: Floats
) -> _Force | None:
    """Return a column as a vertical force, None where it cannot be one."""
    if not np.isfinite(values).mean() > 0.95:
        return None
    force = np.nan_to_num(values * sign)
    high = float(np.percentile(force, 99.5))
    if not high > 0 or np.percentile(force, 0.5) < -0.3 * high:
        return None
    quiet = float((np.abs(force) < 0.06 * high).mean())
    stances = find_stances(time_s, force)
    profile = make_profile(time_s, force, stances)
    if profile is None or (not SWING[0] < quiet < SWING[1] and not name.startswith("plates.")):
        return None
    like = find_likeness(profile)
    least = LIKE if label is None else NAMED_LIKE
    if like["force"] < least or (label is None and like["force"] < like["moment"]):
        return None
    return _Force(name, label, sign, like["force"], stances)


def _is_in_phase(one: Stances, other: Stances) -> bool:
    """Return whether contacts come at the same times."""
    gaps = [float(np.abs(other.begin_s - at_s).min()) for at_s in one.begin_s]
    return float(np.median(gaps)) < 0.1


def _name_sides(
    columns: Mapping[str, Floats],
    labels: Mapping[str, Label | None],
    time_s: Floats,
    forces: list[_Force],
) -> tuple[list[str], list[str]]:
    """Return the leg of each force, and what speaks against it.

    A leg's ankle moment is large while its own plate is loaded; where labels name no leg of a
    plate, this does, and where they name the other one, it is told.
    """
    moments = {
        label.side: name
        for name, label in reversed(list(labels.items()))
        if label and label.channel == "moment" and label.is_sagittal
    }

    def share(force: _Force, side: str) -> float:
        """Return how much more of a leg's moment falls in the stances than out of them."""
        size = np.nan_to_num(np.abs(columns[moments[side]]))
        at = np.zeros(len(time_s), dtype=bool)
        for begin_s, end_s in zip(force.stances.begin_s, force.stances.end_s, strict=True):
            at[slice(*np.searchsorted(time_s, (begin_s, end_s)))] = True
        # Half a swing after the toes have left, when only the other leg stands.
        return float(size[at].mean() - size.mean()) / max(float(size.mean()), 1e-12)

    named = [force.label.side if force.label else "" for force in forces]
    if len(forces) == 2 and named[0] == named[1]:
        named = ["", ""]
    if not any(named):
        named = [_guess_side(force.name) for force in forces]
        if len(forces) == 2 and named[0] == named[1]:
            named = ["left", "right"] if named[0] else ["", ""]
    if len(forces) == 2 and any(named):
        named = [named[0] or OTHER_SIDE[named[1]], named[1] or OTHER_SIDE[named[0]]]
    usual = named if all(named) else list(SIDES[: len(forces)])
    evidence = sum(
        (1 if side == own else -1) * share(force, side)
        for force, own in zip(forces, usual, strict=True)
        for side in moments
    )
    if evidence >= 0 or not moments:
        unsure = "which leg it is of, neither its label nor a moment says"
        doubt = "" if all(named) or evidence > 0 else unsure
        return usual, [doubt] * len(forces)
    other = [OTHER_SIDE[side] for side in usual]
    if all(force.label and force.label.side for force in forces):
        return usual, ["the moments say that it is the other leg's"] * len(forces)
    return other, [""] * len(forces)


def _guess_side(name: str) -> str:
    """Return the leg that the number of a plate stands for by custom, or empty."""
    words = name.lower()
    if words.startswith(("1_", "fp1")) or words.endswith("1"):
        return "left"
    return "right" if words.startswith(("2_", "fp2")) or words.endswith("2") else ""


def _is_overground(columns: Mapping[str, Floats], time_s: Floats, forces: list[_Force]) -> bool:
    """Return whether these are a few steps over plates: in between nobody bears them, or few."""
    if min(len(force.stances) for force in forces) < 4:
        return True
    first_s = min(force.stances.begin_s[0] for force in forces)
    last_s = max(force.stances.end_s[-1] for force in forces)
    part = slice(*np.searchsorted(time_s, (first_s, last_s)))
    loaded = np.zeros(part.stop - part.start, dtype=bool)
    for force in forces:
        values = np.nan_to_num(columns[force.name][part] * force.sign)
        loaded |= values > 0.06 * values.max(initial=0.0)
    return float(loaded.mean()) < (LOADED if len(forces) == 2 else LOADED / 2)


def _find_force_unit(
    columns: Mapping[str, Floats],
    time_s: Floats,
    forces: list[_Force],
    written: list[str],
    mass_kg: float | None,
    is_overground: bool,
) -> tuple[float, str, float, str]:
    """Return the force's factor to newtons, its unit, the body mass, and what speaks against it.

    On a treadmill both plates carry the body's weight over whole strides, one plate half of it;
    in a step over a plate, the foot bears four fifths of it.
    """
    own = [
        _compute_mean(time_s, columns[f.name] * f.sign, begin, end)
        for f in forces
        for begin, end in zip(f.stances.begin_s, f.stances.end_s, strict=True)
    ]
    load, spread = float(np.median(own)) / STANCE_LOAD, 2 * FORCE_SPREAD
    if not is_overground:
        starts = forces[0].stances.begin_s
        part = slice(*np.searchsorted(time_s, (starts[0], starts[-1])))
        load = sum(float(np.nanmean(columns[f.name][part] * f.sign)) for f in forces)
        load, spread = load * 2 / len(forces), FORCE_SPREAD
    units = {u: f for u, f in FORCE_UNITS.items() if mass_kg or u not in BY_MASS}
    factors = {unit: f * ((mass_kg or 1) if unit in BY_MASS else 1) for unit, f in units.items()}
    masses = {unit: max(load * factor, 1e-9) / GRAVITY_M_S2 for unit, factor in factors.items()}
    unit = written[0]
    if mass_kg is not None:
        near = min(masses, key=lambda one: abs(math.log(masses[one] / mass_kg)))
        unit = unit if unit in masses else near
        off = abs(math.log(masses[unit] / mass_kg))
        doubt = ""
        if unit != near and off > 2 * FORCE_SPREAD:
            doubt = f"the file says {unit}, but in {near} it would carry {mass_kg:.1f} kg"
        elif off > spread:
            doubt = f"it carries {masses[unit]:.0f} kg, not {mass_kg:.1f} kg"
        return factors[unit], unit, mass_kg, doubt
    if is_overground:
        raise GaitInputError(
            "The body mass is not in this file, and a few steps over plates weigh nobody. Weigh "
            "the patient and give the mass: --mass 75. An ankle moment and an ankle angle are "
            "needed beside the forces, in this file or in others given with it."
        )
    low, high = MASS_USUAL_KG
    if unit in masses and MASS_MIN_KG <= masses[unit] <= MASS_MAX_KG:
        return factors[unit], unit, masses[unit], ""
    for unit in ("N", "kN", "mN"):
        if low <= masses[unit] <= high:
            return factors[unit], unit, masses[unit], ""
    if MASS_MIN_KG <= masses["N"] <= MASS_MAX_KG:
        light = f"in lbf or kgf it would carry a grown-up, in N {masses['N']:.1f} kg; give the mass"
        return 1.0, "N", masses["N"], light if masses["N"] < low else ""
    raise GaitInputError(
        f"The plates carry {load:.3g} of an unknown unit on average. Weigh the patient and give "
        f"the mass (--mass 75): forces by body mass, in kgf or in lbf are told by it."
    )


def _compute_mean(time_s: Floats, values: Floats, begin_s: float, end_s: float) -> float:
    at_s = np.linspace(begin_s, end_s, 50)
    return float(np.interp(at_s, time_s, np.nan_to_num(values)).mean())


def _find_channel(
    table: Table,
    labels: Mapping[str, Label | None],
    channel: str,
    side: str,
    time_s: Floats,
    stances: Stances,
    force_n: Floats,
    mass_kg: float,
) -> Guess | None:
    """Return the column that is a channel of a leg by its label, else by its shape, or None."""
    named = {
        n: one for n, one in labels.items() if one and (one.channel, one.side) == (channel, side)
    }
    profiles = {}
    for name in named or [n for n, one in labels.items() if not one and not names_another(n)]:
        profile = make_profile(time_s, table[name], stances)
        if profile is not None and np.ptp(profile) > 0:
            profiles[name] = (profile, find_likeness(profile))
    if not named:
        profiles = {
            name: (profile, like)
            for name, (profile, like) in profiles.items()
            if abs(like[channel]) > max(LIKE, *(abs(like[rival]) for rival in RIVALS[channel]))
        }
    if not profiles:
        return None

    def rank(name: str) -> tuple[float, str]:
        plane = OTHER_PLANE if name in named and not named[name].is_sagittal else 0.0
        return plane - abs(profiles[name][1][channel]), name

    name, *others = sorted(profiles, key=rank)
    profile, like = profiles[name]
    label = named.get(name)
    own = like[channel]
    rival = max(RIVALS[channel], key=lambda shape: abs(like[shape]))
    unit, factor, doubts = _find_unit(
        table, name, channel, profile, time_s, stances, force_n, mass_kg
    )
    sign = 1.0 if own > 0 else -1.0
    if label and not label.is_sagittal:
        doubts.append("its label names another plane")
    if label and label.sign and label.sign != sign:
        if abs(own) < NAMED_LIKE:
            sign = float(label.sign)
        else:
            doubts.append("its label names the other sign")
    if label and abs(own) < NAMED_LIKE:
        doubts.append(f"its curve over a stride is not an ankle {channel}'s")
    if not label and (abs(own) < CERTAIN_LIKE or abs(own) - abs(like[rival]) < CERTAIN_LEAD):
        doubts.append(f"it is almost as much like a {rival}")
    if not label and others and abs(own) - abs(profiles[others[0]][1][channel]) < CERTAIN_LEAD / 2:
        doubts.append(f"{others[0]} looks the same")
    return Guess(
        name, side, channel, factor * sign, unit, abs(own), label is not None, "; ".join(doubts)
    )


def _find_unit(
    table: Table,
    name: str,
    channel: str,
    profile: Floats,
    time_s: Floats,
    stances: Stances,
    force_n: Floats,
    mass_kg: float,
) -> tuple[str, float, list[str]]:
    """Return a moment's or an angle's unit, its factor, and what speaks against it.

    A unit that the file says stands, but for moments by body mass, which many a file does not
    write: the size of both decides, which differ by tens.
    """
    if channel == "moment":
        stance_n = make_profile(time_s, force_n, stances)
        at = int(np.abs(profile).argmax())
        expected = LEVER_M * max(float(stance_n[at]), 1.0) if stance_n is not None else mass_kg
        units = {u: f * (mass_kg if u in BY_MASS else 1) for u, f in MOMENT_UNITS.items()}
        size, spread = float(np.abs(profile).max()), LEVER_SPREAD
    else:
        expected, units, spread = ANGLE_RAD, ANGLE_UNITS, ANGLE_SPREAD
        size = float(np.ptp(profile))
    off = {unit: abs(math.log(max(size * f, 1e-300) / expected)) for unit, f in units.items()}
    unit, second = sorted(units, key=lambda one: off[one])[:2]
    written = read_unit(name, table.units)
    doubts = []
    if written in units:
        near = unit
        unit = min((one for one in units if one in {written, written + "/kg"}), key=off.__getitem__)
        spread *= 3
        if off[unit] > spread and near != unit:
            doubts.append(f"the file says {written}, but its size is that of {near}")
    elif off[second] < off[unit] + 2 * spread and off[second] < 2 * spread:
        doubts.append(f"{second} would be as likely as {unit}")
    if off[unit] > spread and not doubts:
        doubts.append(f"its size is {math.exp(min(off[unit], 99)):.1f} times off what is usual")
    return unit, units[unit], doubts
