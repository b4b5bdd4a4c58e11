"""The limits by which strides are refused, measured on the clean strides of five people or six.

Each lies beyond what all of them reach by the margin that is named here, so that another one may
differ from them by as much again.
"""

from __future__ import annotations

from collections import defaultdict
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from rehab.gait import GaitInputError
from rehab.gait.recordings.readers import read_any_table
from rehab.gait.settings import check_rate
from rehab.gait.signals.filters import find_last
from rehab.gait.stances import analysis, continuity, plausibility
from rehab.gait.stances.analysis import StanceAnalyzer
from rehab.gait.stances.lag_watch import MOMENT_LAG_S, LagWatch, find_moment_lag
from tests.gait.corpus import (
    PLUG_IN_GAIT,
    PRESENT,
    find_clean,
    open_corpus,
    own_legs,
    read_lab_file,
)

pytest.importorskip("ezc3d")


def describe(analyzer, contact, stance, push_off) -> dict[str, float]:
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
    jump_rad = continuity.ANGLE_JUMP[0] + continuity.ANGLE_JUMP[1] / stance.rate_hz
    return {
        "force": contact.peak_n / analyzer._weight_n,
        "lever": float((moment_nm[toes][loaded] / force_n[toes][loaded]).max()),
        "lever change": plausibility._find_lever(late_n, late_nm, leaving) / lever_m,
        "cut": cut_n / analyzer._weight_n,
        "moment's lag": find_moment_lag(late_n[moment_lag:], late_nm[moment_lag:], stance.rate_hz),
        "angle's jumps": float(np.abs(np.diff(stance.signals[2, begin:end])).max()) / jump_rad,
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
                if np.abs(ends_s - stance.end_s).min() < 0.05:
                    found[name].append(describe(analyzer, contact, stance, push_off))
                return check(analyzer, contact, stance, push_off, *rest)

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
    "angle's jumps": (None, 1, 1.5),
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
    judge = continuity._is_discontinuous

    def watch(found, curve, walking, by_walking, at_once, by_noise):
        if at_once == continuity.ANGLE_FOURTH[1]:
            limit = by_walking * walking * np.ptp(curve) + at_once
            needed[name].append((found.max() - limit) / np.median(found))
        return judge(found, curve, walking, by_walking, at_once, by_noise)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(continuity, "_is_discontinuous", watch)
        for name, file in PLUG_IN_GAIT.items():
            walk = open_corpus(name)
            replace(walk, legs=own_legs(read_any_table(read_lab_file(file)))).measure()
    assert len(needed) == 3
    assert max(map(max, needed.values())) < 0 < continuity.ANGLE_FOURTH[2]


def test_no_ankle_turns_back_before_its_foot_leaves():
    turning = [one["turning"] for strides in measure_people().values() for one in strides]
    assert min(turning) > 0.1 > -plausibility.BACKWARD_SHARE


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
