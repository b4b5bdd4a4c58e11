"""Checks of one leg's force and strides, as code and cure."""

from __future__ import annotations

from collections import Counter

import numpy as np

from rehab.gait.one_leg import OFFSET_N
from rehab.gait.selfcheck.cures import CURES
from rehab.gait.signals.filters import Floats
from rehab.gait.strides import Stride

OFTEN = 0.2  # of the strides; a fault of fewer is the walker's, not the set-up's
USUAL_MOMENT = (0.8, 2.0)  # Nm/kg, healthy (docs/reference/gait.md#usual-values)
USUAL_A2 = (0.3, 7.0)  # W/kg (docs/reference/gait.md#usual-values)


def check_force(force: Floats, strides: list[Stride], weight_n: float) -> list[tuple[str, str]]:
    """Return what is wrong with the force itself, where there are no strides, or no usable ones.

    Parameters
    ----------
    force, weight_n
        The vertical force, shape (n,), and body weight [N].
    strides
        Of this leg.
    """
    finite = force[np.isfinite(force)]
    if not len(finite):
        return [("force_lost", "No vertical force arrives. Look at the plate and its channel.")]
    low, high = np.percentile(finite, [1, 99]).tolist()
    if -low > high and -low > 0.3 * weight_n:
        return [
            (
                "force_sign",
                "The vertical force is negative; here up is positive. Give it a factor of -1.",
            )
        ]
    if high < 0.01 * weight_n and high - low > 0.0002 * weight_n:
        return [("force_unit", f"The vertical force reaches only {high:.2g} N. Look up its "
                 "unit, and check that the plate is on.")]  # fmt: skip
    if high > 5 * weight_n:
        return [("force_unit", f"The vertical force reaches {high:.2g} N. Look up its unit, "
                 "and check the body mass.")]  # fmt: skip
    if not strides:
        return [("no_strides", "No stride was seen. Walk for half a minute, and check that the "
                 "plate is on and zeroed.")]  # fmt: skip
    offset = strides[-1].offset_n
    if abs(offset) > OFFSET_N:
        return [("offset", f"The plate reads {offset:.0f} N while the foot swings. Zero it: the "
                 "contacts are corrected for it, the lab's moment is not.")]  # fmt: skip
    return []


def check_strides(strides: list[Stride]) -> list[tuple[str, str]]:
    """Return why strides are often invalid, else which of their figures are unusual."""
    counts = Counter(reason for stride in strides for reason in stride.reasons)
    found = [
        (str(reason), CURES[reason])
        for reason, count in counts.most_common()
        if reason in CURES and count > OFTEN * len(strides)
    ]
    good = [stride for stride in strides if stride.valid]
    if found or not good:
        return found
    moment = float(np.median([s.moment_peak_nm_kg or 0.0 for s in good]))
    a2 = float(np.median([s.a2_w_kg or 0.0 for s in good]))
    if not USUAL_MOMENT[0] <= moment <= USUAL_MOMENT[1]:
        found.append(("moment_unusual", f"The ankle moment peaks at {moment:.2f} Nm/kg; usual are "
                      f"0.8 to 2.0. {_say_cure(moment < USUAL_MOMENT[0])}"))  # fmt: skip
    if not USUAL_A2[0] <= a2 <= USUAL_A2[1]:
        found.append(("a2_unusual", f"A2 is {a2:.2f} W/kg; usual are 0.3 to 7. "
                      f"{_say_cure(a2 < USUAL_A2[0])}"))  # fmt: skip
    return found


def _say_cure(is_low: bool) -> str:
    return f"{'Right for a weak leg; else check' if is_low else 'Check'} units and mass."
