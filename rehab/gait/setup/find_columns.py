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

from rehab.gait.recordings.column_mapping import REQUIRED
from rehab.gait.recordings.readers import says_overground
from rehab.gait.recordings.table import Table, find_time
from rehab.gait.selfcheck.shapes import (
    KNEE_LEAD,
    LIKE,
    NAMED_LIKE,
    Stances,
    find_likeness,
    make_profile,
)
from rehab.gait.setup.find_forces import (
    Force,
    find_force_unit,
    find_forces,
    find_size,
    looks_overground,
    name_sides,
)
from rehab.gait.setup.guess import Guess
from rehab.gait.setup.names import Label, find_side, names_another, read_label, read_unit
from rehab.gait.setup.units import CHANNEL_UNITS, MOMENT_UNITS, find_unit, is_in_units
from rehab.gait.signals.clock import estimate_rate
from rehab.gait.signals.filters import Floats
from rehab.gait.signals.frame_clock import find_frame_problem
from rehab.gait.stances.plausibility import MOMENT_MIN
from rehab.gait.strides import GaitInputError

CERTAIN_LIKE, CERTAIN_LEAD = 0.88, 0.05  # and by how much it leads the next shape
OWN = "own."  # begins columns that ``recordings.c3d_plates`` computes
OTHER_PLANE = 0.15  # by how much more alike another axis than x has to be
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


def propose(
    columns: Mapping[str, Floats],
    mass_kg: float | None = None,
    *,
    is_overground: bool | None = None,
) -> Proposal:
    """Return what columns are thought to be, from walking.

    Parameters
    ----------
    columns
        By name, shape (n,) each; a ``Table`` says more.
    mass_kg
        Body mass if known; else it is the file's, or measured with the plates.
    is_overground
        Whether it is a few steps over plates if known; else the file or the steps say it.

    Raises
    ------
    GaitInputError
        With the cure, where no time goes on, no plate carries a walker or no mass is known.
    """
    table = columns if isinstance(columns, Table) else Table(columns)
    clock = find_time(table)
    if clock is None:
        raise GaitInputError(
            "No column is a time that goes on. Export the samples with their times in seconds; one "
            "row of names, then numbers."
        )
    time_name, time_factor = clock
    time_s = table[time_name] * time_factor
    labels = {name: read_label(name) for name in table if name != time_name}
    labels = {name: one for name, one in labels.items() if one or not _is_other(table, name)}
    forces = find_forces(table, labels, time_s)
    if not forces:
        raise GaitInputError(_describe_no_force(table, labels))
    sides, doubts = name_sides(table, labels, time_s, forces)
    if is_overground is None:
        is_overground = says_overground(table) or looks_overground(table, time_s, forces)
    source = "given" if mass_kg is not None else "file"
    mass_kg = mass_kg if mass_kg is not None else table.mass_kg
    units = [read_unit(force.name, table.units) for force in forces]
    scale, unit, mass, doubt = find_force_unit(table, time_s, forces, units, mass_kg, is_overground)
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
    axis = _find_axis(table, labels, time_s, dict(zip(sides, forces, strict=True)))
    for force, side in zip(forces, sides, strict=True):
        force_n = table[force.name] * force.sign * scale
        for channel in RIVALS:
            rest = {name: label for name, label in labels.items() if name not in taken}
            at = (time_s, force.stances, force_n, mass)
            guess = _find_channel(table, rest, channel, side, axis, *at)
            if guess is not None:
                guesses[side, channel] = guess
                taken.add(guess.column)
    return Proposal(
        time_name,
        time_factor,
        estimate_rate(time_s),
        mass,
        source if mass_kg is not None else "plates",
        is_overground,
        guesses,
        _find_frame(table, time_name, time_s),
        table.notes,
    )


def _is_other(table: Table, name: str) -> bool:
    """Return whether a column without a label is of our own making, or in a unit of something else:
    a marker's position, a muscle's volts.
    """
    return name.startswith(OWN) or bool(
        table.units.get(name, "").strip() and not read_unit(name, table.units)
    )


def _describe_no_force(table: Table, labels: Mapping[str, Label | None]) -> str:
    """Return what a file without a vertical force lacks, and the cure."""
    named: dict[str, dict[str, str]] = {channel: {} for channel in REQUIRED}
    known = [(name, one) for name, one in labels.items() if one]
    for name, one in sorted(known, key=lambda pair: pair[1].is_sagittal):
        named[one.channel][one.side or name] = name  # of a leg's, the flexion's
    if forces := list(named["force"].values()):
        return (
            f"{', '.join(forces[:3])} should be a vertical force, but none shows a stance "
            "from its beginning to its end. Record walking over the plates."
        )
    has = [
        f"ankle {channel}s ({', '.join(sorted(named[channel].values()))})"
        for channel in REQUIRED[1:]
        if named[channel]
    ]
    if not has:
        return (
            "No column is a vertical force: none is zero in swing and has two humps in stance. "
            "Walk for half a minute with the plates on, and send their vertical force."
        )
    begin = f"This file has {' and '.join(has)}, but no vertical force. "
    moments = [name for name, one in known if one.channel == "moment"]
    largest = max((_find_most(table, name) for name in moments), default=math.inf)
    if largest < MOMENT_MIN:
        return begin + (
            f"Its moments were computed without plates: they reach {largest:.2g} Nm/kg, as those "
            "of a foot that swings. Record the plates too, and compute the moments with them."
        )
    return begin + (
        "Give the files that belong together in one command: check FORCES MOMENTS ANGLES. If "
        "there is none with forces, export the vertical force of each plate from the lab's program."
    )


def _find_most(table: Table, name: str) -> float:
    """Return what a moment reaches at most, even if by body mass [Nm/kg]; infinite without unit."""
    factor = MOMENT_UNITS.get(read_unit(name, table.units), math.inf)
    return factor * max(find_size(table[name]), 1e-9)


def _find_frame(columns: Mapping[str, Floats], time_name: str, time_s: Floats) -> str | None:
    """Return the column called a frame that counts the samples."""
    for name, values in columns.items():
        if "frame" in name.lower() and name != time_name and not find_frame_problem(time_s, values):
            return name
    return None


def _find_axis(
    table: Table, labels: Mapping[str, Label | None], time_s: Floats, forces: Mapping[str, Force]
) -> str:
    """Return the axis about which ankles flex by all moments and angles together: x, or z by ISB.

    It is another than x only where that is clearly more like an ankle.
    """
    likes: dict[str, list[float]] = {}
    for name, label in labels.items():
        if label and label.axis and label.side in forces and label.channel in RIVALS:
            profile = make_profile(time_s, table[name], forces[label.side].stances)
            like = 0.0 if profile is None else abs(find_likeness(profile)[label.channel])
            likes.setdefault(label.axis, []).append(like)
    means = {axis: float(np.mean(found)) for axis, found in likes.items()}
    means["x"] = means.get("x", 0.0) + OTHER_PLANE
    return max(means, key=lambda axis: means[axis])


def _find_channel(
    table: Table,
    labels: Mapping[str, Label | None],
    channel: str,
    side: str,
    axis: str,
    time_s: Floats,
    stances: Stances,
    force_n: Floats,
    mass_kg: float,
) -> Guess | None:
    """Return the column that is a channel of a leg by its label, else by its shape, or None."""
    named = {
        n: one for n, one in labels.items() if one and (one.channel, one.side) == (channel, side)
    }
    # What the lab's system computed comes before what plates and markers come to.
    named = {n: one for n, one in named.items() if not n.startswith(OWN)} or named
    named = {n: one for n, one in named.items() if one.axis in {"", axis}} or named
    profiles = {}
    for name in named or [
        n
        for n, one in labels.items()
        if not one
        and not names_another(n, channel)
        and find_side(n) in {"", side}
        and is_in_units(table, n, CHANNEL_UNITS[channel])
    ]:
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

    name, *others = sorted(profiles, key=lambda one: (-abs(profiles[one][1][channel]), one))
    profile, like = profiles[name]
    label = named.get(name)
    own = like[channel]
    rival = max(RIVALS[channel], key=lambda shape: abs(like[shape]))
    unit, factor, doubts = find_unit(
        table, name, channel, profile, time_s, stances, force_n, mass_kg
    )
    sign = 1.0 if own > 0 else -1.0
    if label and label.axis not in {"", axis}:
        doubts.append("its label names another plane")
    if label and label.sign and label.sign != sign:
        if abs(own) < NAMED_LIKE:
            sign = float(label.sign)
        else:
            doubts.append("its label names the other sign")
    if label and abs(own) < NAMED_LIKE:
        doubts.append(f"its curve over a stride is not an ankle {channel}'s")
    if label and rival == "knee angle" and abs(like[rival]) > abs(own) + KNEE_LEAD:
        doubts.append("its curve is more like a knee's")
    if not label and (abs(own) < CERTAIN_LIKE or abs(own) - abs(like[rival]) < CERTAIN_LEAD):
        doubts.append(f"it is almost as much like a {rival}")
    if not label and others and abs(own) - abs(profiles[others[0]][1][channel]) < CERTAIN_LEAD / 2:
        doubts.append(f"{others[0]} looks the same")
    return Guess(
        name, side, channel, factor * sign, unit, abs(own), label is not None, "; ".join(doubts)
    )
