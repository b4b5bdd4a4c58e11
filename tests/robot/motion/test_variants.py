"""Every variant of every pool: seen at its least, short, and home on late bases."""

import math

import pytest

from robot.bases.kinematic import Imperfections
from robot.behavior.cue import QUIET_PACE
from robot.motion.dry_run import dry_run
from robot.motion.gesture_variants import POOLS, VARIANTS, variants
from robot.motion.limits import REACH_M
from robot.motion.path import Drive, plan_path
from robot.motion.pose import HOME
from tests.support.gesture_runs import play_in_a_row
from tests.support.variants import SHOWN, at_level, levels_of


def late_cases():
    """Return each variant on the latest base; some on one that answers at once, and all between."""
    cases = []
    for name in VARIANTS:
        for dead_time_s in (0.0, 0.25, 0.05, 0.1, 0.15, 0.2):
            is_usual = dead_time_s == 0.25 or (dead_time_s == 0 and name in SHOWN)
            marks = () if is_usual else pytest.mark.long
            cases.append(pytest.param(name, dead_time_s, marks=marks))
    return cases


@pytest.mark.parametrize(("name", "dead_time_s"), late_cases())
def test_it_ends_at_home_on_a_base_that_nobody_has_measured(name, dead_time_s):
    faults = Imperfections(dead_time_s, 0.06, left_scale=0.98, drift_deg_min=3.0)
    for played in play_in_a_row(VARIANTS[name], faults, times=2):
        assert played.outcome == "done"
        assert played.away_m < 0.02
        assert played.turned_deg < 2
        assert played.took_s <= 4.5


@pytest.mark.parametrize("name", VARIANTS)
def test_it_is_seen_at_its_least_and_short(name):
    gesture = VARIANTS[name]
    for level in levels_of(name):
        sized, pace = at_level(gesture, level)
        played = dry_run(sized, pace=pace)
        headings_rad = [pose.heading_rad for pose in played.poses]
        assert played.outcome == "done"
        assert played.took_s <= 4.2
        swept_rad = max(headings_rad) - min(headings_rad)
        assert played.farthest_m >= 0.10 or swept_rad >= math.radians(45)


@pytest.mark.parametrize("name", VARIANTS)
def test_its_motion_tells_what_it_means(name):
    """Two viewers read no motion before: joy and disappointment both turned aside, once."""
    pool, gesture = name.rpartition("_")[0], VARIANTS[name]
    turns = [waypoint.heading_rad for waypoint in gesture.waypoints]
    paces = [waypoint.pace for waypoint in gesture.waypoints]
    if pool in {"joy", "streak_3", "streak_5", "streak_10", "comeback"}:
        assert min(turns) < 0 < max(turns)
        assert min(paces) >= 0.9
    elif pool == "disappointment":
        assert min(turns) == 0 or max(turns) == 0
        assert max(map(abs, turns)) >= math.radians(58)
        assert max(paces) <= 0.7
        assert gesture.reach_m == 0
    elif pool == "greeting":
        assert gesture.reach_m >= 0.105
    elif pool == "rest":
        assert gesture.turn_rad == 0
        assert max(paces) <= 0.6


def test_no_variant_goes_far_or_out_backwards():
    for gesture in VARIANTS.values():
        farthest_m, start = 0.0, HOME
        for waypoint in gesture.waypoints:
            there_m = waypoint.pose.distance_m(HOME)
            assert there_m <= REACH_M
            for leg in plan_path(start, waypoint.pose):
                if isinstance(leg, Drive) and leg.by_m < 0:
                    assert there_m < farthest_m  # the way it came
            farthest_m, start = max(farthest_m, there_m), waypoint.pose


def test_pools_hold_enough_variants_and_no_two_of_a_pool_move_alike():
    for name, pool in POOLS.items():
        motions = {
            tuple((w.x_m, w.heading_rad, w.pace, w.hold_s) for w in one.waypoints) for one in pool
        }
        assert len(motions) == len(pool) >= 8, name
        assert len(variants(name, QUIET_PACE)) >= 8, name
