"""Outcomes of sessions, differences between arms, and the figures of them: all pure."""

from __future__ import annotations

from typing import Any
from xml.etree import ElementTree as ET

import numpy as np
import pytest
from scipy import stats

from rehab.studies.analysis.curves import CurvePlace, average
from rehab.studies.analysis.findings import find
from rehab.studies.analysis.outcomes import OF_STRIDES, OUTCOMES
from rehab.studies.analysis.participants import (
    ParticipantVisit,
    curves_by_arm,
    distinct,
    flow,
    make_participant,
)
from rehab.studies.analysis.phase_figures import channel_changes, describe_phases
from rehab.studies.analysis.walk_figures import History
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
    """Return an outcome of a walk: of the first one, or after another one."""
    return OF_STRIDES[slug].compute(walk, History(before, (before or walk).baseline))


def test_changes_are_in_percent_of_the_first_baseline():
    walk = walk_of(2.0, 2.5, 2.2, 2.1)
    assert walk.baseline == pytest.approx(2.0)
    assert outcome("training_change", walk) == pytest.approx(25)
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
    assert outcome("strides_to_success", walk_of(2.0, 1.0, 2, 2)) == 100  # all that were walked
    half = walk_of(2.0, 2.23, 2, 2)  # every second stride hits: 90 % of 2.33 and of 2.13
    assert half.hit[half.with_feedback].mean() == pytest.approx(0.5)
    assert outcome("strides_to_success", half) == 100


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


def test_what_a_visit_carries_to_the_next_is_measured():
    first, second = walk_of(2, 2.6, 2.2, 2.2), walk_of(2.4, 2.6, 2.4, 2.4)
    assert outcome("baseline_change", first) is None
    assert outcome("baseline_change", second, first) == pytest.approx(20)
    assert outcome("washout_change", second, first) == pytest.approx(20)  # not 0, of its own
    assert outcome("late_change", second, first) == pytest.approx(30)


def test_a_follow_up_is_compared_with_the_first_baseline():
    first = walk_of(2, 2.6, 2.2, 2.2)
    rows: list[Any] = [(0, float(n), 2.3, 1.0, None, None, None, True, {}) for n in range(50)]
    later = read_walk(PHASES[:1], rows, higher_is_better=True)
    assert outcome("follow_up_change", later, first) == pytest.approx(15)
    assert outcome("follow_up_change", first) is None
    assert outcome("late_change", later, first) is None


def test_what_was_kept_is_a_difference_that_exists_whoever_gained():
    for trained, kept in ((3.0, 2.5), (2.01, 2.0), (1.6, 1.8)):
        walk = walk_of(2.0, trained, 2.0, kept)
        lost = 100 * (kept - trained) / 2
        assert outcome("washout_loss", walk) == pytest.approx(lost)
        after = walk_of(2.0, kept, 2.0, 2.0)
        assert outcome("between_visits", after, walk) == pytest.approx(lost)
    assert "retention_in_washout" not in OUTCOMES  # a share of the gain


def test_what_two_sessions_tell_needs_the_one_before():
    first, second = walk_of(2, 3, 2, 2), walk_of(2, 2.5, 2, 2)
    assert outcome("between_visits", second) is None
    assert outcome("savings", second, first) == 0
    never = walk_of(2, 1.0, 2, 2)
    assert outcome("savings", never, first) == -80  # of 100 strides none succeeded


def test_a_session_without_enough_baseline_has_no_changes():
    walk = walk_of(2, 3, 2, 2, invalid=frozenset({1}))
    assert walk.baseline is None
    assert outcome("late_change", walk) is None
    assert outcome("variation", walk) is not None


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
    assert (of_a.allocated, of_a.began, of_a.completed, of_a.left) == (mine + 1, mine, mine, 0)
    assert of_a.never_began == 1
    planned = 2 * mine + 1
    assert (of_a.analyzed, of_a.visits_planned, of_a.visits_walked) == (mine, planned, 2 * mine)
    assert find([*whole, left], ["A"], "late_change", crossover=False).arms[0].missing == 1


def test_one_variable_is_listed_once():
    slugs = ["improvement_over_baseline", "late_change", "mean_performance", "percent_of_goal"]
    assert distinct(people(), slugs) == slugs[:2]
    assert distinct([], slugs) == slugs


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
