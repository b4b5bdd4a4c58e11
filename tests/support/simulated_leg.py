"""A simulated foot on a leg that walks, its sensor mounted in any way."""

from __future__ import annotations

import numpy as np

from rehab.sources.synthetic.leg import (
    STRIDE_S,
    SWING_S,
    Floats,
    stand,
    turn_foot,
    walk_foot,
)

__all__ = ["STRIDE_S", "SWING_S", "Floats", "stand", "turn_foot", "walk_foot"]

CONTACT_S = SWING_S  # in each stride, which begins with the swing


def random_mounting(seed: int) -> Floats:
    """Return a rotation matrix, any way of mounting a sensor being as likely."""
    matrix, triangle = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    matrix = matrix * np.sign(np.diag(triangle))
    return matrix if np.linalg.det(matrix) > 0 else matrix[:, [1, 0, 2]]


def stretch_a_swing(begin_s: float) -> tuple[Floats, Floats, Floats]:
    """Return a walk in which one swing lasts twice as long: its foot seems to land late."""
    t_s, rate, acceleration = walk_foot(40)
    now_s = np.arange(0, 40, 0.01)
    into_s = np.clip(now_s - begin_s, 0, 2 * SWING_S)
    at_s = now_s - into_s / 2
    rate, acceleration = (
        np.stack([np.interp(at_s, t_s, one) for one in part.T], 1) for part in (rate, acceleration)
    )
    rate[(into_s > 0) & (into_s < 2 * SWING_S)] /= 2
    return now_s, rate, acceleration
