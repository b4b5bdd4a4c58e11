"""Outcomes of sessions, differences between arms, and the figures of them: all pure."""

from __future__ import annotations

from xml.etree import ElementTree as ET

import numpy as np
import pytest
from scipy import stats

from rehab.studies.analysis.comparison import compare
from rehab.studies.analysis.curves import CurvePlace, average
from rehab.studies.analysis.outcomes import OF_STRIDES, channel_changes, describe_phases
from rehab.studies.analysis.participants import (
    ParticipantVisit,
    curves_by_arm,
    find,
    flow,
    make_participant,
)
from rehab.studies.analysis.walks import read_walk
from rehab.studies.figures.learning import CurveLabels, PhaseLabel, draw_curves
from rehab.studies.figures.people import draw_people
from rehab.studies.simulation.example import example_trial
from rehab.studies.simulation.trial import simulate
from rehab.training.phases import make_phase

PHASES = (
    make_phase("baseline", strides=50),
    make_phase("training", strides=100, gain=0.9),
    make_phase("catch", strides=10),
    make_phase("washout", strides=40),
)


def walk_of(
    *levels: float,
    goal: float = 2.0,
    higher_is_better: bool = True,
    invalid: frozenset[int] = frozenset(),
):
    """Return a walk at a level in each phase, each stride apart by a little that cancels out."""
    rows, number = [], 0
    for index, (phase, level) in enumerate(zip(PHASES, levels, strict=True)):
        for stride in range(phase.strides):
            number += 1
            value = level + (0.1 if stride % 2 else -0.1)
            valid = number not in invalid
            performance = phase.gain * value / goal if valid and phase.feedback else None
            hit = None if performance is None else performance >= 1
            extra = {"grf": 10 * value}
            rows.append(
                (index, float(number), value, phase.gain, goal, performance, hit, valid, extra)
            )
    return read_walk(PHASES, rows, higher_is_better=higher_is_better)


def outcome(slug, walk, before=None):
    return OF_STRIDES[slug].compute(walk, before)


def test_changes_are_in_percent_of_the_baseline_of_the_same_session():
    walk = walk_of(2.0, 2.5, 2.2, 2.1)
    assert walk.baseline == pytest.approx(2.0)
    assert outcome("early_change", walk) == pytest.approx(25)
    assert outcome("late_change", walk) == pytest.approx(25)
    assert outcome("catch_change", walk) == pytest.approx(10)
    assert outcome("washout_change", walk) == pytest.approx(5)
    assert outcome("after_effect", walk) == pytest.approx(5)
    assert channel_changes(walk) == {"grf": pytest.approx(25)}


def test_less_is_better_where_the_measure_says_so():
    assert outcome("late_change", walk_of(2.0, 1.5, 2, 2, higher_is_better=False)) == pytest.approx(
        25
    )


def test_the_real_value_and_what_was_shown_are_told_apart():
    walk = walk_of(2.0, 2.5, 2.0, 2.0)
    assert outcome("percent_of_goal", walk) == pytest.approx(125)
    training = describe_phases(walk)[1]
    assert training["shown_percent_of_goal"] == pytest.approx(112.5)
    assert training["real_percent_of_goal"] == pytest.approx(125)
    assert outcome("absolute_error", walk) == pytest.approx(12.5)


def test_success_comes_with_the_first_window_of_enough_hits():
    assert outcome("strides_to_success", walk_of(2.0, 3.0, 2, 2)) == 20
    assert outcome("strides_to_success", walk_of(2.0, 1.0, 2, 2)) is None
    half = walk_of(2.0, 2.23, 2, 2)  # every second stride hits: 90 % of 2.33 and of 2.13
    assert half.hit[half.with_feedback].mean() == pytest.approx(0.5)
    assert outcome("strides_to_success", half) is None


def test_spread_about_the_mean_about_the_trend_and_from_stride_to_stride():
    walk = walk_of(2.0, 2.5, 2.0, 2.0)
    values = walk.values(walk.with_feedback)
    assert outcome("variation", walk) == pytest.approx(100 * values.std(ddof=1) / values.mean())
    ramp = stats.linregress(np.arange(100), values / 2.0)
    residual = values / 2.0 - ramp.intercept - ramp.slope * np.arange(100)
    assert outcome("steadiness", walk) == pytest.approx(100 * np.sqrt((residual**2).sum() / 98))
    assert outcome("lag_1", walk) == pytest.approx(-0.99)


def test_invalid_strides_count_as_such_and_nowhere_else():
    clean, faulty = walk_of(2, 2.5, 2, 2), walk_of(2, 2.5, 2, 2, invalid=frozenset({60, 61}))
    assert outcome("invalid_strides", faulty) == pytest.approx(1)
    assert outcome("late_change", faulty) == outcome("late_change", clean)


def test_what_two_sessions_tell_needs_the_one_before():
    first, second = walk_of(2, 3, 2, 2), walk_of(2, 2.5, 2, 2)
    assert outcome("kept_between_visits", second) is None
    assert outcome("kept_between_visits", second, first) == pytest.approx(50)
    assert outcome("savings", second, first) == 0
    nothing_gained = walk_of(2, 2.02, 2, 2)
    assert outcome("kept_between_visits", second, nothing_gained) is None


def test_a_session_without_enough_baseline_has_no_changes():
    walk = walk_of(2, 3, 2, 2, invalid=frozenset({1}))
    assert walk.baseline is None
    assert outcome("late_change", walk) is None
    assert outcome("variation", walk) is not None


def test_differences_of_two_groups_are_those_of_welch():
    a, b = {"1": 3.0, "2": 5.5, "3": 4.0, "4": 9.0}, {"5": 1.0, "6": 2.0, "7": 2.5}
    [found] = compare({"A": a, "B": b}, paired=False)
    known = stats.ttest_ind(list(b.values()), list(a.values()), equal_var=False)
    low, high = known.confidence_interval(0.95)
    assert (found.group, found.reference, found.participants) == ("B", "A", (3, 4))
    assert (found.difference.low, found.difference.high) == pytest.approx((low, high))
    assert found.effect.estimate < 0


def test_paired_differences_are_of_those_who_walked_both():
    a, b = {"1": 3.0, "2": 5.0, "3": 4.0, "4": 9.0}, {"1": 4.0, "2": 7.0, "3": 5.5, "9": 100.0}
    [found] = compare({"A": a, "B": b}, paired=True)
    known = stats.ttest_1samp([1.0, 2.0, 1.5], 0).confidence_interval(0.95)
    assert found.participants == (3, 3)
    assert found.difference.estimate == pytest.approx(1.5)
    assert (found.difference.low, found.difference.high) == pytest.approx((known.low, known.high))


@pytest.mark.parametrize(
    "groups", [{"A": {"1": 2.0}, "B": {"2": 3.0}}, {"A": {"1": 2.0, "2": 2.5}, "B": {"3": 3.0}}]
)
def test_two_people_give_no_interval(groups):
    [found] = compare(groups, paired=False)
    assert found.difference.low is None
    assert found.effect is None


def test_equal_figures_give_no_effect_size_and_no_warning():
    same = {str(number): 2.0 for number in range(4)}
    [found] = compare(
        {"A": same, "B": {f"b{key}": value for key, value in same.items()}}, paired=False
    )
    assert (found.difference.low, found.difference.high, found.effect) == (0, 0, None)


def test_a_group_without_figures_is_compared_with_nothing():
    assert compare({"A": {}, "B": {"1": 2.0}}, paired=False) == []


def test_places_that_few_reached_are_left_out_of_a_curve():
    curves = [
        {CurvePlace(0, 0, 0): 100.0, CurvePlace(0, 0, 1): 90.0},
        *[{CurvePlace(0, 0, 0): 110.0}] * 3,
    ]
    [point] = average(curves)
    assert (point.place, point.participants) == (CurvePlace(0, 0, 0), 4)
    assert point.mean == pytest.approx(107.5)
    assert point.low < point.mean <= point.high


def people():
    return simulate(example_trial(12, visits=2), seed=5)


@pytest.mark.wide
def test_a_study_from_a_seed_is_the_same_again_to_the_last_digit():
    arms = list("ABCD")
    first, second = people(), people()
    assert first == second
    assert curves_by_arm(first, arms) == curves_by_arm(second, arms)
    late = [find(one, arms, "late_change", crossover=False) for one in (first, second)]
    assert late[0] == late[1]
    assert simulate(example_trial(12, visits=2), seed=6) != first


def test_the_flow_counts_who_came_who_left_and_who_is_missing():
    whole = people()
    left = make_participant(
        "099",
        [(ParticipantVisit(1, "A"), None), (ParticipantVisit(2, "A", is_due=False), None)],
        has_left=True,
    )
    mine = sum("A" in one.arms for one in whole)
    of_a = flow([*whole, left], ["A"], "late_change")[0]
    assert (of_a.allocated, of_a.began, of_a.completed, of_a.left) == (mine + 1, mine, mine, 1)
    planned = 2 * mine + 1
    assert (of_a.analyzed, of_a.visits_planned, of_a.visits_walked) == (mine, planned, 2 * mine)
    assert find([*whole, left], ["A"], "late_change", crossover=False).arms[0].missing == 1


def test_figures_are_well_formed_and_name_every_arm_once_escaped():
    whole, arms = people(), list("ABCD")
    labels = dict(zip(arms, ["<b>", "Group & 2", "C: third", "D"], strict=True))
    finding = find(whole, arms, "late_change", crossover=False)
    values = {
        arm: {one.code: one.outcome("late_change", arm) for one in whole if arm in one.arms}
        for arm in arms
    }
    phases = [PhaseLabel("Baseline", False), *[PhaseLabel("Training", True)] * 4]
    for svg in (
        draw_curves(
            curves_by_arm(whole, arms), labels, phases, CurveLabels("t", "y", "x", "Visit {number}")
        ),
        draw_people(finding, values, labels, "title", "%", joined=False),
    ):
        texts = [
            one.text
            for one in ET.fromstring(svg).iter()  # noqa: S314 (our own)
            if one.tag.endswith("text")
        ]
        assert all(texts.count(label) == 1 for label in labels.values())
