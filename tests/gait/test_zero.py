"""The zero of a plate, which is learned in swings, and plates that read less than it at their ends.

A plate's own filter may read below its zero for a moment after it was unloaded. By ten newtons that
is borne; by more it cannot be told from a foot that is dragged, and the zero stays as it was.
"""

from dataclasses import replace

import numpy as np
import pytest

from rehab.gait.contacts.zero import ZERO_SWINGS, PlateZero
from tests.gait.faults.tally import count
from tests.gait.walks import make_walk

WEIGHT_N, RATE_HZ = 700.0, 100.0


def make_ends(least_n):
    """Return the force around both ends of a swing, the first of which reads less."""
    return [np.array([300.0, 60.0, least_n]), np.array([12.0, 12.0, 300.0])]


@pytest.mark.parametrize(("least_n", "offset_n"), [(12.0, 12.0), (3.0, 12.0), (1.0, 0.0)])
def test_a_swing_whose_ends_read_less(least_n, offset_n):
    zero = PlateZero(WEIGHT_N, RATE_HZ)
    zero.learn(np.full(20, 12.0), make_ends(least_n))

    assert zero.offset_n == offset_n


def test_a_zero_that_drifts_is_followed_however_far_it_has_come():
    zero = PlateZero(WEIGHT_N, RATE_HZ)
    for read_n in (12.0, 24.0, 36.0):
        zero.learn(np.full(20, read_n))
    assert zero.offset_n == 24.0  # the median


def test_a_dragged_swing_is_none_of_those_that_agree():
    """A zero that was set anew is the same in swings one after another."""
    zero = PlateZero(WEIGHT_N, RATE_HZ)
    for number in range(2 * ZERO_SWINGS):
        zero.learn(np.full(20, 40.0), make_ends(0.0) if number % ZERO_SWINGS == 0 else ())
        assert zero.offset_n == 0.0
    zero.learn(np.full(20, 40.0))
    assert zero.offset_n == 40.0


def test_an_end_without_values_hides_nothing_of_the_other():
    zero = PlateZero(WEIGHT_N, RATE_HZ)
    zero.learn(np.full(20, 12.0), [np.array([np.nan, 12.0]), np.array([1.0, 300.0])])

    assert zero.offset_n == 0.0


def walk_on(undershoot_n, zero_n):
    """Return a walk of 60 strides on a left plate that undershoots, its strides, and those before.

    The undershoot decays in 15 ms from each terminal contact on.
    """
    walk, _ = make_walk(rate_hz=RATE_HZ, strides=60)
    clean = walk.both_legs()
    force = walk.left[0] + zero_n(np.linspace(0, 1, len(walk.t_s)))
    after = np.exp(-np.arange(3) / 1.5)
    for stride in (one for one in clean if one.side == "left"):
        at = int(np.searchsorted(walk.t_s, stride.terminal_contact_s))
        part = force[at : at + 3]
        part -= undershoot_n * after[: len(part)]
    found = replace(walk, left=np.array([force, *walk.left[1:]])).both_legs()
    return found, clean


@pytest.mark.parametrize("drift_n", [-40.0, 40.0])
def test_a_plate_that_undershoots_by_12_n_is_followed(drift_n):
    found, clean = walk_on(12.0, lambda walked: drift_n * walked)
    tally = count(found, clean)

    assert (tally.lost, tally.wrong) == (0, 0)
    assert tally.contacts_s[-1] < 0.006
    assert [s for s in found if s.side == "left"][-1].offset_n == pytest.approx(drift_n, abs=8)


@pytest.mark.parametrize("undershoot_n", [18.0, 25.0])
@pytest.mark.parametrize("zero_n", [0.0, 12.0])
def test_a_plate_that_undershoots_by_more_costs_milliseconds(undershoot_n, zero_n):
    found, clean = walk_on(undershoot_n, lambda walked: zero_n * np.ones_like(walked))
    tally = count(found, clean)

    assert (tally.lost, tally.wrong) == (0, 0)
    assert tally.contacts_s[-1] < 0.006
