"""Faults that sensors, set-ups and walkers have, put into a walk whose strides are known."""

import itertools
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from rehab.gait.selfcheck.shapes import SHAPES
from tests.gait.walks import ANGLE, FORCE, MOMENT, Walk

SIDES = ("left", "right")


def legs_of(walk: Walk) -> dict[str, np.ndarray]:
    return {"left": walk.left.copy(), "right": walk.right.copy()}


def find_rows(walk: Walk, begin_s: float, end_s: float) -> slice:
    return slice(*np.searchsorted(walk.t_s, (begin_s, end_s)))


def stall(walk, clean, width_s, *, by_stamp=False, share=(0.0, 1.0), seed=0):
    """Let samples wait for ``width_s`` once a stride, then come 0.3 to 1 ms apart.

    With ``by_stamp`` moment and angle are those of the stamps' times, as HBM makes them.
    """
    rng = np.random.default_rng(seed)
    stamps = walk.t_s.copy()
    for stride in (s for s in clean if s.side == "left"):
        at_s = stride.initial_contact_s + rng.uniform(*share) * stride.stance_s
        at = int(np.searchsorted(walk.t_s, at_s))
        if at >= len(stamps):
            continue
        come_s = walk.t_s[at] + width_s
        burst_s = min(0.0003, 0.2 / walk.rate_hz), min(0.001, 0.5 / walk.rate_hz)
        while at < len(stamps) and walk.t_s[at] < come_s:
            stamps[at] = come_s
            come_s += rng.uniform(*burst_s)
            at += 1
    legs = legs_of(walk)
    if by_stamp:
        for leg in legs.values():
            for row in (MOMENT, ANGLE):
                leg[row] = np.interp(stamps, walk.t_s, leg[row])
    return replace(walk, t_s=stamps, **legs)


def lose(walk, clean, width_s, *, share=(0.0, 1.0), seed=0):
    """Lose the samples of ``width_s`` once in every stride."""
    rng = np.random.default_rng(seed)
    kept = np.ones(len(walk.t_s), dtype=bool)
    for stride in (s for s in clean if s.side == "left"):
        begin_s = stride.initial_contact_s + rng.uniform(*share) * stride.stance_s
        kept[find_rows(walk, begin_s, begin_s + width_s)] = False
    return replace(walk, t_s=walk.t_s[kept], left=walk.left[:, kept], right=walk.right[:, kept])


def change_rows(walk, rows, change: Callable[[np.ndarray], np.ndarray]):
    """Change channels of both legs."""
    legs = legs_of(walk)
    for leg in legs.values():
        for row in rows:
            leg[row] = change(leg[row])
    return replace(walk, **legs)


def lag(walk, _clean, rows, lag_s):
    """Let channels come later."""
    return change_rows(walk, rows, lambda x: np.interp(walk.t_s - lag_s, walk.t_s, x))


def drift(walk, _clean, rows, last_s):
    """Let channels come later and later, by ``last_s`` at the end."""
    late_s = last_s * (walk.t_s - walk.t_s[0]) / (walk.t_s[-1] - walk.t_s[0])
    return change_rows(walk, rows, lambda x: np.interp(walk.t_s - late_s, walk.t_s, x))


def scale(walk, _clean, rows, factor):
    """Turn a sign, take another unit or a wrong gain."""
    return change_rows(walk, rows, lambda x: x * factor)


def shift(walk, _clean, rows, by):
    """Let channels have another zero."""
    return change_rows(walk, rows, lambda x: x + by)


def take_knee(walk, clean):
    """Take the knees' angles for the ankles'."""
    legs = legs_of(walk)
    for side, leg in legs.items():
        begins_s = [s.initial_contact_s for s in clean if s.side == side]
        for begin_s, end_s in itertools.pairwise(begins_s):
            rows = find_rows(walk, begin_s, end_s)
            share = (walk.t_s[rows] - begin_s) / (end_s - begin_s)
            leg[ANGLE, rows] = np.interp(share, np.arange(100) / 100, SHAPES["knee angle"])
    return replace(walk, **legs)


def lean_on_cane(walk, clean, share):
    """Let a cane on the right belt carry a share of the weight while the left foot stands."""
    legs = legs_of(walk)
    for stride in (s for s in clean if s.side == "left"):
        rows = find_rows(walk, stride.initial_contact_s, stride.terminal_contact_s)
        count = rows.stop - rows.start
        cane_n = 9.81 * walk.mass_kg * share * np.sin(np.pi * np.arange(count) / count)
        left = 1 - np.minimum(cane_n / np.maximum(legs["left"][FORCE, rows], 1), 0.9)
        legs["left"][FORCE : MOMENT + 1, rows] *= left
        legs["right"][FORCE, rows] += cane_n
    return replace(walk, **legs)


def land_on_toes(walk, clean):
    """Let the left foot touch with its toes first, as an equinus foot does, and load slowly."""
    legs = legs_of(walk)
    leg = legs["left"]
    for stride in (s for s in clean if s.side == "left"):
        begin_s, stance_s = stride.initial_contact_s, stride.stance_s
        rows = find_rows(walk, begin_s - 0.12, begin_s)
        leg[FORCE, rows] += np.linspace(20, 60, rows.stop - rows.start)
        rows = find_rows(walk, begin_s, stride.terminal_contact_s)
        share = (walk.t_s[rows] - begin_s) / stance_s
        leg[FORCE, rows] *= np.interp(share, [0, 0.25, 1], [0.35, 1, 1])
        lever = np.interp(share, [0, 0.08, 0.35, 0.6, 1], [0.13, 0.12, 0.06, 0.1, 0.15])
        early = np.interp(share, [0, 0.5, 0.75, 1], [1, 1, 0, 0])
        leg[MOMENT, rows] *= 1 - early
        leg[MOMENT, rows] += early * lever * np.maximum(leg[FORCE, rows], 0)
        rows = find_rows(walk, begin_s - 0.3, begin_s + 0.3 * stance_s)
        since = walk.t_s[rows] - begin_s
        away = np.minimum(np.where(since < 0, -since / 0.3, since / (0.3 * stance_s)), 1)
        leg[ANGLE, rows] += 0.15 * (1 + np.cos(np.pi * away))
    return replace(walk, **legs)


def weigh(walk, _clean, factor):
    """Enter another body mass."""
    return replace(walk, mass_kg=walk.mass_kg * factor)


def even_out(walk, clean, width_s):
    """Stall inverse dynamics by stamp, then put all on an even grid before it is sent."""
    stalled = stall(walk, clean, width_s, by_stamp=True)
    grid = np.arange(len(walk.t_s)) / walk.rate_hz + walk.t_s[0]
    return replace(stalled, t_s=grid)


def fill(walk, clean, width_s, *, order):
    """Fill gaps of the angle before it is sent, once in two strides, with a curve of an order."""
    legs = legs_of(walk)
    rng = np.random.default_rng(0)
    for stride in [s for s in clean if s.side == "left"][::2]:
        at_s = stride.initial_contact_s + rng.uniform(0.3, 0.9) * stride.stance_s
        rows = find_rows(walk, at_s, at_s + width_s)
        around = np.concatenate((np.arange(rows.start - 3, rows.start), rows.stop + np.arange(3)))
        if around[-1] >= len(walk.t_s):
            continue
        for leg in legs.values():
            known = leg[ANGLE, around if order > 1 else around[2:4]]
            at = around if order > 1 else around[2:4]
            curve = np.polynomial.Polynomial.fit(at, known, order)
            leg[ANGLE, rows] = curve(np.arange(rows.start, rows.stop))
    return replace(walk, **legs)


def swap(walk, _clean, rows):
    """Take channels of the left leg for those of the right one, and vice versa."""
    legs = legs_of(walk)
    legs["left"][rows], legs["right"][rows] = walk.right[rows], walk.left[rows]
    return replace(walk, **legs)


def load_swing(walk, clean, low, high, force_n, *, every=1, spread=0.0, seed=0):
    """Load the foot with a force from a share of swing to another one, more or less each time."""
    rng = np.random.default_rng(seed)
    legs = legs_of(walk)
    for side, leg in legs.items():
        own = [s for s in clean if s.side == side]
        for one, after in list(itertools.pairwise(own))[::every]:
            begin_s, swing_s = one.terminal_contact_s, after.initial_contact_s
            swing_s -= begin_s
            if 0.1 < swing_s < 3:
                rows = find_rows(walk, begin_s + low * swing_s, begin_s + high * swing_s)
                ramp = np.minimum(np.arange(rows.stop - rows.start) / (0.03 * walk.rate_hz), 1)
                ends = (ramp if low > 0 else 1) * (ramp[::-1] if high < 1 else 1)
                leg[FORCE, rows] += force_n * (1 + spread * rng.uniform(-1, 1)) * ends
    return replace(walk, **legs)


def drag(walk, clean, force_n, low=0.3, high=0.8):
    """Drag the foot over the belt in a part of swing."""
    return load_swing(walk, clean, low, high, force_n, spread=0.15)


def scuff(walk, clean, force_n, low=0.5):
    """Let every third swing brush the belt."""
    return load_swing(walk, clean, low, low + 0.2, force_n, every=3)


def straddle(walk, clean):
    """Let every fourth right step land on the left plate."""
    legs = legs_of(walk)
    for stride in [s for s in clean if s.side == "right"][3::4]:
        rows = find_rows(walk, stride.initial_contact_s - 0.02, stride.terminal_contact_s + 0.02)
        legs["left"][:2, rows] += legs["right"][:2, rows]
        legs["right"][:2, rows] = 0
    return replace(walk, **legs)


def shake(walk, clean, share, hz=6.0):
    """Let the left ankle beat until push-off, as clonus does: force, moment and angle."""
    legs = legs_of(walk)
    leg = legs["left"]
    for stride in (s for s in clean if s.side == "left"):
        begin_s, stance_s = stride.initial_contact_s, stride.stance_s
        rows = find_rows(walk, begin_s + 0.05 * stance_s, begin_s + 0.75 * stance_s)
        time = walk.t_s[rows] - walk.t_s[rows.start]
        beat = np.sin(2 * np.pi * hz * time) * np.minimum(1, np.sin(np.pi * time / time[-1]) * 4)
        leg[FORCE, rows] *= 1 + 0.3 * share * beat
        leg[MOMENT, rows] += 12 * share * beat
        leg[ANGLE, rows] += 0.06 * share * beat
    return replace(walk, **legs)
