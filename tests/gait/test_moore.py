"""Against the offline reference of a recorded walk (data/raw/moore2013_s15_pre)."""

import numpy as np
import pytest

from rehab.gait import Flag, RejectionReason, StrideDetector
from tests.gait.walks import pair_up, read_moore

pytestmark = pytest.mark.matrix

LOOK_AHEADS = [0.0, 0.05]


@pytest.fixture(scope="module")
def moore():
    return read_moore()


@pytest.fixture(scope="module")
def found(moore):
    walk, _ = moore
    return {look: walk.both_legs(look_ahead_s=look) for look in LOOK_AHEADS}


def pairs_of(moore, strides):
    _, reference = moore
    for side in ("left", "right"):
        own = [stride for stride in strides if stride.side == side]
        yield from zip(
            pair_up(own, [r["hs"] for r in reference[side]]), reference[side], strict=True
        )


def is_late(walk, time_s):
    """Return whether samples came late there: the reference takes their stamps for true."""
    stalls_s = walk.t_s[1:][np.diff(walk.t_s) > 0.015]
    return bool(((stalls_s > time_s - 0.03) & (stalls_s < time_s + 0.2)).any())


def test_contacts(moore, found):
    pairs = list(pairs_of(moore, found[0.0]))
    hit = [(stride, r) for stride, r in pairs if stride is not None]
    missed, false = len(pairs) - len(hit), len(found[0.0]) - len(hit)
    begins, ends = (
        np.array([getattr(s, ours) - r[theirs] for s, r in hit if not is_late(moore[0], r[theirs])])
        * 1000
        for ours, theirs in (("initial_contact_s", "hs"), ("terminal_contact_s", "to"))
    )

    assert missed + false == 0
    assert abs(begins.mean()) <= 3
    assert begins.std() <= 4
    assert abs(ends.mean()) <= 3
    assert ends.std() <= 4


@pytest.mark.parametrize(
    ("look_ahead_s", "mean_error", "p95"), [(0.0, 0.0125, 0.03), (0.05, 0.003, 0.006)]
)
def test_a2(moore, found, look_ahead_s, mean_error, p95):
    values = np.array(
        [
            (stride.a2_w_kg, r["a2_w_per_kg"])
            for stride, r in pairs_of(moore, found[look_ahead_s])
            if stride is not None and stride.valid and r["valid"]
        ]
    )
    errors = np.abs(values[:, 0] / values[:, 1] - 1)

    assert len(values) >= 74
    assert errors.mean() <= mean_error
    assert np.percentile(errors, 95) <= p95
    assert np.corrcoef(values.T)[0, 1] >= 0.995
    assert values[:, 0].mean() == pytest.approx(values[:, 1].mean(), rel=0.01)


def test_the_stance_that_the_record_cuts_off(moore, found):
    """The left foot still bears 786 N in the last sample; the reference ends its stance there."""
    walk, _ = moore
    for strides in found.values():
        (stride,) = [s for s in strides if RejectionReason.CUT_OFF in s.reasons]
        assert (stride.side, stride.valid, stride.a2_w_kg) == ("left", False, None)
        assert stride.terminal_contact_s == walk.t_s[-1]
        assert stride.stride_s == pytest.approx(1.327, abs=0.005)
        assert stride.first_double_support_s == pytest.approx(0.244, abs=0.01)


def test_only_strides_whose_push_off_came_late_are_invalid(moore, found):
    invalid = [s for s in found[0.05] if not s.valid and RejectionReason.CUT_OFF not in s.reasons]

    assert len(invalid) == 12
    for stride in invalid:
        assert RejectionReason.LATE in stride.reasons
        assert stride.late_s > 0.01
    put_back = [s for s in found[0.05] if s.valid and Flag.LATE in s.flags]
    assert max(s.late_s for s in put_back) > 0.12


def test_two_legs_know_more(found):
    whole = [s for s in found[0.05] if s.valid and s.stride_s and s.step_s]

    assert len(whole) > 70
    assert all(s.stride_s == pytest.approx(s.stance_s + s.swing_s, abs=0.2) for s in whole)
    assert np.mean([s.weight_ratio for s in whole]) == pytest.approx(1.03, abs=0.01)
    for support in ("first_double_support_s", "second_double_support_s"):
        assert 0.15 < np.mean([getattr(s, support) for s in whole]) < 0.3
    assert np.mean([s.step_s / s.stride_s for s in whole]) == pytest.approx(0.5, abs=0.02)


@pytest.mark.parametrize("look_ahead_s", LOOK_AHEADS)
@pytest.mark.parametrize("size", [1, 3, 7, 50, 1000, 10**6])
def test_the_same_in_any_chunks(moore, found, size, look_ahead_s):
    walk, _ = moore
    assert walk.in_chunks(size, look_ahead_s=look_ahead_s) == found[look_ahead_s]


def test_one_leg_gives_the_same_numbers_as_two(moore, found):
    walk, _ = moore
    own = [stride for stride in found[0.05] if stride.side == "left"]

    for one, two in zip(walk.one_leg(look_ahead_s=0.05), own, strict=True):
        assert one.a2_w_kg == two.a2_w_kg
        assert one.initial_contact_s == two.initial_contact_s


def test_rates_agree(moore):
    walk, _ = moore
    slow = walk.one_leg()
    grid = np.arange(0, walk.t_s[-1], 0.001)
    leg = [np.interp(grid, walk.t_s, channel) for channel in walk.left]
    fast = StrideDetector(1000, walk.mass_kg, look_ahead_s=0.05).feed(grid, *leg)

    pairs = zip(pair_up(fast, [s.initial_contact_s for s in slow]), slow, strict=True)
    ratios = [a.a2_w_kg / b.a2_w_kg for a, b in pairs if a is not None and b.valid]
    assert len(ratios) > 35
    assert np.abs(np.array(ratios) - 1).max() < 0.01
