"""People who walk over plates in a floor: single steps, one leg or both, feet beside the plate."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from rehab.gait import LegSamples, RejectionReason
from rehab.gait.recordings.csv_files import save_signals
from rehab.sources.arguments import make_parser
from rehab.sources.client import Display
from rehab.sources.recording.source import RecordingSource
from rehab.training.phases import make_phase
from rehab.training.steps import Side
from tests.gait.walks import FORCE, MOMENT, make_walk


@pytest.fixture(scope="module")
def treadmill():
    walk, _ = make_walk(rate_hz=200, strides=30, seed=2)
    return walk, walk.both_legs()


def pass_over(walk, strides, every=3, load=1.0):
    """Keep a left and the next right step of every so many: the others miss the plates."""
    legs = {}
    for side in ("left", "right"):
        leg = getattr(walk, side).copy()
        kept = np.zeros(len(walk.t_s), bool)
        own = [s for s in strides if s.side == side][1::every]
        for stride in own:
            kept |= (walk.t_s > stride.initial_contact_s - 0.03) & (
                walk.t_s < stride.terminal_contact_s + 0.03
            )
        noise = np.random.default_rng(0).normal(0, 1.0, len(walk.t_s))
        leg[FORCE] = np.where(kept, load * leg[FORCE], noise)
        leg[MOMENT] = np.where(kept, load * leg[MOMENT], 0.0)
        legs[side] = leg
    return replace(walk, **legs)


def pairs_of(found, clean):
    for stride in found:
        apart = [abs(one.terminal_contact_s - stride.terminal_contact_s) for one in clean]
        yield stride, clean[int(np.argmin(apart))]


@pytest.mark.parametrize("look_ahead_s", [0.0, 0.05])
def test_single_steps_over_two_plates_count(treadmill, look_ahead_s):
    walk, clean = treadmill
    passing = pass_over(walk, clean)
    found = passing.both_legs(is_overground=True, look_ahead_s=look_ahead_s)

    assert len(found) >= 18
    assert sum(stride.valid for stride in found) >= 0.9 * len(found)
    for side in ("left", "right"):
        own = [one for one in clean if one.side == side]
        for stride, other in pairs_of([s for s in found if s.side == side and s.valid], own):
            assert stride.a2_w_kg == pytest.approx(other.a2_w_kg, rel=0.03)
            assert stride.initial_contact_s == pytest.approx(other.initial_contact_s, abs=0.005)
            assert stride.stride_s is None or stride.stride_s > 2  # no neighbor was seen
    # On a treadmill each of them would have lost its other foot.
    assert not any(stride.valid for stride in passing.both_legs(look_ahead_s=look_ahead_s))


def test_one_plate_and_one_leg_are_enough(treadmill):
    walk, clean = treadmill
    found = pass_over(walk, clean).one_leg(is_overground=True)
    own = [one for one in clean if one.side == "left"]

    assert sum(stride.valid for stride in found) >= 9
    for stride, other in pairs_of([s for s in found if s.valid], own):
        assert stride.a2_w_kg == pytest.approx(other.a2_w_kg, rel=0.03)


@pytest.mark.parametrize("load", [0.4, 0.6])
def test_a_foot_that_is_half_beside_its_plate_does_not_count(treadmill, load):
    walk, clean = treadmill
    found = pass_over(walk, clean, load=load).both_legs(is_overground=True)

    assert found
    assert all(RejectionReason.WEIGHT in stride.reasons for stride in found)


@pytest.mark.parametrize("is_stored", [False, True])
def test_signals_over_plates_are_replayed_as_a_source(treadmill, tmp_path, is_stored):
    """The steps that ``python -m rehab.gait --overground`` finds are those that a source sends.

    A stored recording says by itself that it is of plates in a floor.
    """
    walk, clean = treadmill
    passing, path = pass_over(walk, clean), tmp_path / "plates.csv"
    legs = {side: LegSamples(*getattr(passing, side)) for side in ("left", "right")}
    save_signals(path, passing.t_s, legs, None, is_overground=is_stored)
    arguments = ["--mass", str(walk.mass_kg), "--rate", str(walk.rate_hz), "--token", "t"]
    display = Display(make_phase("training"), None, "explicit")
    played = {}
    for mode in ([], ["--overground"]):
        options = make_parser("recording", RecordingSource).parse_args(
            [str(path), *arguments, *mode]
        )
        play = RecordingSource(options, lambda _text: None).open_walk(Side.LEFT)
        played[bool(mode)] = [
            stride.value for stride in iter(partial(play, display), None) if not stride.reasons
        ]

    measured = passing.both_legs(is_overground=True, look_ahead_s=0.05)
    values = [stride.a2_w_kg for stride in measured if stride.valid]
    assert played[True] == pytest.approx(values, rel=1e-3)
    assert len(values) > 5
    assert played[False] == (played[True] if is_stored else [])
