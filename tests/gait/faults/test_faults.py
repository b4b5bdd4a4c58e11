"""The corners of the fault bench, whose whole table `make bench` prints."""

from dataclasses import replace

import numpy as np
import pytest

from rehab.gait import Flag
from rehab.gait.contacts.drag import find_edge
from tests.gait.faults.bench import (
    CERTAIN_DRAGS,
    FAULTS,
    RECORDINGS,
    SLOW_STRIDES_S,
    open_walk,
    try_fault,
)
from tests.gait.faults.spoil import lose, shake, stall
from tests.gait.faults.tally import count
from tests.gait.walks import make_walk, pair_up

pytestmark = pytest.mark.matrix


@pytest.mark.parametrize("name", RECORDINGS)
@pytest.mark.parametrize("width_ms", [15, 50, 150])
def test_samples_that_come_late_are_put_back(name, width_ms):
    tally = try_fault(name, f"stall {width_ms} ms")

    assert tally.wrong == 0
    assert tally.lost <= 0.05 * tally.strides


@pytest.mark.parametrize("name", RECORDINGS)
@pytest.mark.parametrize("width_s", [0.03, 0.082, 0.15])
def test_stalls_of_inverse_dynamics_by_stamp(name, width_s):
    """Those before 55 % of stance do no harm and stay; the others are not shown."""
    walk, clean = open_walk(name)
    stance_s = np.median([s.stance_s for s in clean])
    before = (0.0, max(0.02, 0.5 - 1.6 * width_s / stance_s))
    kept = count(stall(walk, clean, width_s, by_stamp=True, share=before).both_legs(), clean)
    shown = count(stall(walk, clean, width_s, by_stamp=True, share=(0.6, 0.9)).both_legs(), clean)

    assert kept.wrong == shown.wrong == 0
    assert kept.lost <= 0.05 * kept.strides
    assert shown.lost >= 0.9 * shown.strides


@pytest.mark.parametrize("name", RECORDINGS)
@pytest.mark.parametrize("width_s", [0.03, 0.12])
def test_lost_samples(name, width_s):
    walk, clean = open_walk(name)
    early = lose(walk, clean, width_s, share=(0.05, 0.3)).both_legs()
    tally, late = count(early, clean), count(lose(walk, clean, width_s).both_legs(), clean)

    assert tally.wrong == late.wrong == 0
    assert tally.lost <= 0.05 * tally.strides
    assert (width_s < 0.05) == (not any(Flag.LOST in s.flags for s in early))


@pytest.mark.parametrize("name", ["100 Hz", "1 kHz"])
def test_times_by_frame_number_tell_a_loss_exactly(name):
    walk, clean = open_walk(name)
    by_frame = replace(walk, t_s=np.arange(len(walk.t_s)) / walk.rate_hz)
    broken = lose(by_frame, clean, 0.12, share=(0.05, 0.3))
    lost_s = np.diff(broken.t_s) - 1 / walk.rate_hz
    told = [s for s in broken.both_legs() if s.side == "left" and Flag.LOST in s.flags]

    assert len(told) >= 0.9 * len([s for s in clean if s.side == "left"])
    assert all(np.abs(lost_s - s.lost_s).min() < 1e-9 for s in told)
    assert all(s.late_s < 1e-9 for s in told)


@pytest.mark.parametrize("name", RECORDINGS)
@pytest.mark.parametrize("fault", [name for name in FAULTS if name.startswith("drag")])
def test_a_foot_that_drags(name, fault):
    tally = try_fault(name, fault)

    assert tally.wrong == 0
    assert tally.lost <= 0.1 * tally.strides


@pytest.mark.parametrize("name", RECORDINGS)
@pytest.mark.parametrize("side", ["left", "right"])
@pytest.mark.parametrize("fault", CERTAIN_DRAGS)
def test_contacts_of_a_foot_that_drags(name, side, fault):
    """Of moore2013 99 % are within 20 ms, of the others all but one of 8500."""
    tally = try_fault(name, fault, side)

    assert np.mean(np.array(tally.contacts_s) < 0.02) > 0.92
    assert tally.contacts_s[-1] < 0.045


def test_a_drag_that_may_begin_before_the_foot_leaves_is_taken_in_the_middle():
    """Two walks of the same force: its foot leaves when 20 N are left, and drags by 45 N.

    Dragged all along it leaves 20 N before the force rests, at 0.080 s; dragged by what it does not
    bear any more, it would have shed the rest after that, at 0.125 s.
    """
    time_s = np.arange(0.02, 0.3, 0.001)
    dragged_all_along = np.maximum(100 - 1000 * time_s, 0) + 45
    dragged_at_the_end = np.maximum(145 - 1000 * time_s, 45)
    edge = find_edge(dragged_at_the_end, 1000, 0.0, 20.0, 8.0)

    assert (dragged_all_along == dragged_at_the_end).all()
    assert abs(time_s[0] + edge / 1000 - 0.080) < 0.03
    assert abs(time_s[0] + edge / 1000 - 0.125) < 0.03


@pytest.mark.parametrize("name", RECORDINGS)
@pytest.mark.parametrize("width_ms", [100, 200])
def test_gaps_that_were_filled_with_a_straight_line(name, width_ms):
    """Of each second stride's two thirds are in late stance; what is filled before does no harm."""
    tally = try_fault(name, f"gaps of {width_ms} ms filled straight")

    assert tally.wrong == 0
    assert 0.2 * tally.strides < tally.lost <= 0.5 * tally.strides


@pytest.mark.parametrize("name", RECORDINGS)
def test_clonus_is_kept_and_flagged(name):
    walk, clean = open_walk(name)
    found = [s for s in shake(walk, clean, 1.0).both_legs() if s.side == "left"]

    assert count(found, clean).lost == count(found, clean).wrong == 0
    assert np.mean([Flag.CLONUS in s.flags for s in found]) > 0.9
    assert not any(Flag.CLONUS in s.flags for s in clean)


@pytest.mark.parametrize("stride_s", SLOW_STRIDES_S)
@pytest.mark.parametrize("rate_hz", [100, 1000])
def test_slow_gait(stride_s, rate_hz):
    walk, truth = make_walk(
        rate_hz=rate_hz, stride_s=stride_s, a2_w_kg=0.5, mass_kg=70.0, strides=15
    )
    found = [s for s in walk.both_legs() if s.side == "left"]
    pairs = pair_up(found, [stride.initial_contact_s for stride in truth])

    assert all(stride is not None and stride.valid for stride in pairs)


@pytest.mark.parametrize("fault", [name for name in FAULTS if name.startswith("swap")])
@pytest.mark.parametrize("name", RECORDINGS)
def test_swapped_channels_make_no_valid_stride(name, fault):
    assert try_fault(name, fault).lost == try_fault(name, "none").strides


@pytest.mark.parametrize("ms", [-100, -50, 50, 100])
@pytest.mark.parametrize("name", RECORDINGS)
def test_a_moment_out_of_time(name, ms):
    tally = try_fault(name, f"moment {ms:+d} ms")

    assert tally.wrong == 0
    assert tally.lost == tally.strides


@pytest.mark.parametrize("name", RECORDINGS)
def test_an_angle_out_of_time_is_another_person_until_it_is_shown(name):
    """Early by 100 ms the foot would lift its toes while it pushes; late it is only unusual."""
    walk, clean = open_walk(name)
    early = try_fault(name, "angle -100 ms")
    late = [s for s in FAULTS["angle +100 ms"](walk, clean).both_legs() if s.valid]

    assert early.wrong <= 1
    assert early.lost >= early.strides - 1
    assert np.mean([Flag.UNUSUAL_TIMING in s.flags for s in late]) > 0.9
    assert all(s.a2_sd_w_kg > 0.1 * s.a2_w_kg for s in late if Flag.UNUSUAL_TIMING in s.flags)
    assert not any(Flag.UNUSUAL_TIMING in s.flags for s in clean)


@pytest.mark.parametrize(
    "fault", [f"drift of {c} to {ms:+d} ms" for c in ("angle", "moment") for ms in (-100, 100)]
)
@pytest.mark.parametrize("name", RECORDINGS)
def test_channels_that_drift(name, fault):
    """By 3 ms a stride: told once the slope is sure, later where strides scatter (moore2013)."""
    tally = try_fault(name, fault)

    assert tally.wrong <= (15 if name == "moore" else 8)
    assert tally.lost >= 0.5 * tally.strides


@pytest.mark.parametrize("name", RECORDINGS)
@pytest.mark.parametrize("fault", ["toes first", "drag 90 N, first third", "clonus 1"])
def test_strides_of_stroke_are_kept(name, fault):
    tally = try_fault(name, fault)

    assert tally.wrong == tally.lost == 0


@pytest.mark.parametrize("name", RECORDINGS)
@pytest.mark.parametrize(
    ("fault", "code"),
    [
        ("moment -5 Nm", "moment_"),
        ("moment +5 Nm", "moment_"),
        ("mass × 1.2", "weight"),
        ("the knee's angle", "angle_other"),
        ("cane 10%", "other_load"),
        ("cane 15%", "other_load"),
    ],
)
def test_what_no_stride_shows_is_told_and_not_shown(name, fault, code):
    """Where A2 is off by more than a tenth, no stride is shown until a person has looked."""
    walk, clean = open_walk(name)
    spoiled = FAULTS[fault](walk, clean)
    strides = spoiled.both_legs()
    codes = {finding.code for finding in spoiled.check(strides).findings}

    assert any(one.startswith(code) for one in codes) or not any(s.valid for s in strides)
    assert try_fault(name, fault).wrong == 0
    assert not {"moment_zero", "other_load"} & {f.code for f in walk.check(clean).findings}


@pytest.mark.parametrize("fault", ["scuff 60 N", "straddle"])
@pytest.mark.parametrize("name", RECORDINGS)
def test_steps_that_go_wrong(name, fault):
    tally = try_fault(name, fault)

    assert tally.wrong == 0
    assert tally.lost <= 0.6 * tally.strides
