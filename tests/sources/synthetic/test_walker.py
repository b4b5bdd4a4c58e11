"""Synthetic walkers: the same for the same seed, and alike to recorded ones.

Source: docs/reference/gait.md#dynamics.
"""

import hashlib
import tracemalloc
from collections import deque
from dataclasses import replace
from itertools import groupby, islice, pairwise
from statistics import mean

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rehab.sources.synthetic import GOOD, PROFILES, SyntheticWalker, walk
from rehab.training.changes import Change, ChangeKind
from rehab.training.fold import SessionFold
from rehab.training.goals import GoalRule
from rehab.training.measures import A2
from rehab.training.phases import make_phase
from rehab.training.plans import SessionPlan
from rehab.training.steps import Side
from rehab.training.valences import VALENCES
from tests.sources.synthetic.protocols import SESSION_1, usable

BASELINE = make_phase("baseline")
TRAINING = make_phase("training")
WASHOUT = make_phase("washout")


def steady(profile=GOOD, **changes):
    """Return a profile that learns nothing, tires of nothing and stays at its first level."""
    return replace(
        profile, trained_level=1.5, exploration_level=1.5, fatigue_per_100_strides=0, **changes
    )


# --- The same seed, the same walk ----------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "digest"),
    [
        ("good", "194f1b00aea9d1b6"),
        ("poor", "1c5abc7b736bc256"),
        ("fatiguing", "df401e10b6b750f2"),
        ("dropout", "563d98d029cb13e2"),
    ],
)
def test_golden_walks(name, digest):
    # Found alike on CPython 3.11, 3.12 and 3.13. Whoever changes them changes stored experiments.
    strides = walk(PROFILES[name], 7, SESSION_1)
    text = "\n".join(f"{m.number} {m.time_s!r} {m.value!r} {' '.join(m.reasons)}" for m in strides)

    assert hashlib.sha256(text.encode()).hexdigest()[:16] == digest


def test_golden_strides():
    first = [(m.number, m.time_s, m.value) for m in walk(GOOD, 1, strides=4)]

    assert first == [
        (1, 1.098, 3.7664),
        (2, 2.196, 3.4997),
        (3, 3.285, 3.7677),
        (4, 4.348, 3.9416),
    ]


def test_seeds_differ():
    assert list(walk(GOOD, 1, strides=9)) == list(walk(GOOD, 1, strides=9))
    assert list(walk(GOOD, 1, strides=9)) != list(walk(GOOD, 2, strides=9))


# --- Without end, in constant memory -------------------------------------------------------------


@pytest.mark.long
def test_a_walk_has_no_end_and_takes_no_memory():
    strides = walk(GOOD, 1)
    deque(islice(strides, 1000), maxlen=0)
    tracemalloc.start()
    deque(islice(strides, 20_000), maxlen=0)
    grown, _ = tracemalloc.get_traced_memory()
    tracemalloc.stop()

    assert next(strides).number == 21_001
    assert grown < 10_000


@pytest.mark.parametrize("profile", PROFILES.values(), ids=PROFILES)
def test_every_stride_is_one_that_sources_may_send(profile):
    strides = list(walk(profile, 5, SESSION_1, side=Side.RIGHT))

    assert [m.number for m in strides] == list(range(1, 1631))
    assert all(a.time_s < b.time_s for a, b in pairwise(strides))
    assert {m.side for m in strides} == {Side.RIGHT}
    assert all(A2.value_min <= m.value <= A2.value_max for m in strides if m.value is not None)
    assert {reason for m in strides for reason in m.reasons} == {"flagged"}


@pytest.mark.parametrize(("strides", "walked"), [(0, 0), (3, 3), (10, 10), (11, 10), (None, 10)])
def test_a_walk_ends_with_its_phases_or_its_strides(strides, walked):
    phases = [replace(BASELINE, strides=4), replace(TRAINING, strides=6)]

    assert len(list(walk(GOOD, 1, phases, strides))) == walked


PHASES = st.lists(
    st.sampled_from(["baseline", "familiarization", "training", "catch", "washout"]).flatmap(
        lambda kind: (
            st.builds(lambda n: make_phase(kind, strides=n), st.integers(1, 20))
            | st.builds(lambda s: make_phase(kind, seconds=s), st.floats(0.1, 30))
        )
    ),
    min_size=1,
    max_size=5,
)


@settings(deadline=None)
@given(PHASES, st.integers(0, 99))
def test_walker_and_session_agree_on_the_phase_of_every_stride(phases, seed):
    plan = SessionPlan(A2, VALENCES["positive"], tuple(phases), Side.LEFT, goal=GoalRule(value=3.9))
    fold = SessionFold(plan)
    fold.change(Change(ChangeKind.START))
    walker = SyntheticWalker(GOOD, seed)
    by_session = []
    while not fold.completed:
        by_session.append(walker.next_stride(fold.phase))
        fold.step(by_session[-1])

    assert list(walk(GOOD, seed, phases)) == by_session


# --- Alike to recorded walking -------------------------------------------------------------------


@pytest.fixture(scope="module")
def long_training():
    """Walk a good while in one phase with feedback."""
    return list(walk(GOOD, 2, [TRAINING], 100_000))


@pytest.mark.long
def test_unusable_strides_come_in_bursts(long_training):
    bad = [bool(m.reasons) for m in long_training]
    bursts = [len(list(run)) for is_bad, run in groupby(bad) if is_bad]

    assert mean(bad) == pytest.approx(0.0066, rel=0.2)  # .6 % in sessions 2 and 3
    assert mean(bursts) == pytest.approx(1 / 0.6, rel=0.1)  # leaves with probability .6
    assert 4 <= max(bursts) <= 12


def test_spikes_are_on_bad_strides_only(long_training):
    good = usable(long_training)
    bad = [m.value for m in long_training if m.reasons]
    limit = 1.6 * mean(good)

    assert mean(value > limit for value in good) < 1e-4
    assert mean(value > limit for value in bad) == pytest.approx(0.45, abs=0.1)
    assert max(bad) < 20


def test_missing_values(long_training):
    missing = [m for m in long_training if m.value is None]

    assert len(missing) / 100_000 == pytest.approx(0.0007, rel=0.4)
    assert not any(m.reasons for m in missing)  # in the recordings, their strides were usable


def test_levels_change_in_one_stride():
    profile = replace(GOOD, exploration_strides=0)
    phases = [replace(TRAINING, gain=0.85, strides=400), make_phase("catch", strides=12)]
    ends, begins = [], []
    for seed in range(100):
        values = [m.value for m in walk(profile, seed, phases) if m.number in (400, 401)]
        ends.append(values[0] or 0)
        begins.append(values[1] or 0)

    assert mean(ends) / 3.9 == pytest.approx(1.45, abs=0.06)
    assert mean(begins) / 3.9 == pytest.approx(1.11, abs=0.05)


def test_washout_forgets_slowly():
    phases = [replace(TRAINING, strides=1500), replace(WASHOUT, strides=3000)]
    washout = [m for m in walk(steady(calm_noise=0, calm_slow_sd=0), 1, phases) if m.number > 1500]

    assert mean(usable(washout[:50])) / 3.9 == pytest.approx(1.12, abs=0.01)
    assert mean(usable(washout[1475:1525])) / 3.9 == pytest.approx(1 + 0.12 / 2.718, abs=0.01)


def test_fatigue_is_gone_after_a_pause():
    profile = replace(steady(), fatigue_per_100_strides=0.03, noise=0, slow_sd=0, baseline_w_kg=1)
    phases = [replace(TRAINING, name=f"trial {n}", strides=101) for n in (1, 2)]
    values = [m.value for m in walk(replace(profile, p_bad=0, p_missing=0), 1, phases)]

    assert values[0] - values[100] == pytest.approx(0.03, abs=1e-3)
    assert values[101] == pytest.approx(values[0], abs=1e-3)


def test_profiles_are_what_they_are_called():
    def late(name):
        strides = walk(PROFILES[name], 1, [replace(TRAINING, gain=0.85)], 3000)
        return mean(usable(strides)[-1000:]) / PROFILES[name].baseline_w_kg

    assert late("good") > 1.4
    assert late("poor") < 1.0
    trial = [replace(TRAINING, gain=0.85)]
    early = mean(usable(walk(PROFILES["fatiguing"], 1, trial, 300))[200:]) / 2.2
    assert early > 1.15 > late("fatiguing") > 0.9
    dropout = list(walk(PROFILES["dropout"], 1, [TRAINING], 20_000))
    assert mean(m.value is None for m in dropout) == pytest.approx(0.05 * 0.94, rel=0.1)
    assert mean(bool(m.reasons) for m in dropout) == pytest.approx(0.0625, rel=0.15)
