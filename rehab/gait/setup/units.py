"""Units that labs send in, and the sizes by which they are told apart."""

from __future__ import annotations

import math
from collections.abc import Collection

import numpy as np

from rehab.gait.one_leg import GRAVITY_M_S2
from rehab.gait.recordings.table import Table
from rehab.gait.selfcheck.shapes import Stances, make_profile
from rehab.gait.setup.names import read_unit
from rehab.gait.signals.filters import Floats

# What one of each is in N, Nm and rad; of units by body mass, for 1 kg.
FORCE_UNITS = {
    "N": 1.0, "kN": 1e3, "kgf": GRAVITY_M_S2, "lbf": 4.44822, "mN": 1e-3, "N/kg": 1.0,
    "body weights": GRAVITY_M_S2, "% body weight": GRAVITY_M_S2 / 100,
}  # fmt: skip
MOMENT_UNITS = {
    "Nm": 1.0, "Nmm": 1e-3, "kNm": 1e3, "lbf·ft": 1.35582, "lbf·in": 0.112985, "Nm/kg": 1.0,
    "Nmm/kg": 1e-3,
}  # fmt: skip
IMPERIAL = {"lbf·ft", "lbf·in"}
BY_MASS = {"N/kg", "body weights", "% body weight", "Nm/kg", "Nmm/kg"}
ANGLE_UNITS = {"rad": 1.0, "°": math.pi / 180, "mrad": 1e-3}
# Mean vertical force of a stance by body weight: half of a stride by its stance. Of the six people
# of the corpus 0.78 to 0.81 (medians): enough to tell units apart, not a mass.
STANCE_LOAD, FORCE_SPREAD = 0.8, 0.15
# The force passes 0.127 to 0.173 m in front of the ankle where the moment peaks (the same six).
LEVER_M, LEVER_SPREAD = 0.15, 0.25
ANGLE_RAD, ANGLE_SPREAD = 0.5, 0.6  # range in stance: 0.32 to 0.59 (the same); 0.3 in an orthosis
CHANNEL_UNITS = {"force": FORCE_UNITS, "moment": MOMENT_UNITS, "angle": ANGLE_UNITS}
MASS_USUAL_KG = (35.0, 160.0)


def is_in_units(table: Table, name: str, units: Collection[str]) -> bool:
    """Return whether a column's unit, by its file or its label, is one of some, or not known."""
    return read_unit(name, table.units) in {"", *units}


def find_unit(
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
    write: the size of both decides, which differ by tens. Of feet and inches: a leg that is weaker
    by a quarter is usual after a stroke.

    Parameters
    ----------
    table, name, channel
        The column, and whether it is a "moment" or an "angle".
    profile
        Its median over strides, shape (POINTS,).
    time_s, stances, force_n
        Times [s] and the leg's force [N], shape (n,), with its stances.
    mass_kg
        Body mass.
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
    written = read_unit(name, table.units)
    if written != "kNm":  # in which a moment by body weight and height is as large
        off.pop("kNm", None)
    metric = [one for one in off if one not in IMPERIAL]
    unit = min(metric, key=lambda one: off[one])
    second = min((one for one in off if one != unit), key=lambda one: off[one])
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
        least, most = (expected * math.exp(sign * spread) for sign in (-1, 1))
        size *= units[unit]
        what, si = ("peak", "Nm") if channel == "moment" else ("range", "rad")
        size_off = (
            f"its {what} is {math.exp(min(off[unit], 99)):.1f} times too "
            f"{'large' if size > expected else 'small'}: {size:.3g} {si}, "
            f"usual are {least:.3g} to {most:.3g}"
        )
        by_height = channel == "moment" and off[unit] > math.log(5)
        cure = "; export it in Nm or Nm/kg, not by body weight and height" if by_height else ""
        doubts.append(size_off + cure)
    return unit, units[unit], doubts
