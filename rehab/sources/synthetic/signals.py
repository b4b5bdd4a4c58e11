"""Synthetic strides as signals: force, moment and angle of both legs, at any rate.

The shapes follow Winter (1991) and the walker of moore2013: a force of two humps, a moment that
peaks at 78 % of stance, an angle that plantarflexes until 55 ms after the foot left the floor. Each
stride's push-off is scaled so that moment × angular velocity peaks at the A2 that was asked for.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator

from rehab.training.steps import Measurement

Floats = NDArray[np.float64]

GRAVITY_M_S2 = 9.81
# Functions of the share of stance: vertical and forward force (N/kg, the vertical one before it is
# scaled to the body's weight), moment (of its peak).
FORCE = PchipInterpolator(
    [0, 0.03, 0.1, 0.22, 0.35, 0.5, 0.65, 0.78, 0.88, 0.95, 0.98, 1],
    [0, 1.6, 5, 10.2, 8.8, 7.8, 8.6, 10.4, 7.5, 2.6, 0.8, 0],
)
FORWARD = PchipInterpolator([0, 0.2, 0.5, 0.85, 0.97, 1], [0, -1.5, 0, 1.7, 0.3, 0])
MOMENT = PchipInterpolator(
    [0, 0.05, 0.12, 0.3, 0.55, 0.78, 0.85, 0.92, 0.97, 1],
    [0, -0.03, -0.08, 0.18, 0.6, 1, 0.88, 0.42, 0.1, 0],
)
STOP_S = 0.055  # from terminal contact to the largest plantarflexion
PUSH_FROM = 0.76  # of stance: the largest dorsiflexion
# Velocity of push-off by its peak, seconds after terminal contact (moore2013, both legs; there
# contact ends at 20 N, which is 5 ms earlier).
PUSH = ((-0.085, 0.58), (-0.045, 0.85), (-0.01, 1.0), (0.015, 0.82), (0.035, 0.45))
STANCE_SHARE = 0.63  # of a stride of 1.1 s; slower people stand for longer
A2_DEFAULT_W_KG = 2.5


@dataclass(frozen=True, slots=True)
class LegSignals:
    """One leg's channels, shape (n,) each: plantarflexion, upward and forward are positive."""

    force_n: Floats
    moment_nm: Floats
    angle_rad: Floats
    forward_n: Floats


@dataclass(frozen=True, slots=True)
class Sensors:
    """How a lab measures. Defaults: moore2013's treadmill and motion capture.

    Source: docs/reference/gait.md#data-sets.

    Attributes
    ----------
    rate_hz
        Samples per second.
    jitter_s
        Sd of the samples' times, which are sent as they are.
    force_noise_n, moment_noise_nm, angle_noise_rad
        White sd.
    force_offset_n, force_drift_n_min
        The plates' zero at the start [N], and its change [N/min].
    angle_delay_s
        By how much the angle is late [s].
    """

    rate_hz: float = 100.0
    jitter_s: float = 0.0003
    force_noise_n: float = 4.5
    moment_noise_nm: float = 0.5
    angle_noise_rad: float = 0.001
    force_offset_n: float = 0.0
    force_drift_n_min: float = 0.0
    angle_delay_s: float = 0.0


@dataclass(slots=True)
class LegBuilder:
    """The channels of one leg before sensors, at the samples' times."""

    t_s: Floats
    mass_kg: float
    force: Floats = field(init=False)
    moment: Floats = field(init=False)
    angle: Floats = field(init=False)
    forward: Floats = field(init=False)

    def __post_init__(self) -> None:
        self.force, self.moment, self.angle, self.forward = np.zeros((4, len(self.t_s)))

    def walk(
        self,
        begin_s: float,
        stride_s: float,
        a2_w_kg: float,
        stance: Measurement | None,
        angle_delay_s: float,
        pace_s: float | None = None,
    ) -> None:
        """Add one stride that begins with a contact, or the part of it within the samples' times.

        Its stance time is that of a stride of ``pace_s`` if given, else of its own time.
        """
        pace_s = pace_s or stride_s
        stance_s = find_stance_s(pace_s)
        peak_nm_kg = min(max(0.5 + 0.35 * a2_w_kg, 0.4), 1.7)
        push_rad_s = _find_push(a2_w_kg, peak_nm_kg, stance_s)
        span = slice(*np.searchsorted(self.t_s, (begin_s, begin_s + stance_s)))
        share = (self.t_s[span] - begin_s) / stance_s
        weight = GRAVITY_M_S2 * pace_s / 2 / (float(FORCE.integrate(0, 1)) * stance_s)
        self.force[span] = FORCE(share) * weight * self.mass_kg
        self.forward[span] = FORWARD(share) * self.mass_kg
        self.moment[span] = MOMENT(share) * peak_nm_kg * self.mass_kg
        first = begin_s + angle_delay_s
        whole = slice(*np.searchsorted(self.t_s, (first, first + stride_s)))
        self.angle[whole] = _make_angle(stance_s, stride_s, push_rad_s)(self.t_s[whole] - first)
        if stance is not None and stance.reasons:
            self.force[span][len(share) // 2 : len(share) // 2 + max(1, len(share) // 10)] = 0
        if stance is not None and stance.value is None:
            self.moment[span] = np.nan


def find_stance_s(stride_s: float) -> float:
    """Return how long a stride's stance lasts [s]."""
    return stride_s * min(0.8, STANCE_SHARE + 0.08 * (stride_s - 1.1))


def add_sensors(leg: LegBuilder, sensors: Sensors, rng: np.random.Generator) -> LegSignals:
    """Return a leg's signals with the sensors' noise, offset and drift."""

    def add(values: Floats, noise: float) -> Floats:
        return np.asarray(values + rng.normal(0, noise, len(values)))

    zero = sensors.force_offset_n + sensors.force_drift_n_min * leg.t_s / 60
    return LegSignals(
        add(leg.force + zero, sensors.force_noise_n),
        add(leg.moment, sensors.moment_noise_nm),
        add(leg.angle, sensors.angle_noise_rad),
        add(leg.forward, sensors.force_noise_n),
    )


def _make_angle(stance_s: float, stride_s: float, push_rad_s: float) -> PchipInterpolator:
    """Return the ankle angle of a stride by time, whose velocity peaks at ``push_rad_s``.

    The velocity is set where it is known, and swing takes the angle back to where it began.
    """
    slow = 0.7 / stance_s  # who stands for longer rolls over the foot more slowly
    end, swing_s = stance_s, stride_s - stance_s
    stance = [(0, 0.2), (0.05, 1.0), (0.1, 0), (0.17, -1.2), (0.3, -0.6), (0.6, -0.35)]
    knots = [(share * end, slow * velocity) for share, velocity in stance]
    knots += [(PUSH_FROM * end, 0.0)]
    knots += [(end + after_s, share * push_rad_s) for after_s, share in PUSH]
    knots += [(end + STOP_S, 0.0)]
    back = [(end + STOP_S + 0.04, 1.0), (end + 0.6 * swing_s, 0.35), (end + 0.9 * swing_s, 0.0)]
    times = [time for time, _ in (*knots, *back)] + [stride_s]
    there = PchipInterpolator(times, [v for _, v in knots] + [0.0] * len(back) + [slow * 0.2])
    home = PchipInterpolator(times, [0.0] * len(knots) + [v for _, v in back] + [0.0])
    gone = float(there.integrate(0, stride_s)) / float(home.integrate(0, stride_s))
    angle: PchipInterpolator = PchipInterpolator(
        times, there(times) - gone * home(times)
    ).antiderivative()
    return angle


def _find_push(a2_w_kg: float, peak_nm_kg: float, stance_s: float) -> float:
    """Return the push-off velocity with which moment × velocity peaks at the given A2."""
    times = np.linspace(PUSH_FROM, 1, 400) * stance_s
    shape = PchipInterpolator(
        [PUSH_FROM * stance_s, *(stance_s + after_s for after_s, _ in PUSH)],
        [0, *(share for _, share in PUSH)],
    )
    return a2_w_kg / (peak_nm_kg * float((MOMENT(times / stance_s) * shape(times)).max()))
