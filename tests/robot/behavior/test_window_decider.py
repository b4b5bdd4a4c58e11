"""Windows and decisions against an oracle that shares nothing with them but the rule."""

import math
from dataclasses import replace
from functools import reduce
from itertools import pairwise
from operator import add

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot.behavior.cue import Cue
from robot.behavior.window_decider import (
    LATE,
    NO_GESTURE,
    PERFORMING,
    RESTING,
    Decision,
    WindowDecider,
)
from robot.wire.cue_limits import CueRule
from robot.wire.frames import BadFrame

CUE = Cue(above="celebrate", below="droop")

steps = st.lists(
    st.tuples(st.integers(0, 3000), st.integers(0, 300)), max_size=80
)  # hundredths of a second since the step before, percent of the goal


def recompute(times_s, performances, threshold=0.9, window_s=5.0):
    """Sort all steps into windows first, then decide. A last, open window has no decision."""
    windows: dict[int, list[tuple[float, float]]] = {}
    for time_s, performance in zip(times_s, performances, strict=True):
        number = math.floor((time_s - times_s[0]) / window_s)
        windows.setdefault(number, []).append((time_s, performance))
    numbers = sorted(windows)
    decisions = []
    for number, following in pairwise(numbers):
        values = [performance for _, performance in windows[number]]
        if len(values) >= 2:
            # Since Python 3.12 sum() rounds otherwise than one addition after the other.
            mean = reduce(add, values) / len(values)
            until_s = times_s[0] + number * window_s + window_s
            late = windows[following][0][0] - until_s > window_s
            decisions.append((number, len(values), mean, mean >= threshold, late))
    return decisions


@given(steps, st.floats(-1000, 1000))
def test_windows_are_those_of_the_oracle(walk, first_s):
    times_s, performances, time_s = [], [], first_s
    for gap, percent in walk:
        time_s += gap / 100
        times_s.append(time_s)
        performances.append(percent / 100)
    decider, found = WindowDecider(CUE), []
    for at_s, performance in zip(times_s, performances, strict=True):
        decision = decider.add(at_s, performance)
        if decision is not None:
            number = round((decision.from_s - times_s[0]) / 5)
            assert decision.until_s == pytest.approx(decision.from_s + 5)
            found.append((number, decision.steps, decision.mean, decision.above, decision.is_late))
    expected = recompute(times_s, performances) if walk else []
    assert found == expected
    above = sum(decision[3] for decision in expected)
    assert decider.share == (above / len(expected) if expected else None)


def close(decider, time_s=5.0):
    """Add a step and expect the window to end."""
    decision = decider.add(time_s, 1.0)
    assert decision is not None
    return decision


def test_the_threshold_itself_is_above():
    decider = WindowDecider(CUE)
    decider.add(0, 0.75)
    decider.add(1, 1.05)
    decision = close(decider)
    assert decision == Decision(0, 5, 5, 2, 0.9, 0.9, True)
    assert decider.cue.gesture(decision.above) == "celebrate"


def test_one_step_decides_nothing():
    decider = WindowDecider(CUE)
    decider.add(0, 1.0)
    assert decider.add(6, 1.0) is None
    assert decider.share is None


def test_a_threshold_counts_from_the_open_window_on():
    decider = WindowDecider(CUE)
    decider.add(0, 0.8)
    decider.add(1, 0.8)
    decider.set_cue(Cue(above="celebrate", threshold=0.7))
    assert close(decider).above
    assert decider.share == 1


def test_another_length_of_windows_begins_anew():
    decider = WindowDecider(CUE)
    decider.add(0, 0.8)
    decider.add(1, 0.8)
    decider.set_cue(Cue(window_s=2))
    assert decider.add(5, 1) is None
    decider.add(6, 1)
    assert decider.add(7, 1) == Decision(5, 7, 7, 2, 1, 0.9, True)


def test_a_clock_that_was_set_back_begins_anew():
    decider = WindowDecider(CUE)
    for time_s in (100, 101, 102):
        decider.add(time_s, 0.5)
    assert decider.add(3, 1.0) is None
    assert decider.add(4, 1.0) is None
    assert close(decider, 8.5) == Decision(3, 8, 8.5, 2, 1.0, 0.9, True)


def test_rest_counts_from_the_start_of_the_last_gesture():
    decider = WindowDecider(CUE)
    first = Decision(0, 5, 5.5, 4, 1.0, 0.9, True)
    assert decider.blocking_reason(first, performing=False) == ""
    decider.mark_started(first)
    soon, later = replace(first, at_s=10.4, until_s=10), replace(first, at_s=10.5, until_s=10)
    assert decider.blocking_reason(soon, performing=False) == RESTING
    assert decider.blocking_reason(later, performing=True) == PERFORMING
    assert decider.blocking_reason(later, performing=False) == ""
    decider.add(20, 1)
    decider.add(3, 1)  # the source's clock was set back
    assert decider.blocking_reason(replace(first, at_s=7.9), performing=False) == RESTING
    assert decider.blocking_reason(replace(first, at_s=8.0), performing=False) == ""


@pytest.mark.parametrize("back_s", [0, 0.5, 4, 3000, 1.8e9])
def test_rest_outlasts_a_pause_by_no_more_than_itself_whatever_the_clock(back_s):
    decider = WindowDecider(CUE)
    first = Decision(back_s, back_s + 5, back_s + 5.5, 4, 1.0, 0.9, True)
    decider.mark_started(first)
    decider.drop_window()  # paused, or out of reach
    decider.add(5.6, 1)
    begun_s = min(5.6, first.at_s)
    soon, later = (replace(first, from_s=5, until_s=10, at_s=begun_s + s) for s in (4.9, 5))
    assert decider.blocking_reason(soon, performing=False) == RESTING
    assert decider.blocking_reason(later, performing=False) == ""


def test_nobody_answers_a_window_of_long_ago():
    decider = WindowDecider(CUE)
    decider.add(0, 1)
    decider.add(1, 1)
    decision = close(decider, 11)
    assert decision.is_late
    assert decider.blocking_reason(decision, performing=False) == LATE


def test_how_long_no_answer_can_be_due():
    decider = WindowDecider(CUE)
    assert decider.free_s(0) == 5
    decider.add(0, 1)
    assert decider.free_s(4) == math.inf  # one step decides nothing
    decider.add(1, 1)
    assert [decider.free_s(now_s) for now_s in (1, 4.5, 7, 10.1)] == [4, 0.5, 0, math.inf]


def test_no_gesture_where_the_order_names_none():
    decision = Decision(0, 5, 5, 4, 1.0, 0.9, True)
    assert (
        WindowDecider(Cue(below="droop")).blocking_reason(decision, performing=False) == NO_GESTURE
    )


GOOD = {"above": "a", "below": None, "threshold": 0.9, "window_s": 5, "rest_s": 5, "intensity": 1}


def test_an_order_is_read():
    assert Cue.read(GOOD) == Cue(above="a")


@pytest.mark.parametrize(
    "cue",
    [
        None,
        [],
        {},
        GOOD | {"above": 1},
        GOOD | {"above": ""},
        GOOD | {"below": "x" * 65},
        GOOD | {"threshold": math.nan},
        GOOD | {"threshold": "0.9"},
        GOOD | {"threshold": True},
        GOOD | {"window_s": 0},
        GOOD | {"window_s": 1e400},
        GOOD | {"rest_s": -1},
        GOOD | {"intensity": 0.05},
        GOOD | {"intensity": 2},
        GOOD | {"intensity": 10**400},
        GOOD | {"rule": "dances"},
        GOOD | {"rule": "steps", "count": 0},
    ],
    ids=str,
)
def test_what_is_no_order(cue):
    with pytest.raises(BadFrame):
        Cue.read(cue)


@given(st.floats(0, 3), st.floats(0.05, 2))
def test_strong_walking_is_answered_strongly_within_bounds(mean, threshold):
    above = mean >= threshold
    decision = Decision(0, 5, 5, 4, mean, threshold, above)
    strength = decision.strength
    assert 0.5 <= strength <= 1
    if not above or mean >= 1.1:
        assert strength == 1
    else:
        assert strength <= replace(decision, mean=mean + 0.1).strength
        assert replace(decision, mean=threshold).strength == 0.5


def decisions(cue, *performances):
    """Return number, side and mean of each decision, for steps one second apart."""
    decider = WindowDecider(cue)
    found = [decider.add(float(at), one) for at, one in enumerate(performances)]
    return [(n, one.above, one.steps) for n, one in enumerate(found, 1) if one is not None]


def test_streaks_answer_so_many_steps_in_a_row_on_one_side():
    cue = replace(CUE, rule=CueRule.STREAKS, count=3)
    assert decisions(cue, 1, 1, 0.5, 1, 0.9, 1, 1, 1, 1) == [(6, True, 3), (9, True, 3)]
    assert decisions(cue, 0.1, 0.2, 0.3, 0.1, 1, 0.1) == [(3, False, 3)]


def test_steps_answer_the_mean_of_each_so_many():
    cue = replace(CUE, rule=CueRule.STEPS, count=4)
    assert decisions(cue, 1, 1, 0.9, 0.8, 0.1, 0.1, 0.1, 3, 1) == [(4, True, 4), (8, False, 4)]
    assert decisions(replace(cue, count=1), 1, 0.5) == [(1, True, 1), (2, False, 1)]


@given(steps, st.integers(1, 9))
def test_a_streak_is_on_one_side_and_no_step_counts_twice(walk, count):
    decider = WindowDecider(replace(CUE, rule=CueRule.STREAKS, count=count))
    performances = [percent / 100 for _gap, percent in walk]
    last = 0
    for at, performance in enumerate(performances, 1):
        decision = decider.add(float(at), performance)
        if decision is None:
            continue
        sides = {one >= CUE.threshold for one in performances[at - count : at]}
        assert sides == {decision.above}
        assert decision.from_s == at - count + 1 > last
        assert not decision.is_late
        last = at


def test_a_streak_rests_and_a_pause_ends_it():
    decider = WindowDecider(replace(CUE, rule=CueRule.STREAKS, count=2, rest_s=10))
    decider.add(0, 1.0)
    decider.drop_window()
    assert decider.add(1, 1.0) is None
    first = decider.add(2, 1.0)
    assert not decider.blocking_reason(first, performing=False)
    decider.mark_started(first)
    decider.add(3, 1.0)
    assert decider.blocking_reason(decider.add(4, 1.0), performing=False) == RESTING


def test_a_clock_that_is_set_back_begins_a_new_streak():
    decider = WindowDecider(replace(CUE, rule=CueRule.STEPS, count=2, rest_s=10))
    decider.mark_started(Decision(90, 100, 100, 2, 1, 0.9, True))
    assert decider.add(100, 1.0) is None
    assert decider.add(3, 1.0) is None
    decision = decider.add(4, 1.0)
    assert (decision.from_s, decision.steps) == (3, 2)
    assert decider.blocking_reason(decision, performing=False) == RESTING
    for at in range(5, 13):
        decider.add(at, 1.0)
    decision = decider.add(13, 1.0) or decider.add(14, 1.0)
    assert not decider.blocking_reason(decision, performing=False)
