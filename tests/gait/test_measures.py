"""Measures beside A2 that stroke labs train, each against numpy alone on a recorded walk.

The recorded walk is moore2013's (43 strides a leg, belt speed 0.8 m/s): contacts where the force
crosses 20 N, impulses of the unfiltered forward force, its peak below 20 Hz, lengths of the feet's
positions. Of 71 strides some had late samples, which numpy leaves where their stamps are.
"""

import re
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.signal import butter, filtfilt

from rehab.gait import LegSamples, TwoLegDetector, measure_strides
from rehab.gait.recordings.column_mapping import CHANNELS, SIGNAL_LAYOUTS
from rehab.gait.recordings.readers import read_any_table
from rehab.sources.intake.measurements import to_measurement
from rehab.training.measures import PLATE_MEASURES
from rehab.training.scoring import judge
from rehab.training.steps import Side, select_value
from robot.wire.limits import MAX_EXTRA
from tests.gait.corpus import (
    PLUG_IN_GAIT,
    CorpusWalk,
    find_clean,
    find_stances,
    open_corpus,
    read_lab_file,
)
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
            columns[f"{side.title()}Foot_y"],
            columns["COM_x"],  # there are no hips in it; both are the body's center
            columns["COM_y"],
            columns[f"{side.title()}KneeFlexionAngle"],
        )
        for side, walk_leg in (("left", walk.left), ("right", walk.right))
    }
    strides = measure_strides(walk.t_s, legs, rate_hz=100, mass_kg=walk.mass_kg)
    return CorpusWalk("moore2013", walk.t_s, legs, walk.mass_kg, False), strides


@cache
def open_gaitalytics():
    """Return the treadmill walk of another person and system, and its measured strides."""
    pytest.importorskip("ezc3d")
    walk = add_own(open_corpus("gaitalytics treadmill"), "gaitalytics treadmill")
    return walk, walk.measure()


def add_own(walk, name):
    """Return a walk with what plates and markers of its file come to."""
    table = read_any_table(read_lab_file(PLUG_IN_GAIT[name]))
    columns = SIGNAL_LAYOUTS["garry"].legs
    legs = {
        side: leg._replace(**{
            field: table[f"own.{columns[side][channel].name}"]
            for channel, field in zip(CHANNELS[3:], LegSamples._fields[3:], strict=True)
        })
        for side, leg in walk.legs.items()
    }  # fmt: skip
    return replace(walk, legs=legs)


WALKS = {"moore2013": open_walk, "gaitalytics": open_gaitalytics}


@cache
def measure_by_numpy(name):
    """Return for each stance, by side and begin, its figures by name."""
    walk, _ = WALKS[name]()
    stances = {side: find_stances(walk, side) for side in SIDES}
    b, a = butter(2, 20 / (walk.rate_hz / 2))
    belt_m_s = read_moore_columns()["LeftBeltSpeed"].mean()
    slow = butter(2, 6 / (walk.rate_hz / 2))
    velocity_m_s = np.gradient(filtfilt(*slow, walk.legs["left"].hip_forward_m), walk.t_s)
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
            leg = walk.legs[side]
            forward = np.asarray(leg.forward_n)[first:stop] / walk.mass_kg
            swing = slice(*np.searchsorted(walk.t_s, (own[place - 1][1], begin_s)))
            late = slice((first + stop) // 2, stop)
            ahead_m, up_m = leg.hip_forward_m - leg.position_m, leg.hip_up_m - leg.foot_up_m
            limb = np.arctan2(ahead_m[late], up_m[late])
            pendulum_hz = np.sqrt(9.81 / leg.hip_up_m[first])
            center = leg.hip_forward_m + (velocity_m_s + belt_m_s) / pendulum_hz
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
                "trailing_limb_deg": np.degrees(limb.max()),
                "knee_flexion_deg": np.degrees(leg.knee_angle_rad[swing].max()),
                "margin_m": center[first] - leg.position_m[first],
                "propulsion_n_kg": filtfilt(b, a, forward)[len(forward) // 2 :].max(),
            }
    for (side, begin_s), figures in found.items():
        earlier = [at_s for leg, at_s in found if leg != side and at_s < begin_s]
        if not earlier or begin_s - max(earlier) > 2.5:
            continue
        earlier_figures = found[OTHER[side], max(earlier)]
        for name, what in (
            ("stance_ratio_percent", "stance_s"),
            ("swing_ratio_percent", "swing_s"),
            ("step_time_ratio_percent", "step_s"),
            ("step_length_ratio_percent", "step_length_m"),
        ):
            figures[name] = 100 * figures[what] / earlier_figures[what]
        two = [figures, earlier_figures]
        cadence = 60 / np.mean([one["step_s"] for one in two])
        length_mm = 1000 * np.mean([one["step_length_m"] for one in two])
        figures["walking_ratio_mm_min"] = length_mm / cadence
        impulses = [one["propulsion_impulse_n_s_kg"] for one in (figures, earlier_figures)]
        figures["propulsion_percent"] = 100 * impulses[0] / sum(impulses)
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
        ("propulsion_percent", 0.3, 1.2),
        ("stance_ratio_percent", 1.0, 3.0),
        ("swing_ratio_percent", 2.0, 5.0),
        ("step_time_ratio_percent", 1.2, 3.0),
        ("step_length_ratio_percent", 0.5, 2.0),
        ("trailing_limb_deg", 0.2, 0.5),
        ("knee_flexion_deg", 0.2, 0.4),
        ("walking_ratio_mm_min", 0.05, 0.1),
        ("margin_m", 0.005, 0.01),
    ],
)
def test_against_numpy_alone(name, median, most):
    found = compare("moore2013", name)
    assert len(found) > 60
    assert np.median(found) < median
    assert np.percentile(found, 90) < most


@pytest.mark.parametrize(
    ("name", "median"),
    [
        ("step_s", 0.004),
        ("stance_s", 0.006),
        ("swing_s", 0.006),
        ("double_support_s", 0.008),
        ("step_length_m", 0.003),
        ("propulsion_n_kg", 0.03),
        ("propulsion_impulse_n_s_kg", 0.004),
        ("braking_impulse_n_s_kg", 0.004),
        ("propulsion_percent", 1.0),
        ("step_time_ratio_percent", 0.8),
        ("step_length_ratio_percent", 0.8),
        ("walking_ratio_mm_min", 0.05),
    ],
)
def test_of_another_person_and_system_against_numpy_alone(name, median):
    """gaitalytics, whose other foot often steps on both plates: the valid strides."""
    found = compare("gaitalytics", name)
    assert len(found) >= 3
    assert np.median(found) < median


def test_no_step_is_compared_with_one_of_both_feet():
    """Its stance is that of two feet: the ratio would be 65 %."""
    _, strides = open_gaitalytics()
    after = next(one for one in strides if abs(one.initial_contact_s - 2.35) < 0.05)
    crossed = next(one for one in strides if abs(one.initial_contact_s - 1.76) < 0.05)
    assert after.valid
    assert not crossed.valid
    assert after.stance_ratio_percent is None
    ratios = [one.stance_ratio_percent for one in strides if one.valid and one.stance_ratio_percent]
    assert all(85 < ratio < 115 for ratio in ratios)


def compare(walk, name):
    """Return the distances of a figure to numpy's, of the valid strides of a walk."""
    _, strides = WALKS[walk]()
    distances, sizes = [], []
    for (side, begin_s), expected in measure_by_numpy(walk).items():
        near = [
            s
            for s in strides
            if s.side == side and s.valid and abs(s.initial_contact_s - begin_s) < 0.05
        ]
        if near and name in expected and getattr(near[0], name) is not None:
            distances.append(abs(getattr(near[0], name) - expected[name]))
            sizes.append(expected[name])
    print(
        f"\n{walk}, {name}: {len(distances)} strides, {np.median(sizes):.3f}; off by "
        f"{np.median(distances):.4f} (median), {np.percentile(distances, 90):.4f} (of 90 %)"
    )
    return distances


@pytest.mark.parametrize("size", [7, 100])
def test_chunks_do_not_matter(size):
    walk, strides = open_walk()
    detector = TwoLegDetector(100, walk.mass_kg, look_ahead_s=0.05)
    found = []
    for first in range(0, len(walk.t_s), size):
        part = slice(first, first + size)
        legs = [LegSamples(*(row[part] for row in walk.legs[side])) for side in SIDES]
        found += detector.feed(walk.t_s[part], *legs)
    assert found + detector.finish() == strides


def measure_posture(walk, table, side, begin_s, end_s):
    """Return a stride's posture by Plug-in Gait's joints and knee angle, with numpy alone."""

    def read(name):
        return np.array([table[f"{name}.{axis}"] for axis in "XYZ"]) / 1000

    def differentiate(values):
        smooth = filtfilt(*butter(2, 6 / (walk.rate_hz / 2)), np.nan_to_num(values))
        return np.gradient(smooth, walk.t_s)

    own = side[0].upper()
    feet = [read(f"{letter}TOE") - read(f"{letter}HEE") for letter in "LR"]
    ahead = np.append(np.nanmean(sum(feet)[:2], axis=1), 0)
    ahead /= np.linalg.norm(ahead)
    first, stop = np.searchsorted(walk.t_s, (begin_s, end_s))
    hip, ankle, heel = (read(own + name) for name in ("FEP", "TIO", "HEE"))
    line = (hip - ankle)[:, (first + stop) // 2 : stop]
    middle = (read("LFEP") + read("RFEP")) / 2
    flat = slice(*(int(first + share * (stop - first)) for share in (0.2, 0.45)))
    belt_m_s = -np.median(differentiate(ahead @ heel)[flat])
    speed_m_s = differentiate(ahead @ middle)[first] + belt_m_s
    center_m = (ahead @ middle)[first] + speed_m_s * np.sqrt(middle[2, first] / 9.81)
    knee = table[next(n for n in table if re.fullmatch(rf"{own}KneeAnglesV?\.X", n))]
    return {
        "trailing_limb_deg": np.degrees(np.arctan2(ahead @ line, line[2]).max()),
        "margin_m": center_m - (ahead @ ankle)[first],
        "knee_flexion_deg": np.nanmax(knee[max(0, first - int(0.45 * walk.rate_hz)) : first]),
    }


@pytest.mark.parametrize("name", PLUG_IN_GAIT)
def test_posture_of_other_people_against_plug_in_gait(name):
    pytest.importorskip("ezc3d")
    walk, table = open_corpus(name), read_any_table(read_lab_file(PLUG_IN_GAIT[name]))
    strides = add_own(walk, name).measure()
    fields = ("trailing_limb_deg", "margin_m", "knee_flexion_deg")
    distances: dict[str, list[float]] = {field: [] for field in fields}
    for clean in find_clean(walk):
        expected = measure_posture(walk, table, clean.side, clean.begin_s, clean.end_s)
        (stride,) = [
            s
            for s in strides
            if s.side == clean.side and abs(s.terminal_contact_s - clean.end_s) < 0.05
        ]
        for field, value in expected.items():
            if getattr(stride, field) is not None:
                distances[field].append(abs(getattr(stride, field) - value))
    for field, most in (("trailing_limb_deg", 0.5), ("margin_m", 0.02), ("knee_flexion_deg", 2.5)):
        found = distances[field]
        print(f"\n{name}, {field}: {len(found)} strides, off by {np.max(found, initial=0):.3f}")
        assert all(one < most for one in found)
    assert distances["trailing_limb_deg"]
    assert distances["margin_m"]


def test_all_of_them_travel_with_a_step():
    _, strides = open_walk()
    whole = next(s for s in strides[10:] if s.valid)
    extra = to_measurement(whole, 1, Side.LEFT).extra
    assert {"propulsion_percent", "stance_ratio_percent", "braking_impulse_n_s_kg"} <= extra.keys()
    assert len(extra) <= MAX_EXTRA


@pytest.mark.parametrize("measure", PLATE_MEASURES, ids=lambda one: one.slug)
def test_each_is_a_measure_that_can_be_trained(measure):
    """A healthy walk has it, within its bounds, near the first goal."""
    _, strides = open_walk()
    steps = [to_measurement(s, n, Side.LEFT) for n, s in enumerate(strides, start=1) if s.valid]
    values = [select_value(step, measure).value for step in steps]
    known = [value for value in values if value is not None]
    assert len(known) > 0.9 * len(values)
    assert all(measure.value_min <= value <= measure.value_max for value in known)
    performance = judge(measure, float(np.median(known)), 1.0, measure.first_goal).performance
    assert 0.7 < performance < 1.4


def test_steps_are_compared_with_the_other_legs_newest_alone():
    """Somebody who stood between two steps is not asymmetric."""
    walk, _ = open_walk()
    t_s = np.where(walk.t_s > 30, walk.t_s + 4.0, walk.t_s)
    strides = measure_strides(t_s, walk.legs, rate_hz=100, mass_kg=walk.mass_kg)
    after = [s for s in strides if s.initial_contact_s > 34.0]
    assert after[0].stance_ratio_percent is None
    assert all(s.stance_ratio_percent is not None for s in after[3:10] if s.valid)
