"""Synthetic walkers answer what they are shown, differ from each other, and remember their pace."""

from argparse import Namespace
from dataclasses import replace
from itertools import pairwise
from statistics import correlation, mean, stdev

import numpy as np
import pytest

from rehab.sources.client import Display
from rehab.sources.synthetic import ANSWERS, GOOD, PROFILES, SyntheticWalker, walk
from rehab.sources.synthetic.source import SyntheticSource
from rehab.training.measures import MEASURES
from rehab.training.phases import make_phase
from rehab.training.steps import Side, select_value
from tests.sources.synthetic.protocols import usable

OPTIONS = dict.fromkeys(("side", "strides", "treadmill", "heart_rate")) | {
    "seed": 3,
    "profile": "good",
}


def training(gain):
    return make_phase("training", gain=gain)


def find_plateau(gain, seed=1, goal_w_kg=None, profile=GOOD):
    """Return the level after 1200 strides with feedback, by the baseline."""
    walker = SyntheticWalker(profile, seed)
    walker.goal_w_kg = goal_w_kg
    strides = [walker.next_stride(training(gain)) for _ in range(1200)]
    return mean(usable(strides[-300:])) / profile.baseline_w_kg


@pytest.mark.parametrize("valence", ["positive", "explicit"])
def test_a_live_walker_answers_as_a_headless_one(valence):
    """By the goal and the feedback type that the server sends."""
    options = Namespace(**OPTIONS, signals=False)
    live = SyntheticSource(options, print).open_walk(Side.LEFT)
    headless = SyntheticWalker(GOOD, 3, Side.LEFT, valence)
    headless.goal_w_kg = 4.4

    for _ in range(300):
        assert live(Display(training(0.9), 4.4, valence)) == headless.next_stride(training(0.9))


@pytest.mark.parametrize("measure", MEASURES.values(), ids=lambda one: one.slug)
def test_every_measure_is_walked_and_answers_its_goal(measure):
    """Begun at a healthy walk's value; trained in the measure's better direction."""
    options = Namespace(**OPTIONS, signals=False)
    live = SyntheticSource(options, print).open_walk(Side.LEFT)
    baseline = make_phase("baseline")
    goal = measure.offered_goal

    def values(phase, count):
        found = []
        for _ in range(count):
            stride = live(Display(phase, goal, "positive", measure.slug))
            value = select_value(stride, measure).value
            if value is not None and not stride.reasons:
                assert measure.value_min <= value <= measure.value_max
                found.append(value)
        return found

    usual = mean(values(baseline, 100))
    trained = mean(values(training(0.85), 600)[-200:])
    assert usual == pytest.approx(goal, rel=0.15)
    better = trained / usual if measure.higher_is_better else usual / trained
    assert better > 1.05


def test_signals_of_another_measure_say_that_they_do_not_answer_its_goal():
    said: list[str] = []
    settings = {"mass": 75.0, "rate": 100.0, "look_ahead": 0.05, "keep": None}
    options = Namespace(**OPTIONS, signals=True, **settings)
    live = SyntheticSource(options, said.append).open_walk(Side.LEFT)
    for slug in ("a2", "step_length", "step_length"):
        live(Display(make_phase("training"), 0.5, "positive", slug))
    (text,) = [one for one in said if "A2 alone" in one]
    assert "not of step length" in text


def test_the_plateau_follows_the_gain():
    plateaus = [
        mean(find_plateau(gain, seed) for seed in range(8)) for gain in (1, 0.9, 0.85, 0.75)
    ]

    assert plateaus == sorted(plateaus)
    assert plateaus[0] == pytest.approx(1.5 * 0.85, abs=0.06)
    assert plateaus[2] == pytest.approx(1.5, abs=0.06)


def test_the_plateau_follows_the_goal():
    easy, hard = (find_plateau(0.85, goal_w_kg=share * GOOD.baseline_w_kg) for share in (0.9, 1.1))

    assert easy < 1.45 < hard


def test_the_demo_patient_learns_and_hits_about_six_of_ten():
    goal = GOOD.baseline_w_kg
    early, late = [], []
    for seed in range(6):
        walker = SyntheticWalker(PROFILES["demo"], seed)
        walker.goal_w_kg = goal
        hits = [
            value >= goal for value in usable(walker.next_stride(training(1)) for _ in range(400))
        ]
        early.append(mean(hits[:60]))
        late.append(mean(hits[-200:]))

    assert mean(early) < 0.45
    assert 0.5 < mean(late) < 0.7


def test_what_nobody_can_reach_is_given_up():
    assert find_plateau(0.5) < find_plateau(0.7)
    stubborn = replace(GOOD, discouragement=0.0)
    assert find_plateau(0.5, profile=stubborn) > find_plateau(0.5) + 0.1


def test_plateaus_are_individual():
    plateaus = [find_plateau(0.85, seed) for seed in range(20)]

    assert 0.02 < stdev(plateaus) < 0.1


def walk_with(valence, seed, strides):
    walker = SyntheticWalker(GOOD, seed, Side.LEFT, valence)
    return [walker.next_stride(training(0.85)) for _ in range(strides)]


def test_feedback_types_differ_as_is_assumed():
    early = {v: mean(mean(usable(walk_with(v, s, 250)[150:])) for s in range(10)) for v in ANSWERS}
    spread = {v: mean(stdev(usable(walk_with(v, s, 900)[500:])) for s in range(5)) for v in ANSWERS}

    assert early["explicit"] > early["negative"] > early["positive"] > early["binary"]
    assert spread["binary"] > spread["positive"] > spread["explicit"]


def find_dfa(values):
    """Return the exponent of detrended fluctuation analysis over boxes of 8 strides to a sixth."""
    profile = np.cumsum(np.asarray(values) - np.mean(values))
    boxes = np.unique(np.geomspace(8, len(profile) // 6, 14).round().astype(int))
    fluctuations = []
    for size in boxes:
        rows = profile[: len(profile) // size * size].reshape(-1, size)
        time = np.arange(size)
        slopes, levels = np.polyfit(time, rows.T, 1)
        rest = rows - (np.outer(slopes, time) + levels[:, np.newaxis])
        fluctuations.append(np.sqrt((rest**2).mean()))
    return float(np.polyfit(np.log(boxes), np.log(fluctuations), 1)[0])


@pytest.fixture(scope="module")
def paces():
    """Return stride times [s] and values of a while of training without pauses, ten times."""
    found = []
    for seed in range(10):
        strides = list(walk(GOOD, seed, [training(0.85)], 1100))[250:]
        times = [b.time_s - a.time_s for a, b in pairwise(strides)]
        kept = [(t, m) for t, m in zip(times, strides[1:], strict=True) if t < 2]
        found.append(([t for t, _ in kept], [m for _, m in kept]))
    return found


def test_stride_time_remembers(paces):
    """Recorded: lag-1 of 0.35 to 0.60, DFA of 0.79 to 0.94 (docs/reference/gait.md#dynamics)."""
    assert 0.35 < mean(correlation(t[1:], t[:-1]) for t, _ in paces) < 0.60
    assert 0.79 < mean(find_dfa(t) for t, _ in paces) < 0.94
    assert 0.67 < mean(find_dfa(usable(m)) for _, m in paces) < 0.84


def test_push_off_goes_with_the_pace(paces):
    """Recorded: -0.39, -0.22 and +0.03."""
    pairs = [
        correlation(
            *zip(*[(t, m.value) for t, m in zip(*one, strict=True) if m.value], strict=True)
        )
        for one in paces
    ]
    assert -0.3 < mean(pairs) < 0.0


def test_slips():
    calm = replace(GOOD, p_bad=0, p_missing=0, noise=0, slow_sd=0, plateau_sd=0, pace_coupling=0)
    values = usable(walk(replace(calm, exploration_strides=10**6), 3, [training(1)], 20_000))
    slips = [value / GOOD.baseline_w_kg for value in values if value < 0.7 * GOOD.baseline_w_kg]

    assert 0.0008 < len(slips) / 20_000 < 0.0025
