"""The limits by which strides are refused, measured on the clean strides of five people or six.

Each lies beyond what all of them reach by the margin that is named here, so that another one may
differ from them by as much again.
"""

from __future__ import annotations

import ast
import math
from collections import defaultdict
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from rehab.gait import GaitInputError, two_legs
from rehab.gait.one_leg import GRAVITY_M_S2
from rehab.gait.recordings.readers import read_any_table
from rehab.gait.settings import check_rate
from rehab.gait.setup import units
from rehab.gait.signals.filters import find_last
from rehab.gait.stances import analysis, continuity, plausibility
from rehab.gait.stances.analysis import StanceAnalyzer
from rehab.gait.stances.lag_watch import (
    BRAKING_S,
    MOMENT_LAG_S,
    BrakingFinder,
    LagWatch,
    find_moment_lag,
)
from tests.gait.corpus import (
    PLUG_IN_GAIT,
    PRESENT,
    SIDES,
    find_clean,
    find_stances,
    open_corpus,
    own_legs,
    read_lab_file,
)
from tests.gait.walks import make_walk

pytest.importorskip("ezc3d")


JUMPS = (continuity.MOMENT_JUMP, continuity.ANGLE_JUMP)


def describe(analyzer, contact, stance, push_off, by_steps) -> dict[str, float]:
    """Return the figures of a stance that limits judge."""
    force_n = stance.signals[0] - contact.offset_n
    moment_nm = stance.signals[1]
    begin, end, half = stance.begin, stance.end, stance.index(0.5)
    toes = slice(stance.index(plausibility.LEVER_FROM), end + 1)
    loaded = force_n[toes] > plausibility.LEVER_FORCE * analyzer._weight_n
    late_n, late_nm = force_n[half : end + 1], moment_nm[half : end + 1]
    leaving = find_last(late_n > plausibility.LEAVING_SHARE * late_n.max())
    swing = np.abs(push_off.moment_nm_kg[: begin - round(plausibility.SWING_S * stance.rate_hz)])
    angle = push_off.angle_rad[begin : end + 1]
    last = end - round(plausibility.BACKWARD_S * stance.rate_hz)
    share = (push_off.a2_time_s - stance.begin_s) / (stance.end_s - stance.begin_s)
    lever_m = plausibility._find_lever(late_n, late_nm, int(late_nm.argmax()))
    cut_n = force_n[end - round(plausibility.CUT_S * stance.rate_hz)]
    moment_lag = stance.index(analysis.LATE_FROM) - half
    moved = np.abs(np.diff(stance.signals[1:, begin:end])).max(axis=1)
    moved /= [analyzer._mass_kg, 1.0]
    jumps = [at_once + by_time / stance.rate_hz for at_once, by_time in JUMPS]
    bends = np.abs(np.diff(stance.signals[1:, stance.index(0.55) : end], n=2)).max(axis=1)
    return {
        "force": contact.peak_n / analyzer._weight_n,
        "lever": float((moment_nm[toes][loaded] / force_n[toes][loaded]).max()),
        "lever change": plausibility._find_lever(late_n, late_nm, leaving) / lever_m,
        "cut": cut_n / analyzer._weight_n,
        "moment's lag": find_moment_lag(late_n[moment_lag:], late_nm[moment_lag:], stance.rate_hz),
        "moment's jumps": moved[0] / jumps[0],
        "angle's jumps": moved[1] / jumps[1],
        "moment's bends": bends[0] * stance.rate_hz**2 / continuity.STRAIGHT_TO.item(0),
        "angle's bends": bends[1] * stance.rate_hz**2 / continuity.STRAIGHT_TO.item(1),
        "stance": stance.end_s - stance.begin_s,
        "by steps": by_steps / push_off.a2_w_kg,
        "moment": push_off.moment_peak_nm_kg,
        "moment in swing": float(swing.max()) / push_off.moment_peak_nm_kg,
        "drift": float(np.median(swing)),
        "angle": float(np.ptp(angle)),
        "peak": share,
        "a2": push_off.a2_w_kg,
        "braking": -float(push_off.power_w_kg[push_off.peak : end + 1].min()) / push_off.a2_w_kg,
        "turning": float(push_off.velocity_rad_s[last : end + 1].min())
        / push_off.a2_velocity_rad_s,
    }


@cache
def measure_people() -> dict[str, list[dict[str, float]]]:
    """Return the figures of each clean stride of the corpus, by walk."""
    found = defaultdict(list)
    check = StanceAnalyzer._check_push_off
    with pytest.MonkeyPatch.context() as patch:
        for name in PRESENT:
            walk = open_corpus(name)
            ends_s = np.array([one.end_s for one in find_clean(walk)])

            def watch(analyzer, contact, stance, push_off, *rest, name=name, ends_s=ends_s):
                by_steps = check(analyzer, contact, stance, push_off, *rest)
                if np.abs(ends_s - stance.end_s).min() < 0.05:
                    found[name].append(describe(analyzer, contact, stance, push_off, by_steps))
                return by_steps

            patch.setattr(analysis.StanceAnalyzer, "_check_push_off", watch)
            walk.measure()
    return dict(found)


LEAST, MOST = plausibility.LEVER_CHANGE
LIMITS = {  # the figure, its least and its largest allowed value, and the margin
    "force": (plausibility.FULL_LOAD, plausibility.FORCE_MAX, 1.25),
    "lever": (None, plausibility.LEVER_MAX_M, 1.2),
    "lever change": (LEAST, MOST, 1.1),
    "cut": (None, plausibility.CUT_SHARE, 2),
    "moment's lag": (*MOMENT_LAG_S, 1.5),
    "moment's jumps": (None, 1, 1.8),
    "angle's jumps": (None, 1, 5),
    "moment's bends": (1, None, 5),
    "angle's bends": (1, None, 5),
    "by steps": (None, continuity.SPIKES_SHARE, 3),
    "stance": (plausibility.STANCE_MIN_S, plausibility.STANCE_MAX_S, 3),
    "moment": (plausibility.MOMENT_MIN, plausibility.MOMENT_MAX, 1.9),
    "moment in swing": (None, plausibility.MOMENT_SWING, 9),
    "drift": (None, plausibility.MOMENT_DRIFT, 2.2),
    "angle": (plausibility.ANGLE_RANGE_MIN, plausibility.ANGLE_RANGE_MAX, 4),
    "peak": (plausibility.PEAK_FROM, None, 1.4),
    "a2": (None, plausibility.A2_MAX, 2.4),
    "braking": (None, plausibility.REVERSED_SHARE, 10),
}


@pytest.mark.parametrize("name", LIMITS)
def test_limits_lie_beyond_what_people_reach(name):
    least, most, margin = LIMITS[name]
    people = measure_people()
    assert len(people) == len(PRESENT) >= 5
    values = [one[name] for strides in people.values() for one in strides]
    assert len(values) > 60
    assert least is None or min(values) > margin * least
    assert most is None or max(values) * margin < most


def test_noise_of_unfiltered_angles_is_no_spike():
    """As markers give them: of these, an angle's change exceeds what walking makes by no noise."""
    needed = defaultdict(list)
    judge = continuity._find_limit

    def watch(found, curve, walking, by_walking, at_once, by_noise):
        if at_once == continuity.ANGLE_FOURTH[1]:
            limit = by_walking * walking * np.ptp(curve) + at_once
            needed[name].append((found.max() - limit) / np.median(found))
        return judge(found, curve, walking, by_walking, at_once, by_noise)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(continuity, "_find_limit", watch)
        for name, file in PLUG_IN_GAIT.items():
            walk = open_corpus(name)
            replace(walk, legs=own_legs(read_any_table(read_lab_file(file)))).measure()
    assert len(needed) == 3
    assert max(map(max, needed.values())) < 0 < continuity.ANGLE_FOURTH[2]


@pytest.mark.parametrize(
    ("row", "size", "lost"), [(2, 0.002, 0), (2, 0.005, 0.04), (1, 0.01, 0), (1, 0.03, 0.05)]
)
@pytest.mark.parametrize("name", ["moore2013", "gaitalytics treadmill", "BTK motion3"])
def test_frames_that_stick_out_cost_no_stride_whose_a2_they_do_not_change(name, row, size, lost):
    """One in fifty is off by five times the noise, as markers are: unusual, and no other value."""
    walk, chance = open_corpus(name), np.random.default_rng(0)
    legs = {}
    for side, leg in walk.legs.items():
        rows = [np.asarray(values, dtype=float) for values in leg[:3]]
        frames = np.arange(walk.t_s[0], walk.t_s[-1], 0.01)
        noise = size * 0.6 * chance.normal(size=len(frames))
        noise[chance.random(len(frames)) < 0.02] *= 8
        noise *= walk.mass_kg if row == 1 else 1
        rows[row] = rows[row] + np.interp(walk.t_s, frames, noise)
        legs[side] = type(leg)(*rows)
    found = replace(walk, legs=legs).measure()
    pairs = [
        (one, stride)
        for one in find_clean(walk)
        for stride in found
        if stride.side == one.side and abs(stride.terminal_contact_s - one.end_s) < 0.05
    ]
    assert len(pairs) == len(find_clean(walk))
    shown = [(one, stride) for one, stride in pairs if stride.valid]
    assert len(shown) >= (1 - lost) * len(pairs)
    assert all(abs(stride.a2_w_kg / one.a2_w_kg - 1) < 0.07 for one, stride in shown)


def test_a_spike_that_changes_a2_is_refused_and_another_one_makes_it_less_sure():
    walk, truth = make_walk(rate_hz=100, strides=10, jitter_s=0.0)
    clean = walk.one_leg()

    def strike(size):
        def change(angle):
            for stride in truth:
                angle[np.searchsorted(walk.t_s, stride.terminal_contact_s - 0.06)] += size
            return angle

        return walk.change(2, change).one_leg()

    assert not any(stride.valid for stride in strike(0.15))
    for before, after in zip(clean, strike(0.04), strict=True):
        if before.valid:
            assert after.valid
            off = abs(after.a2_w_kg - before.a2_w_kg)
            assert 0 < off < 0.05 * before.a2_w_kg
            assert after.a2_sd_w_kg > max(before.a2_sd_w_kg, 0.7 * off)


def test_no_ankle_turns_back_before_its_foot_leaves():
    turning = [one["turning"] for strides in measure_people().values() for one in strides]
    assert min(turning) > 0.1 > -plausibility.BACKWARD_SHARE


@cache
def measure_usual() -> dict[str, dict[str, list[float]]]:
    """Return what is usual of each leg's stances, by figure and walk, from the corpus alone."""
    found: dict[str, dict[str, list[float]]] = defaultdict(lambda: defaultdict(list))
    for name in PRESENT:
        walk = open_corpus(name)
        weight_n = walk.mass_kg * GRAVITY_M_S2
        for one in find_clean(walk):
            leg = [np.asarray(row, dtype=float) for row in walk.legs[one.side][:3]]
            part = slice(*np.searchsorted(walk.t_s, (one.begin_s, one.end_s)))
            force, moment, angle = (row[part] for row in leg)
            top = int(moment.argmax())
            figures = {
                "force": force.mean() / weight_n,
                "lever": moment[top] / force[top],
                "range": np.ptp(angle),
                "braking": BrakingFinder().find(walk.t_s, leg[2], one.end_s),
            }
            if len(walk.legs) == 2:
                others = find_stances(walk, SIDES[one.side == "left"])
                off = [end_s for begin_s, end_s in others if begin_s < one.begin_s < end_s]
                on = [begin_s for begin_s, end_s in others if begin_s < one.end_s < end_s]
                if off and on:
                    figures["alone"] = (on[0] - off[0]) / (one.end_s - one.begin_s)
            for figure, value in figures.items():
                if value is not None:
                    found[figure][name].append(float(value))
    return found


def spread(middle: float, width: float) -> tuple[float, float]:
    return middle * math.exp(-width), middle * math.exp(width)


USUAL = {  # what is only told, with the least and the largest of each person's median
    "force": spread(units.STANCE_LOAD, units.FORCE_SPREAD),
    "lever": spread(units.LEVER_M, units.LEVER_SPREAD),
    "range": spread(units.ANGLE_RAD, units.ANGLE_SPREAD),
    "braking": BRAKING_S,
    "alone": (0.0, plausibility.ALONE_MAX),
}


@pytest.mark.parametrize("figure", USUAL)
def test_what_is_called_usual_holds_for_all_of_them(figure):
    least, most = USUAL[figure]
    medians = {name: float(np.median(values)) for name, values in measure_usual()[figure].items()}
    print(f"\n{figure}: {medians}")
    assert len(medians) >= 3
    assert all(least < value < most for value in medians.values()), medians


RESTS_ON = {  # what each number of these modules rests on, that is no limit of people above
    "people, by other tests": """
        lag_watch.PACE_S plausibility.BACKWARD_RAD_S plausibility.BACKWARD_SHARE shapes.KNEE_LEAD
        plausibility.CLONUS_RAD_S plausibility.CLONUS_TURNS plausibility.CLONUS_TO
        own_kinetics.USUAL_GAIN own_kinetics.USUAL_LAG_S unloaded.FOOT_NM_KG unloaded.USUAL_NM_KG
        unloaded.USUAL_LOAD shapes.SHAPES shapes.LIKE shapes.NAMED_LIKE find_columns.CERTAIN_LIKE
        find_columns.CERTAIN_LEAD find_columns.OTHER_PLANE check.MOMENT_TOLERANCE_S
        continuity.ANGLE_FOURTH continuity.MOMENT_STEP leg_checks.USUAL_MOMENT
        leg_checks.USUAL_A2""",
    "this person's own strides": """
        one_leg.USUAL_STANCES one_leg.USUAL_MIN one_leg.USUAL_MAX lag_watch.STRIDES
        lag_watch.OWN_STRIDES lag_watch.DRIFT_MAX_S lag_watch.DRIFT_SCATTERS lag_watch.DRIFT_MOST_S
        lag_watch.SLOPE_STRIDES lag_watch.SLOPE_LEAST lag_watch.SLOPE_ERRORS
        lag_watch.SLOPE_MOVED_S lag_watch.SCATTER_S lag_watch.SCATTER_WEIGHT continuity.SPIKES_SHARE
        checks.OWN_TOLERANCE_S leg_checks.OFTEN""",
    "mechanics: plates carry a body, a foot is no longer than a shoe": """
        plausibility.WEIGHT_MIN plausibility.WEIGHT_MAX plausibility.SUPPORTED_BELOW
        plausibility.LOAD_MIN plausibility.LOAD_MAX
        checks.WEIGHT_ABOVE checks.CERTAIN_LOAD one_leg.GRAVITY_M_S2
        limb.GRAVITY_M_S2 kinetics.COP_FORCE_N kinetics.COP_REACH_M contact_finder.STEP_PEAK
        contact_finder.CERTAIN contact_finder.BOUNCE_S contact_finder.STUCK_S
        contact_finder.SHORTEST_S one_leg.STRIDE_MAX_S two_legs.LATEST_S shapes.STANCE_S
        unloaded.CERTAIN find_forces.SWING find_forces.NO_FORCE find_forces.LOADED
        find_forces.STEPS_MIN drag.HIDDEN contact_finder.DRAG_S""",
    "sensors and how they send": """
        continuity.RATE_TOLERANCE continuity.MOMENT_FROZEN_S continuity.ANGLE_FROZEN_S
        continuity.STRAIGHT_S gaps.GAP_S gaps.GAP_MAX_S gaps.LATE_SAMPLE_S gaps.CERTAIN gaps.MOST
        one_leg.LONGEST_GAP_S one_leg.OFFSET_N contact_finder.CONTACT_N contact_finder.RELEASE_N
        zero.OFFSET_MAX zero.OFFSET_SWINGS zero.ZERO_STEP_N zero.ZERO_SWINGS zero.ZERO_SPREAD_N
        zero.LEAST_N zero.QUIET_N drag.REST_N drag.DIP_N uncertainty.THIRD_DIFFERENCE
        uncertainty.PUT_BACK_S units.FORCE_UNITS units.MOMENT_UNITS units.ANGLE_UNITS names.SIGNS
        units.MASS_USUAL_KG check.SAME_FACTOR""",
    "how it is computed; nothing is refused by it": """
        analysis.BEFORE_S analysis.LONGEST_S analysis.DECIMATED_HZ analysis.FORWARD_HZ
        analysis.LATE_FROM continuity.APART_S continuity.WHOLE continuity.SPIKE
        continuity.MOMENT_TO_S gaps.HARMFUL_FROM gaps.AROUND_S gaps.AROUND_SAMPLES gaps.ORDER
        kinetics.PUSH_OFF_FROM kinetics.STOP_S kinetics.TURN_S kinetics.BEYOND_S kinetics.SLOPE_S
        lag_watch.SEARCH_S lag_watch.SETTLE_S lag_watch.AROUND_S lag_watch.GRID_HZ
        lag_watch.CUTOFF_HZ lag_watch.HALF lag_watch.BRAKING_MIN_RAD_S2 limb.QUIET_S limb.FLAT
        limb.AROUND_S plausibility.CUT_S plausibility.LEVER_FROM plausibility.LEVER_FORCE
        plausibility.LEAVING_SHARE plausibility.BACKWARD_S plausibility.SWING_S
        resampling.MIN_STANCE_SAMPLES uncertainty.AHEAD_SHARE uncertainty.AHEAD_DECAY_S
        uncertainty.USUAL_DRIFT_S one_leg.KEEP_S one_leg.LONGEST_CHUNK_S contact_finder.LOOK_BACK_S
        contact_finder.LOOK_EVERY_S contact_finder.BLOCK_S contact_finder.AROUND_S zero.SWING_S
        drag.REST_S drag.LEVEL_S drag.DIP_S drag.QUIET_S drag.SLOPE_N drag.BEYOND_S lag.SEARCH_S
        lag.STRIDES_MIN unloaded.STRIDES_MIN unloaded.SWING unloaded.ALONE check.STRIDES_MIN
        own_kinetics.LAGS_S own_kinetics.GRID_S shapes.POINTS shapes.STANCE shapes.LOADED
        shapes.STRIDES_MOST shapes.SEEN shapes.SHIFT""",
}
MEASURED = """
    plausibility.FULL_LOAD plausibility.FORCE_MAX plausibility.LEVER_MAX_M plausibility.LEVER_CHANGE
    plausibility.CUT_SHARE lag_watch.MOMENT_LAG_S continuity.MOMENT_JUMP continuity.ANGLE_JUMP
    continuity.STRAIGHT_TO plausibility.STANCE_MIN_S plausibility.STANCE_MAX_S
    plausibility.MOMENT_MIN plausibility.MOMENT_MAX plausibility.MOMENT_SWING
    plausibility.MOMENT_DRIFT plausibility.ANGLE_RANGE_MIN plausibility.ANGLE_RANGE_MAX
    plausibility.PEAK_FROM plausibility.A2_MAX plausibility.REVERSED_SHARE units.STANCE_LOAD
    units.FORCE_SPREAD units.LEVER_M units.LEVER_SPREAD units.ANGLE_RAD units.ANGLE_SPREAD
    lag_watch.BRAKING_S plausibility.ALONE_MAX"""


def find_numbers() -> set[str]:
    """Return the names of all numbers at the top of the modules that judge strides and set-ups."""
    root = Path(two_legs.__file__).parent
    folders = ("stances", "contacts", "selfcheck", "setup")
    files = [file for folder in folders for file in root.glob(f"{folder}/*.py")]
    found = set()
    for file in [*files, root / "one_leg.py", root / "two_legs.py"]:
        for node in ast.parse(file.read_text()).body:
            if isinstance(node, ast.Assign | ast.AnnAssign) and node.value is not None:
                targets = node.targets if isinstance(node, ast.Assign) else [node.target]
                names = [one.id for top in targets for one in ast.walk(top) if hasattr(one, "id")]
                inside = [getattr(one, "value", None) for one in ast.walk(node.value)]
                if any(isinstance(one, int | float) for one in inside):
                    found |= {f"{file.stem}.{name}" for name in names if name.isupper()}
    return {name for name in found if not name.split(".")[1].startswith("_")}


def test_each_number_rests_on_something_named():
    named = [name for names in (MEASURED, *RESTS_ON.values()) for name in names.split()]
    assert sorted(named) == sorted(find_numbers())  # each once


@pytest.mark.parametrize(("stance_s", "is_beyond"), [(0.7, True), (0.9, True), (2.2, False)])
def test_lags_are_judged_by_the_pace_of_a_stance(stance_s, is_beyond):
    """Of 40 ms: who takes twice the time for a stance takes it for what happens in it."""
    watch = LagWatch(MOMENT_LAG_S)
    watch.add(0.04, stance_s)
    assert (watch.beyond_s > 0) is is_beyond


def test_fifty_samples_a_second_by_stamps_are_enough():
    check_rate(49.9)
    with pytest.raises(GaitInputError):
        check_rate(45.0)
