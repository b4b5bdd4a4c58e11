"""Ankle moment, ankle power and its push-off peak A2."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from rehab.gait.signals.filters import (
    CUTOFF_HZ,
    Floats,
    ZeroPhaseFilter,
    differentiate,
    find_maximum,
    interpolate_peak,
)
from rehab.gait.stances.resampling import ResampledStance

# Below, the center of pressure is a division by almost zero
# (docs/reference/gait.md#center-of-pressure).
COP_FORCE_N = 40.0
COP_REACH_M = 0.35  # from the ankle; no shoe is longer
# Of stance; the peak comes at 0.88-0.90 of it (docs/reference/gait.md#push-off).
PUSH_OFF_FROM = 0.4
# How the signals are extended after the last sample, for the filter: the ankle's plantarflexion
# brakes evenly, so that it ends about 60 ms after the foot left the floor (56 and
# 62 ms on the legs of moore2013), turns back for 30 ms and goes on as fast; its moment stays as
# small as it is. Against point-symmetric extension this takes the error of A2 from 2.1 to 1.0 % at
# terminal contact and from 0.5 to 0.14 % 50 ms later. 55 or 70 ms would give 1.4 and 0.8 %.
STOP_S = 0.065
TURN_S = 0.03
BEYOND_S = 0.15
SLOPE_S = 0.03  # over which the last velocity is taken


def compute_ankle_moment(
    forward_n: ArrayLike,
    up_n: ArrayLike,
    cop_forward_m: ArrayLike,
    ankle_forward_m: ArrayLike,
    ankle_up_m: ArrayLike,
) -> Floats:
    """Return the ankle moment of the force under the foot [Nm, plantarflexion positive].

    ``M = (cop − ankle) × F`` in the sagittal plane; the foot's own weight and inertia are neglected
    (quasi-static; against full inverse dynamics of one walker r = .99, 5.5 Nm rms,
    docs/reference/gait.md#push-off).

    Parameters
    ----------
    forward_n, up_n
        Ground reaction force on the foot [N], shape (n,).
    cop_forward_m, ankle_forward_m, ankle_up_m
        Center of pressure, and ankle joint with its height above the floor [m], shape (n,).

    Returns
    -------
    Shape (n,). Zero where the vertical force is below 40 N; NaN where it is not and the center of
    pressure lies more than 0.35 m from the ankle or anything is not finite.
    """
    up = np.asarray(up_n, dtype=np.float64)
    lever = np.asarray(cop_forward_m, dtype=np.float64) - np.asarray(ankle_forward_m)
    moment: Floats = lever * up + np.asarray(ankle_up_m) * np.asarray(forward_n, dtype=np.float64)
    moment[~(np.abs(lever) <= COP_REACH_M)] = np.nan
    moment[up < COP_FORCE_N] = 0.0
    return moment


@dataclass(slots=True)
class PushOff:
    """Ankle moment, angle, velocity and power of a stance, filtered, and the peak of power.

    Attributes
    ----------
    moment_nm_kg, angle_rad, velocity_rad_s, power_w_kg
        Shape (n,), as the resampled stance.
    peak
        The sample of highest power.
    a2_w_kg, a2_time_s
        The peak's height [W/kg] and time [s], interpolated between samples.
    moment_peak_nm_kg
        Largest moment until terminal contact.
    mass_kg
        Body mass.
    """

    moment_nm_kg: Floats
    angle_rad: Floats
    velocity_rad_s: Floats
    power_w_kg: Floats
    peak: int
    a2_w_kg: float
    a2_time_s: float
    moment_peak_nm_kg: float
    mass_kg: float

    @property
    def a2_moment_nm_kg(self) -> float:
        """Moment where the power peaks."""
        return self.moment_nm_kg.item(self.peak)

    @property
    def a2_velocity_rad_s(self) -> float:
        """Angular velocity where the power peaks."""
        return self.velocity_rad_s.item(self.peak)


class PushOffAnalyzer:
    """Measures push-off of one buffered stance at a time: ``power = moment × velocity / mass``.

    A2 is the peak of ankle power in late stance (Winter 1991), here of the sagittal plane: 5-8 %
    below a lab's three-plane power (docs/reference/gait.md#columns).

    Parameters
    ----------
    rate_hz
        Of the resampled stances.
    mass_kg
        Body mass of the walker.
    cutoff_hz
        Cut-off of the zero-phase low-pass on moment and angle.
    """

    def __init__(self, rate_hz: float, mass_kg: float, cutoff_hz: float = CUTOFF_HZ) -> None:
        self._rate_hz = rate_hz
        self._mass_kg = mass_kg
        self._filter = ZeroPhaseFilter(cutoff_hz, rate_hz)
        self._beyond_s = np.arange(1, round(BEYOND_S * rate_hz) + 1) / rate_hz
        # At most as many samples beyond each end are looked at by the filter.
        self._known = min(len(self._beyond_s), self._filter.reach)
        back = np.arange(-max(2, round(SLOPE_S * rate_hz)), 1) / rate_hz
        self._slope = (back - back.mean()) / ((back - back.mean()) ** 2).sum()  # least squares

    def measure(self, stance: ResampledStance) -> PushOff | None:
        """Return the push-off of a stance, None where too few of its samples are known."""
        signals, end = stance.signals[1:], stance.end
        count = signals.shape[1]
        begin = stance.index(PUSH_OFF_FROM)
        if begin < 1 or end - begin < 4 or count <= len(self._beyond_s):
            return None
        last_s = stance.first_s + (count - 1) / self._rate_hz
        moment, angle = self._smooth(signals, last_s - stance.end_s)
        velocity = differentiate(angle, self._rate_hz)
        moment /= self._mass_kg
        power = moment * velocity
        peak = begin + int(power[begin : end + 1].argmax())
        if 0 < peak < count - 1:
            place, height = interpolate_peak(power, peak)
        else:
            place, height = float(peak), float(power[peak])
        return PushOff(
            moment_nm_kg=moment,
            angle_rad=angle,
            velocity_rad_s=velocity,
            power_w_kg=power,
            peak=peak,
            a2_w_kg=height,
            a2_time_s=stance.first_s + place / self._rate_hz,
            moment_peak_nm_kg=find_maximum(moment[: end + 1]),
            mass_kg=self._mass_kg,
        )

    def _smooth(self, signals: Floats, known_s: float) -> Floats:
        """Return moment and angle filtered, known until ``known_s`` after terminal contact."""
        n, reach = self._known, self._filter.reach
        angle = signals[1]
        count = len(angle)
        end = reach + count
        wide = np.empty((2, end + reach))
        before = wide[:, reach - n : reach]
        np.subtract(2 * signals[:, :1], signals[:, n:0:-1], out=before)
        wide[:, : reach - n] = before[:, :1]
        wide[:, reach:end] = signals
        wide[0, end:] = signals.item(0, -1)
        left = count - min(round(known_s * self._rate_hz), count // 2)
        braking = self._find_velocity(angle[:left]) / STOP_S
        # The slope is that of half its stretch ago, for as much of it as the ankle brakes already.
        late_s = min(max(known_s, 0.0), SLOPE_S) / 2
        after = wide[1, end : end + n]
        np.multiply(self._beyond_s[:n], -braking, out=after)
        after += self._find_velocity(angle) - braking * late_s
        np.maximum(after, -TURN_S * braking, out=after)
        after /= self._rate_hz
        after[0] += angle.item(-1)
        np.add.accumulate(after, out=after)
        wide[1, end + n :] = after.item(-1)
        return self._filter.smooth_wide(wide)

    def _find_velocity(self, motion: Floats) -> float:
        """Return the ankle's velocity at the end of a stretch of motion, 0 if it dorsiflexes."""
        return max(0.0, float(motion[-len(self._slope) :].dot(self._slope)))
