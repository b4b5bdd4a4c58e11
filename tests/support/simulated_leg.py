"""A simulated foot on a leg that walks, its sensor mounted in any way."""

from __future__ import annotations

import numpy as np

from rehab.sources.synthetic.leg import (
    CONTACT_S,
    STRIDE_S,
    SWING_S,
    Floats,
    stand,
    turn_foot,
    walk_foot,
)

__all__ = ["CONTACT_S", "STRIDE_S", "SWING_S", "Floats", "stand", "turn_foot", "walk_foot"]


def random_mounting(seed: int) -> Floats:
    """Return a rotation matrix, any way of mounting a sensor being as likely."""
    matrix, triangle = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    matrix = matrix * np.sign(np.diag(triangle))
    return matrix if np.linalg.det(matrix) > 0 else matrix[:, [1, 0, 2]]
