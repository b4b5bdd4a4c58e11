"""Other people, sensors and radios, made of a real recording: slower, weaker, noisier, mirrored."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from rehab.gait.wearables.axis import GRAVITY_M_S2
from rehab.gait.wearables.orientation import Orientation
from tests.support.simulated_leg import random_mounting
from tests.support.worn_sensors import Floats, Walk

Change = Callable[[Walk], Walk]
SEED = 35
MEAN_S = 10  # over which a posture is usual


def _find_gravity(walk: Walk) -> Floats:
    """Return gravity's part of the acceleration [m/s²], shape (n, 3)."""
    orientation, ups = Orientation(), []
    times, steps = walk.t_s, np.diff(walk.t_s, prepend=walk.t_s[0] - 0.01)
    for n in range(len(times)):
        orientation.add(steps[n], tuple(walk.acceleration[n]), tuple(walk.rate[n]))
        ups.append(orientation.up)
    return GRAVITY_M_S2 * np.array(ups)


def slower(factor: float) -> Change:
    """Take all movement that many times as long."""

    def change(walk: Walk) -> Walk:
        gravity = _find_gravity(walk)
        moved = gravity + (walk.acceleration - gravity) / factor**2
        return walk.changed(walk.t_s * factor, walk.rate / factor, moved)

    return change


def larger(factor: float) -> Change:
    """Make all movement that many times as large."""

    def change(walk: Walk) -> Walk:
        gravity = _find_gravity(walk)
        window = np.ones(MEAN_S * 100)
        weights = np.convolve(np.ones(len(gravity)), window, "same")
        usual = np.stack([np.convolve(one, window, "same") / weights for one in gravity.T], 1)
        tilted = usual + factor * (gravity - usual)
        tilted *= GRAVITY_M_S2 / np.linalg.norm(tilted, axis=1, keepdims=True)
        moved = tilted + factor * (walk.acceleration - gravity)
        return walk.changed(walk.t_s, factor * walk.rate, moved)

    return change


def noisy(rad_s: float, m_s2: float) -> Change:
    """Add white noise."""

    def change(walk: Walk) -> Walk:
        random, shape = np.random.default_rng(SEED), walk.rate.shape
        noise = random.normal(0, rad_s, shape), random.normal(0, m_s2, shape)
        return walk.changed(walk.t_s, walk.rate + noise[0], walk.acceleration + noise[1])

    return change


def drifting(rad_s: float) -> Change:
    """Let the gyroscope's zero drift up to that."""

    def change(walk: Walk) -> Walk:
        drift = np.linspace(0, rad_s, len(walk.t_s))[:, None] * (0.5, 0.7, 0.5)
        return walk.changed(walk.t_s, walk.rate + drift, walk.acceleration)

    return change


def sampled(rate_hz: float, jitter_s: float) -> Change:
    """Sample at that rate, each time a little early or late."""

    def change(walk: Walk) -> Walk:
        even = np.arange(walk.t_s[0] + 0.1, walk.t_s[-1] - 0.1, 1 / rate_hz)
        t_s = np.sort(even + np.random.default_rng(SEED).normal(0, jitter_s, len(even)))
        rate, acceleration = (
            np.stack([np.interp(t_s, walk.t_s, one) for one in table.T], 1)
            for table in (walk.rate, walk.acceleration)
        )
        return walk.changed(t_s, rate, acceleration)

    return change


def lossy(share: float) -> Change:
    """Lose that share of the samples."""

    def change(walk: Walk) -> Walk:
        return walk.picked(np.random.default_rng(SEED).random(len(walk.t_s)) >= share)

    return change


def mounted(seed: int) -> Change:
    """Mount the sensor in another way."""
    return lambda walk: walk.turned(random_mounting(seed))


def mirrored(walk: Walk) -> Walk:
    """Return the walk of the other leg. Rates of rotation are axial vectors."""
    return walk.changed(walk.t_s, walk.rate * (-1, 1, -1), walk.acceleration * (1, -1, 1))


OTHERS: dict[str, Change] = {
    "0.7 times as long": slower(0.7),
    "1.25 times as long": slower(1.25),
    "1.5 times as long": slower(1.5),
    "0.7 times as large": larger(0.7),
    "1.3 times as large": larger(1.3),
    "noise": noisy(0.1, 0.5),
    "drift": drifting(0.04),
    "50 Hz": sampled(50, 0.002),
    "128 Hz": sampled(128, 0.001),
    "losses": lossy(0.05),
    "turned": mounted(7),
    "other leg": mirrored,
}
