"""The zero of a force plate (tare): its reading without load, with its baseline drift."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence

import numpy as np

from rehab.gait.contacts.drag import QUIET_S
from rehab.gait.signals.filters import (
    Floats,
    average,
    find_minimum,
    find_upper_median,
    is_finite,
)

OFFSET_MAX = 0.15  # of body weight; a plate that reads more in swing needs its own zero button
OFFSET_SWINGS = 10
SWING_S = 0.05  # a swing's middle is no shorter
# A zero drifts by less from swing to swing; one that was set anew is the same in each, a drag not.
ZERO_STEP_N = 15.0
ZERO_SWINGS, ZERO_SPREAD_N = 3, 4.0
LEAST_N = 10.0  # by which a plate that bears nothing all through a swing reads less at its ends
QUIET_N = 8.0  # by which the parts of a swing differ that nothing loads


class PlateZero:
    """Tracks the zero of a plate [N] from what it reads in swing.

    It is learned only where the plate is unloaded in height and in time: a drag is another force in
    each swing, or loads a part of it.

    Parameters
    ----------
    weight_n
        Body weight [N].
    rate_hz
        Of the samples.
    """

    def __init__(self, weight_n: float, rate_hz: float) -> None:
        self.offset_n = 0.0
        self._most_n = OFFSET_MAX * weight_n
        self._least = max(3, int(SWING_S * rate_hz))
        self._quiet = max(1, round(QUIET_S * rate_hz))
        self._offsets: deque[float] = deque(maxlen=OFFSET_SWINGS)
        self._zeros: deque[float] = deque(maxlen=ZERO_SWINGS)

    def learn(self, swing: Floats, ends: Sequence[Floats] = ()) -> None:
        """Learn from a swing.

        Parameters
        ----------
        swing
            Its middle, shape (n,).
        ends
            The force around both ends of the swing, shape (m,) each, if they are known: no plate
            reads less than its zero there, so that a swing that reads more is one of a foot that is
            dragged all through it.
        """
        if len(swing) < self._least:
            return
        zero = _find_zero(swing)
        if any(self._falls_below(end, zero - LEAST_N) for end in ends):
            self._zeros.clear()
            return
        self._zeros.append(zero)
        is_near = abs(zero - self.offset_n) <= ZERO_STEP_N
        is_steady = (
            len(self._zeros) == ZERO_SWINGS and max(self._zeros) - min(self._zeros) < ZERO_SPREAD_N
        )
        if abs(zero) <= self._most_n and (is_near or is_steady):
            if not is_near:
                self._offsets.clear()
            self._offsets.append(zero)
            self.offset_n = sorted(self._offsets)[len(self._offsets) // 2]

    def _falls_below(self, force: Floats, limit_n: float) -> bool:
        """Return whether a force falls below a limit [N], its noise averaged."""
        if find_minimum(force) >= limit_n:
            return False
        return find_minimum(average(force, min(len(force), self._quiet))) < limit_n

    def reset(self, lowest_n: float) -> bool:
        """Take another zero, where a contact does not end; return whether that is possible."""
        if abs(lowest_n) > self._most_n or abs(lowest_n - self.offset_n) < 5.0:
            return False
        self.offset_n = lowest_n
        self._offsets.clear()
        return True


def _find_zero(swing: Floats) -> float:
    """Return what a plate reads in a swing [N]: in its quietest part, where a drag loads another.

    A part is a quarter; where all of them agree, it is the whole.
    """
    zero = find_finite_median(swing)
    quarter = max(1, len(swing) // 4)
    if np.count_nonzero(swing < zero - QUIET_N) <= quarter // 2 and is_finite(swing):
        return zero  # no part has a lower median by so few
    lowest = min(find_finite_median(swing[n * quarter :][:quarter]) for n in range(4))
    return lowest if zero - lowest > QUIET_N else zero


def find_finite_median(values: Floats) -> float:
    """Return the median of the finite values, infinity without one."""
    if is_finite(values):
        return find_upper_median(values)
    finite = values[np.isfinite(values)]
    return float(np.median(finite)) if len(finite) else np.inf
