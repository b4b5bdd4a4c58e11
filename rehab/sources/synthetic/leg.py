"""A simulated foot on a leg that walks: what a sensor on it measures.

Its curves are no person's: they have the shape of a foot's (docs/reference/gait.md#worn-sensors).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

STRIDE_S, SWING_S = 1.2, 0.4
RISE_S, SLAP_S = 0.2, 0.1  # heel rise before the swing, landing after it
LENGTH_M = 0.9
GRAVITY_M_S2 = 9.81


def turn_foot(t_s: Floats) -> Floats:
    """Return the rate of rotation toes-down [rad/s] at these times."""
    phase = t_s % STRIDE_S
    swing = np.where(phase < SWING_S, -4.0 * np.sin(np.pi * phase / SWING_S), 0.0)
    slap = np.where(
        (phase >= SWING_S) & (phase < SWING_S + SLAP_S),
        5.0 * np.sin(np.pi * (phase - SWING_S) / SLAP_S),
        0.0,
    )
    late = phase - (STRIDE_S - RISE_S)
    rise = np.where(late > 0, 5.5 * np.sin(np.pi * late / RISE_S), 0.0)
    return np.asarray(swing + slap + rise)


def walk_foot(seconds: float, rate_hz: float = 100.0) -> tuple[Floats, Floats, Floats]:
    """Return times [s], rates [rad/s] and accelerations [m/s²] of a foot sensor, x ahead, z up."""
    t_s = np.arange(0, seconds, 1 / rate_hz)
    fine_s = np.arange(0, seconds, 0.001)
    turned = np.cumsum(turn_foot(fine_s)) * 0.001
    turned -= np.median(turned)
    phase = fine_s % STRIDE_S
    speed = np.where(
        phase < SWING_S, LENGTH_M / SWING_S * (1 - np.cos(2 * np.pi * phase / SWING_S)), 0.0
    )
    pitch = np.interp(t_s, fine_s, turned)
    ahead = np.interp(t_s, fine_s, np.gradient(speed, 0.001))
    rate = np.zeros((len(t_s), 3))
    rate[:, 1] = turn_foot(t_s)
    acceleration = np.zeros_like(rate)
    # A foot that is turned toes-down by the pitch sees up and ahead turned the other way.
    acceleration[:, 0] = ahead * np.cos(pitch) - GRAVITY_M_S2 * np.sin(pitch)
    acceleration[:, 2] = ahead * np.sin(pitch) + GRAVITY_M_S2 * np.cos(pitch)
    return t_s, rate, acceleration


def stand(t_s: Floats, sway: float = 0.05) -> tuple[Floats, Floats]:
    """Return rates and accelerations of somebody who stands and sways."""
    rate = np.zeros((len(t_s), 3))
    rate[:, 1] = sway * np.sin(2 * np.pi * 0.4 * t_s)
    acceleration = np.tile((0.0, 0.0, GRAVITY_M_S2), (len(t_s), 1))
    return rate, acceleration
