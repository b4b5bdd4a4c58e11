"""How uncertain an A2 is: by noise, by samples that are not waited for, and by the clock."""

from __future__ import annotations

import math

import numpy as np

from rehab.gait.signals.filters import Floats, ZeroPhaseFilter, differentiate
from rehab.gait.stances.kinetics import PUSH_OFF_FROM, PushOff
from rehab.gait.stances.resampling import ResampledStance

# Share of A2 (sd): off by 1.0 % on average at terminal contact, by 0.14 % 50 ms later (moore2013).
AHEAD_SHARE, AHEAD_DECAY_S = 0.0125, 0.025
# Noise is what is left of neighbors' third differences: of a walker's curves they leave nothing.
# Of white noise the median size of these is 0.6745 × √20 of its sd.
THIRD_DIFFERENCE = 0.6745 * math.sqrt(20)
PUT_BACK_S = 0.001  # to which samples that came late are put back to when they were taken
USUAL_DRIFT_S = 0.01  # of a lag; a steady walker's own drifts by as much (moore2013)


class Uncertainty:
    """Standard deviation of each A2, by what its own stance was like.

    What is wrong all along (a gain, a lag from the first stride on) is not in it: it is the same in
    the baseline that goals are set by, and the check of the set-up finds it.

    Parameters
    ----------
    rate_hz, cutoff_hz
        As in ``PushOffAnalyzer``.
    """

    def __init__(self, rate_hz: float, cutoff_hz: float) -> None:
        self._rate_hz = rate_hz
        impulse = np.zeros((1, 2 * (ZeroPhaseFilter(cutoff_hz, rate_hz).reach + 4) + 1))
        impulse[0, impulse.shape[1] // 2] = 1.0
        response = ZeroPhaseFilter(cutoff_hz, rate_hz).smooth_extended(impulse, 0)[0]
        slope = differentiate(response, rate_hz)
        self._moment_gain = math.sqrt(float(response @ response))
        self._velocity_gain = math.sqrt(float(slope @ slope))

    def find(
        self,
        stance: ResampledStance,
        push_off: PushOff,
        late_s: float,
        drift_s: float,
        beyond_s: float = 0.0,
    ) -> float:
        """Return the standard deviation of an A2 [W/kg].

        Parameters
        ----------
        stance, push_off
            What it was measured from.
        late_s, drift_s
            By how much samples came late at most, and by how much the angle's lag has changed since
            the first strides [s].
        beyond_s
            By how much that lag is beyond what is known of people [s].
        """
        peak, velocity = push_off.peak, push_off.velocity_rad_s
        part = slice(stance.index(PUSH_OFF_FROM), stance.end + 1)
        moment_nm, angle = _find_noise(stance.signals[1:, part])
        noise = math.hypot(
            push_off.a2_velocity_rad_s * moment_nm / push_off.mass_kg * self._moment_gain,
            push_off.a2_moment_nm_kg * angle * self._velocity_gain,
        )
        known_s = stance.first_s + (len(velocity) - 1) / self._rate_hz - stance.end_s
        ahead = AHEAD_SHARE * math.exp(-max(0.0, known_s) / AHEAD_DECAY_S) * push_off.a2_w_kg
        # Where the power peaks, it changes by moment × acceleration with the time between them.
        before = velocity.item(max(0, peak - 1))
        after = velocity.item(min(peak + 1, len(velocity) - 1))
        by_time = push_off.a2_moment_nm_kg * (after - before) * self._rate_hz / 2
        apart_s = max(0.0, abs(drift_s) - USUAL_DRIFT_S) + (PUT_BACK_S if late_s > 0 else 0.0)
        apart_s += abs(beyond_s)
        return math.hypot(noise, ahead, by_time * apart_s)


def _find_noise(rows: Floats) -> list[float]:
    """Return the sd of each channel's noise, 0 of too few samples."""
    if rows.shape[1] < 8:
        return [0.0] * len(rows)
    steps = rows[:, 1:] - rows[:, :-1]
    third = steps[:, 2:] - 2 * steps[:, 1:-1]
    third += steps[:, :-2]
    np.abs(third, out=third)
    third.sort(axis=1)  # in vectors, unlike a partition
    middle = third[:, third.shape[1] // 2]
    return [size / THIRD_DIFFERENCE for size in middle.tolist()]
