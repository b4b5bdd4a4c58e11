"""What the self-check tells the therapist, and how well it knows the lag."""

from dataclasses import replace

import numpy as np
import pytest

from rehab.gait import LegSamples, check_signals
from rehab.gait.contacts.contact_finder import STUCK_S
from rehab.gait.selfcheck.cures import CURES
from rehab.gait.stances.lag_watch import BRAKING_S
from rehab.gait.stances.plausibility import STANCE_MAX_S
from rehab.gait.strides import RejectionReason
from tests.gait.walks import ANGLE, FORCE, MOMENT, make_walk, read_moore

pytestmark = pytest.mark.matrix


def check(walk, **settings):
    return check_signals(
        walk.t_s,
        LegSamples(*walk.left),
        LegSamples(*walk.right),
        **{"rate_hz": walk.rate_hz, "mass_kg": walk.mass_kg} | settings,
    )


def shift(walk, lag_s):
    """Let the angles of both legs come later."""
    return walk.change(ANGLE, lambda x: np.interp(walk.t_s - lag_s, walk.t_s, x), both=True)


@pytest.fixture(scope="module")
def moore():
    return read_moore()[0]


@pytest.fixture(scope="module")
def synthetic():
    return make_walk(rate_hz=500)[0]


def test_a_good_recording_is_good(moore):
    found = check(moore)

    assert not found.findings
    assert found.strides == 86
    assert found.weight_ratio == pytest.approx(1.03, abs=0.01)
    assert found.rate_hz == pytest.approx(100, rel=0.01)


@pytest.mark.parametrize("lag_s", [-0.1, -0.05, -0.02, 0.02, 0.05, 0.1])
def test_braking_is_unusual_beyond_what_people_do_and_never_a_lag(moore, lag_s):
    found = check(shift(moore, lag_s))
    least_s, most_s = BRAKING_S
    unusual = {f.side for f in found.findings if f.code == "timing_unusual"}

    assert found.lag_s is None
    assert not any("@" in f.message or f.code == "lag" for f in found.findings)
    assert unusual == {
        side
        for side, at_s in found.deceleration_s.items()
        if at_s is not None and not least_s <= at_s <= most_s
    }
    if lag_s > 0.03:
        assert unusual == {"left", "right"}


@pytest.mark.parametrize("side", ["left", "right"])
@pytest.mark.parametrize("lag_s", [-0.01, 0.01])
def test_one_leg_knows_its_own_lag_too(moore, side, lag_s):
    own = {side: check(moore).deceleration_s[side]}
    shifted = shift(moore, lag_s)
    legs = {"left": None, "right": None} | {side: LegSamples(*getattr(shifted, side))}
    found = check_signals(
        shifted.t_s,
        legs["left"],
        legs["right"],
        rate_hz=100,
        mass_kg=moore.mass_kg,
        own_deceleration_s=own,
    )

    assert found.lag_s == pytest.approx(lag_s, abs=0.003)
    assert found.weight_ratio is None


@pytest.mark.parametrize("kind", [{}, {"stride_s": 1.8, "a2_w_kg": 0.6}, {"a2_w_kg": 5.0}])
@pytest.mark.parametrize("lag_s", [-0.01, 0.004, 0.01])
def test_the_own_mark_makes_the_lag_sure(kind, lag_s):
    walk, _ = make_walk(rate_hz=250, **kind)
    own = {side: mark for side, mark in check(walk).deceleration_s.items() if mark is not None}
    found = check(shift(walk, lag_s), own_deceleration_s=own)

    assert found.lag_s == pytest.approx(lag_s, abs=0.001)
    assert "lag" in {finding.code for finding in found.findings}


FAULTS = {
    "moment_sign": (MOMENT, lambda x: -x),
    "power_reversed": (ANGLE, lambda x: -x),
    "force_sign": (FORCE, lambda x: -x),
    "force_unit": (FORCE, lambda x: x / 1000),
    "moment_too_large": (MOMENT, lambda x: 1000 * x),
    "moment_too_small": (MOMENT, lambda x: x / 1000),
    "angle_too_large": (ANGLE, np.degrees),
    "angle_flat": (ANGLE, lambda x: 0 * x),
    "force_lost": (FORCE, lambda x: np.nan * x),
    "no_strides": (FORCE, lambda x: 0 * x),
    "offset": (FORCE, lambda x: x + 30),
    "moment_in_swing": (MOMENT, lambda x: x + 25),
    "weight": (FORCE, lambda x: 0.8 * x),
}


@pytest.mark.parametrize("code", FAULTS)
def test_a_fault_is_named(synthetic, moore, code):
    row, change = FAULTS[code]
    for walk in (synthetic, moore):
        findings = check(walk.change(row, change, both=True)).findings

        assert code in {finding.code for finding in findings}
        assert all(len(finding.message.split()) > 5 for finding in findings)


def test_millinewtons(synthetic):
    codes = {f.code for f in check(synthetic.change(FORCE, lambda x: 1000 * x)).findings}
    assert "force_unit" in codes


@pytest.mark.parametrize(("factor", "percent"), [(0.8, 63), (0.88, 57), (1.14, 44), (1.25, 40)])
def test_a_wrong_mass_is_named_with_one_leg(synthetic, factor, percent):
    mass_kg = synthetic.mass_kg * factor
    leg = LegSamples(*synthetic.left)
    settings = {"rate_hz": synthetic.rate_hz, "mass_kg": mass_kg}
    (finding,) = [
        f
        for f in check_signals(synthetic.t_s, leg, None, **settings).findings
        if f.code == "weight_unusual"
    ]

    assert f"carries {percent} % of {mass_kg:g} kg" in finding.message
    assert finding.side == "left"


def test_a_wrong_mass_or_rate_is_named(synthetic):
    heavy = check(replace(synthetic, mass_kg=90.0)).findings
    assert any("carry 83 % of 90 kg" in finding.message for finding in heavy)
    fast = check(synthetic, rate_hz=250).findings
    assert any("500 Hz, not 250 Hz" in finding.message for finding in fast)
    late = check(replace(synthetic, t_s=synthetic.t_s * 1000)).findings
    assert any("not milliseconds" in finding.message for finding in late)


def test_every_reason_of_the_set_up_has_a_cure():
    of_the_walker = {
        RejectionReason.SHORT_STANCE,
        RejectionReason.IRREGULAR,
        RejectionReason.CUT_OFF,
    }
    of_its_own = {RejectionReason.RATE}  # told from the times themselves
    assert set(CURES) == set(RejectionReason) - of_the_walker - of_its_own
    assert STANCE_MAX_S < STUCK_S
