"""Which columns are vertical forces: their legs, their unit and the body mass that they carry."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from rehab.gait.one_leg import GRAVITY_M_S2, STRIDE_MAX_S
from rehab.gait.recordings.column_mapping import SIDES
from rehab.gait.recordings.table import Table
from rehab.gait.selfcheck.checks import CERTAIN_LOAD
from rehab.gait.selfcheck.shapes import (
    LIKE,
    NAMED_LIKE,
    Stances,
    find_likeness,
    find_stances,
    make_profile,
)
from rehab.gait.settings import MASS_MAX_KG, MASS_MIN_KG
from rehab.gait.setup.names import Label, find_side, names_another
from rehab.gait.setup.units import (
    BY_MASS,
    FORCE_SPREAD,
    FORCE_UNITS,
    MASS_USUAL_KG,
    STANCE_LOAD,
    is_in_units,
)
from rehab.gait.signals.filters import Floats
from rehab.gait.strides import GaitInputError

SWING = (0.15, 0.98)  # of the time a plate is unloaded
# Times (logarithm) that a column without a label carries another mass than the given one, in any
# unit: a harness takes half of it, and what is no force carries anything.
NO_FORCE = 0.9
STEPS_MIN = 4  # on each plate, to tell a treadmill
LOADED = 0.9  # of the time on a treadmill somebody loads the plates
OTHER_SIDE = {"left": "right", "right": "left"}


@dataclass(frozen=True, slots=True)
class Force:
    """A column that may be a vertical force: its name, label, sign, likeness and stances."""

    name: str
    label: Label | None
    sign: float
    likeness: float
    stances: Stances


def find_forces(columns: Table, labels: Mapping[str, Label | None], time_s: Floats) -> list[Force]:
    """Return the one or two columns that are vertical forces: those assigned to legs, else those
    with a label, else those with the shape. Of a plate's axes it is the one that bears the most.
    """
    found = []
    for name, label in labels.items():
        if (label and label.channel != "force") or (not label and names_another(name, "force")):
            continue
        if not is_in_units(columns, name, FORCE_UNITS) or _is_sideways(columns, name):
            continue
        for sign in (1.0, -1.0):
            force = _find_force(name, label, sign, time_s, columns[name])
            if force is not None:
                found.append(force)
    # A label with a leg before one without, and one before none; then the shape.
    found.sort(key=lambda one: (-_rank(one), -one.likeness))
    kept: list[Force] = []
    for one in found:
        is_same = any(_is_in_phase(one.stances, other.stances) for other in kept)
        if not is_same and len(kept) < 2 and (not kept or _rank(one) == _rank(kept[0])):
            kept.append(one)
    order = list(columns)  # the left leg's comes first where nothing says whose it is
    return sorted(kept, key=lambda one: order.index(one.name))


def _is_sideways(columns: Mapping[str, Floats], name: str) -> bool:
    """Return whether another axis of the same plate, by its name, bears more."""
    for at, letter in enumerate(name):
        axes = next((one for one in ("xyz", "XYZ") if letter in one), "")
        names = [name[:at] + axis + name[at + 1 :] for axis in axes if axis != letter]
        sizes = [find_size(columns[one]) for one in names if one in columns]
        if sizes:
            return max(sizes) > find_size(columns[name])
    return False


def find_size(values: Floats) -> float:
    """Return the size that a channel's values reach, a few spikes left out."""
    return float(np.percentile(np.abs(np.nan_to_num(values)), 99.0))


def _rank(force: Force) -> int:
    if force.label is None:
        return 0
    return 3 if force.name.startswith("plates.") else 2 if force.label.side else 1


def _find_force(
    name: str, label: Label | None, sign: float, time_s: Floats, values: Floats
) -> Force | None:
    """Return a column as a vertical force, None where it cannot be one."""
    if not np.isfinite(values).mean() > 0.95:
        return None
    force = np.nan_to_num(values * sign)
    high = float(np.percentile(force, 99.5))
    if not high > 0 or np.percentile(force, 0.5) < -0.3 * high:
        return None
    zero = float(np.percentile(force, 10.0))  # of a plate that nobody has zeroed
    quiet = float((np.abs(force - zero) < 0.06 * (high - zero)).mean())
    stances = find_stances(time_s, force)
    profile = make_profile(time_s, force, stances)
    if profile is None or (not SWING[0] < quiet < SWING[1] and not name.startswith("plates.")):
        return None
    like = find_likeness(profile)
    least = LIKE if label is None else NAMED_LIKE
    if like["force"] < least or (label is None and like["force"] < like["moment"]):
        return None
    return Force(name, label, sign, like["force"], stances)


def _is_in_phase(one: Stances, other: Stances) -> bool:
    """Return whether contacts come at the same times."""
    gaps = [float(np.abs(other.begin_s - at_s).min()) for at_s in one.begin_s]
    return float(np.median(gaps)) < 0.1


def name_sides(
    columns: Mapping[str, Floats],
    labels: Mapping[str, Label | None],
    time_s: Floats,
    forces: list[Force],
) -> tuple[list[str], list[str]]:
    """Return the leg of each force, and what speaks against it.

    A leg's ankle moment is large while its own plate is loaded; where labels name no leg of a
    plate, this does, and where they name the other one, it is told.
    """
    named_moments = [(n, one) for n, one in labels.items() if one and one.channel == "moment"]
    named_moments.sort(key=lambda pair: pair[1].is_sagittal)  # of a leg's, the last one is taken
    moments = {label.side: name for name, label in named_moments}

    def share(force: Force, side: str) -> float:
        """Return how much more of a leg's moment falls in the stances than out of them."""
        size = np.nan_to_num(np.abs(columns[moments[side]]))
        at = np.zeros(len(time_s), dtype=bool)
        for begin_s, end_s in zip(force.stances.begin_s, force.stances.end_s, strict=True):
            at[slice(*np.searchsorted(time_s, (begin_s, end_s)))] = True
        # Half a swing after the toes have left, when only the other leg stands.
        return float(size[at].mean() - size.mean()) / max(float(size.mean()), 1e-12)

    named = [find_side(force.name) for force in forces]
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


def looks_overground(columns: Mapping[str, Floats], time_s: Floats, forces: list[Force]) -> bool:
    """Return whether these are a few steps over plates: in between nobody bears them, or few.

    Raises
    ------
    GaitInputError
        Where the steps are as few, but come again on each plate, stride by stride.
    """
    fewest = min(len(force.stances) for force in forces)
    if fewest < STEPS_MIN:
        gaps_s = [gap_s for force in forces for gap_s in np.diff(force.stances.begin_s)]
        if fewest < 2 or min(gaps_s) > STRIDE_MAX_S:
            return True
        raise GaitInputError(
            f"Too few whole steps on a plate ({fewest}) to tell a treadmill from plates in a "
            "floor. Record half a minute, or say which: --no-overground or --overground."
        )
    first_s = min(force.stances.begin_s[0] for force in forces)
    last_s = max(force.stances.end_s[-1] for force in forces)
    part = slice(*np.searchsorted(time_s, (first_s, last_s)))
    loaded = np.zeros(part.stop - part.start, dtype=bool)
    for force in forces:
        values = np.nan_to_num(columns[force.name][part] * force.sign)
        loaded |= values > 0.06 * values.max(initial=0.0)
    return float(loaded.mean()) < (LOADED if len(forces) == 2 else LOADED / 2)


def find_force_unit(
    columns: Mapping[str, Floats],
    time_s: Floats,
    forces: list[Force],
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
    load = float(np.median(own)) / STANCE_LOAD
    low, high = math.exp(-2 * FORCE_SPREAD), math.exp(2 * FORCE_SPREAD)
    if not is_overground:
        starts = forces[0].stances.begin_s
        part = slice(*np.searchsorted(time_s, (starts[0], starts[-1])))
        load = sum(float(np.nanmean(columns[f.name][part] * f.sign)) for f in forces)
        load, (low, high) = load * 2 / len(forces), CERTAIN_LOAD
    units = {u: f for u, f in FORCE_UNITS.items() if mass_kg or u not in BY_MASS}
    factors = {unit: f * ((mass_kg or 1) if unit in BY_MASS else 1) for unit, f in units.items()}
    masses = {unit: max(load * factor, 1e-9) / GRAVITY_M_S2 for unit, factor in factors.items()}
    unit = written[0]
    if mass_kg is not None:
        near = min(masses, key=lambda one: abs(math.log(masses[one] / mass_kg)))
        if abs(math.log(masses["N"] / mass_kg)) < NO_FORCE:  # a harness takes more than half of it
            near = "N"
        # Many a file does not write that a force is by body mass; the two differ by tens.
        unit = unit if unit in masses and near != f"{unit}/kg" else near
        off = abs(math.log(masses[unit] / mass_kg))
        doubt = ""
        if unit != near and off > 2 * FORCE_SPREAD:
            doubt = f"the file says {unit}, but in {near} it would carry {mass_kg:.1f} kg"
        elif off > NO_FORCE and not any(force.label for force in forces):
            raise GaitInputError(
                f"No column is a vertical force: what looks most like one, {forces[0].name}, would "
                f"carry {masses[unit]:.0f} kg, not {mass_kg:.1f} kg. Walk for half a minute with "
                "the plates on, and send their vertical force."
            )
        elif not low <= masses[unit] / mass_kg <= high:
            by = ", if its leg takes half" if len(forces) == 1 and not is_overground else ""
            doubt = f"it carries {masses[unit]:.0f} kg{by}, not {mass_kg:.1f} kg"
        return factors[unit], unit, mass_kg, doubt
    if is_overground:
        raise GaitInputError(
            "The body mass is not in this file, and a few steps over plates weigh nobody. Weigh "
            "the patient and give the mass: --mass 75."
        )
    low, high = MASS_USUAL_KG
    if unit in masses and MASS_MIN_KG <= masses[unit] <= MASS_MAX_KG:
        return factors[unit], unit, masses[unit], ""
    for unit in ("N", "mN"):  # not kN, as a force in body weights would carry 102 kg in it
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
