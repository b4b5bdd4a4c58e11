"""Measures beside A2 that stroke labs train, each against numpy alone on a recorded walk.

The recorded walk is moore2013's (43 strides a leg, belt speed 0.8 m/s): contacts where the force
crosses 20 N, impulses of the unfiltered forward force, its peak below 20 Hz, lengths of the feet's
positions. Of 71 strides some had late samples, which numpy leaves where their stamps are.
"""

from functools import cache

import numpy as np
import pytest
from scipy.signal import butter, filtfilt

from rehab.gait import LegSamples, measure_strides
from rehab.sources.intake.measurements import to_measurement
from rehab.training.steps import Side
from robot.wire.limits import MAX_EXTRA
from tests.gait.corpus import CorpusWalk, find_stances
from tests.gait.walks import read_moore, read_moore_columns

SIDES = ("left", "right")
OTHER = {"left": "right", "right": "left"}


@cache
def open_walk():
    """Return the recorded walk with forward forces and positions, and its measured strides."""
    walk, _ = read_moore()
    columns = read_moore_columns()
    legs = {
        side: LegSamples(
            walk_leg[0],
            walk_leg[1],
            walk_leg[2],
            columns[f"{side.title()}GRF_x"],
            columns[f"{side.title()}Foot_x"],
        )
        for side, walk_leg in (("left", walk.left), ("right", walk.right))
    }
    strides = measure_strides(walk.t_s, legs, rate_hz=100, mass_kg=walk.mass_kg)
    return CorpusWalk("moore2013", walk.t_s, legs, walk.mass_kg, False), strides


@cache
def measure_by_numpy():
    """Return for each stance, by side and begin, its figures by name."""
    walk, _ = open_walk()
    stances = {side: find_stances(walk, side) for side in SIDES}
    b, a = butter(2, 20 / 50)
    found = {}
    for side in SIDES:
        own, others = stances[side], stances[OTHER[side]]
        for place, (begin_s, end_s) in enumerate(own):
            before = [one for one in others if one[0] < begin_s]
            after = [one for one in others if begin_s < one[0] < end_s]
            if not (before and after) or place == 0:
                continue
            other = before[-1]
            first, stop = np.searchsorted(walk.t_s, (begin_s, end_s))
            forward = np.asarray(walk.legs[side].forward_n)[first:stop] / walk.mass_kg
            t_s = walk.t_s[first:stop]
            feet = [np.asarray(walk.legs[leg].position_m)[first] for leg in (side, OTHER[side])]
            found[side, begin_s] = {
                "step_s": begin_s - other[0],
                "stance_s": end_s - begin_s,
                "swing_s": begin_s - own[place - 1][1],
                "double_support_s": other[1] - begin_s + end_s - after[0][0],
                "step_length_m": feet[0] - feet[1],
                "propulsion_impulse_n_s_kg": np.trapezoid(np.maximum(forward, 0), t_s),
                "braking_impulse_n_s_kg": np.trapezoid(np.maximum(-forward, 0), t_s),
                "propulsion_n_kg": filtfilt(b, a, forward)[len(forward) // 2 :].max(),
            }
    for (side, begin_s), figures in found.items():
        earlier = [at_s for leg, at_s in found if leg != side and at_s < begin_s]
        if not earlier or begin_s - max(earlier) > 2.5:
            continue
        earlier_figures = found[OTHER[side], max(earlier)]
        for name, what in (
            ("stance_ratio", "stance_s"),
            ("swing_ratio", "swing_s"),
            ("step_time_ratio", "step_s"),
            ("step_length_ratio", "step_length_m"),
        ):
            figures[name] = figures[what] / earlier_figures[what]
        impulses = [one["propulsion_impulse_n_s_kg"] for one in (figures, earlier_figures)]
        figures["propulsion_share"] = impulses[0] / sum(impulses)
    return found


@pytest.mark.parametrize(
    ("name", "median", "most"),
    [  # of the distance to numpy's, in the measure's unit or as a ratio; most: of 90 % of strides
        ("step_s", 0.01, 0.02),
        ("stance_s", 0.012, 0.02),
        ("swing_s", 0.012, 0.02),
        ("double_support_s", 0.022, 0.03),
        ("step_length_m", 0.002, 0.005),
        ("propulsion_n_kg", 0.03, 0.06),
        ("propulsion_impulse_n_s_kg", 0.004, 0.009),
        ("braking_impulse_n_s_kg", 0.004, 0.009),
        ("propulsion_share", 0.003, 0.012),
        ("stance_ratio", 0.01, 0.03),
        ("swing_ratio", 0.02, 0.05),
        ("step_time_ratio", 0.012, 0.03),
        ("step_length_ratio", 0.005, 0.02),
    ],
)
def test_against_numpy_alone(name, median, most):
    _, strides = open_walk()
    distances, sizes = [], []
    for (side, begin_s), expected in measure_by_numpy().items():
        near = [
            s
            for s in strides
            if s.side == side and s.valid and abs(s.initial_contact_s - begin_s) < 0.05
        ]
        if near and name in expected and getattr(near[0], name) is not None:
            distances.append(abs(getattr(near[0], name) - expected[name]))
            sizes.append(expected[name])
    print(
        f"\n{name}: {len(distances)} strides, {np.median(sizes):.3f}; off by "
        f"{np.median(distances):.4f} (median), {np.percentile(distances, 90):.4f} (of 90 %)"
    )
    assert len(distances) > 60
    assert np.median(distances) < median
    assert np.percentile(distances, 90) < most


def test_all_of_them_travel_with_a_step():
    _, strides = open_walk()
    whole = next(s for s in strides[10:] if s.valid)
    extra = to_measurement(whole, 1, Side.LEFT).extra
    assert {"propulsion_share", "stance_ratio", "braking_impulse_n_s_kg"} <= extra.keys()
    assert len(extra) <= MAX_EXTRA


def test_steps_are_compared_with_the_other_legs_newest_alone():
    """Somebody who stood between two steps is not asymmetric."""
    walk, _ = open_walk()
    t_s = np.where(walk.t_s > 30, walk.t_s + 4.0, walk.t_s)
    strides = measure_strides(t_s, walk.legs, rate_hz=100, mass_kg=walk.mass_kg)
    after = [s for s in strides if s.initial_contact_s > 34.0]
    assert after[0].stance_ratio is None
    assert all(s.stance_ratio is not None for s in after[3:10] if s.valid)
