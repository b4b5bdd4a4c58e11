"""What an unloaded leg reads: its moment should be a foot's weight, and its plate nothing.

No single stride shows it where either is not so, as the noise is as large; the median of many does.
"""

from __future__ import annotations

from collections.abc import Sequence
from statistics import median

import numpy as np

from rehab.gait.signals.filters import Floats
from rehab.gait.strides import Stride

STRIDES_MIN = 5
SWING = (0.25, 0.75)  # of swing
ALONE = (0.4, 0.6)  # of stance: everybody's other foot swings then
# Nm/kg. The foot's own weight, and what it takes to swing it: -0.024 to 0.015 (five people, four
# systems; most of their strides).
FOOT_NM_KG = -0.01
USUAL_NM_KG = (-0.045, 0.03)
CERTAIN = 0.1  # of A2, by which it is off: then strides wait for a person
USUAL_LOAD = 0.05  # of body weight; -0.007 to 0.026 (the same); a foot that drags reaches 0.1


def find_moment_zero(
    time_s: Floats, moment_nm: Floats, strides: Sequence[Stride], mass_kg: float
) -> tuple[str, bool] | None:
    """Return a moment's zero if it is off, in words, and whether A2 is off by a tenth by that.

    Parameters
    ----------
    time_s, moment_nm
        Shape (n,).
    strides
        Of this leg.
    mass_kg
        Body mass.
    """
    swings = [(s.initial_contact_s - s.swing_s, s.swing_s) for s in strides if s.swing_s]
    rest = _find_level(time_s, moment_nm, swings, SWING)
    pushes = [s.a2_moment_nm_kg for s in strides if s.valid and s.a2_moment_nm_kg]
    if rest is None or not pushes or USUAL_NM_KG[0] <= rest / mass_kg <= USUAL_NM_KG[1]:
        return None
    share = (rest / mass_kg - FOOT_NM_KG) / median(pushes)
    text = (
        f"The ankle moment is {rest:.1f} Nm while the foot swings, where its weight alone is left. "
        f"Zero the plates before the lab's inverse dynamics: A2 is off by about {share:+.0%}."
    )
    return text, abs(share) > CERTAIN


def find_other_load(
    time_s: Floats, force_n: Floats, strides: Sequence[Stride], zero_n: float, weight_n: float
) -> tuple[str, bool] | None:
    """Return what a plate bears whose foot swings, in words, and whether A2 is off by a tenth.

    Parameters
    ----------
    time_s, force_n
        Of that plate, shape (n,).
    strides
        Of the other leg, which stands then.
    zero_n, weight_n
        The plate's zero, and body weight [N].
    """
    level = _find_level(
        time_s, force_n, [(s.initial_contact_s, s.stance_s) for s in strides], ALONE
    )
    share = 0.0 if level is None else (level - zero_n) / weight_n
    if share < USUAL_LOAD:
        return None
    side = strides[0].side
    text = (
        f"While the {side} foot stands alone, the other plate carries {share:.0%} of the weight: a "
        f"cane or hand, or a foot that drags. The {side} leg's A2 is lower by about as much."
    )
    return text, share > CERTAIN


def _find_level(
    time_s: Floats,
    values: Floats,
    spans: Sequence[tuple[float, float]],
    part: tuple[float, float],
) -> float | None:
    """Return the median, of many times, of a channel's mean in a part of each."""
    means = []
    for begin_s, length_s in spans:
        ends_s = [begin_s + share * length_s for share in part]
        inside = values[slice(*np.searchsorted(time_s, ends_s))]
        if len(inside) and np.isfinite(inside).all():
            means.append(float(inside.mean()))
    return median(means) if len(means) >= STRIDES_MIN else None
