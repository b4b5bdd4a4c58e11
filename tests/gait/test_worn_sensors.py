"""Sensors on feet and shanks: real walks, healthy and after a stroke, and what may go wrong."""

import math

import numpy as np
import pytest

from rehab.gait import GaitInputError, WearableDetector
from rehab.gait.__main__ import main
from rehab.gait.wearables import Doubt
from tests.support.other_walkers import OTHERS
from tests.support.simulated_leg import (
    STRIDE_S,
    SWING_S,
    random_mounting,
    stand,
    stretch_a_swing,
    turn_foot,
    walk_foot,
)
from tests.support.worn_sensors import (
    captured_walks,
    find_contacts,
    match,
    measure,
    stroke_walks,
    turning_walks,
)

# --- Real walks ---


@pytest.mark.parametrize(
    ("name", "strides"),
    [("pp03_002", 121), ("pp03_003", 116), ("pp03_005", 114), ("pp03_006", 113)],
)
def test_the_weakest_foot_is_found_with_the_right_sign(name, strides):
    """A fixed threshold of 1.75 rad/s found 89, 109, 5 and 31 of them, twice with the wrong sign.

    The shank of the same leg is weaker still. Sensors of all feet sit alike: y to the right.
    """
    for walk in stroke_walks(f"{name}_right"):
        found, detector = measure(walk)
        assert strides <= len(found) <= strides + 6
        assert detector.left[1] < -0.8
        assert 0.55 < np.median([one.stance_share for one in found]) < 0.75
        times = np.array([one.stride_s for one in found])
        assert times.std() / times.mean() < 0.12


def test_the_sign_is_not_taken_from_a_leg_that_is_hardly_known():
    """It begins in the middle of a walk, as after a reload, and swings around as much as ahead."""
    (walk,) = stroke_walks("pp01_003_leftfoot")
    later = walk.picked((walk.t_s >= 52.85) & (walk.t_s < 77.85))
    found, detector = measure(later)
    assert detector.left[1] < -0.5
    assert len(found) >= 8


@pytest.mark.parametrize("begin_s", np.arange(0, STRIDE_S, 0.2))
def test_the_sign_is_known_soon_wherever_a_walk_begins(begin_s):
    t_s, rate, acceleration = walk_foot(begin_s + 7)
    later = t_s >= begin_s
    detector = WearableDetector("foot")
    assert len(detector.feed(t_s[later], rate[later], acceleration[later])) >= 3
    assert detector.left[1] > 0.8


def test_the_wobble_of_a_foot_that_has_landed_prolongs_no_swing():
    walk = next(stroke_walks("pp03_003_leftfoot")).picked(slice(1500, 4500))
    times = [one.stride_s for one in measure(walk)[0]]
    assert len(times) >= 26
    assert max(times) < 1.25 * np.median(times)


@pytest.mark.parametrize("name", OTHERS)
def test_other_people_and_sensors_lose_no_stride(name):
    walk = next(stroke_walks("pp03_005_leftfoot")).picked(slice(0, 4000))
    plain, found = measure(walk)[0], measure(OTHERS[name](walk))[0]
    assert abs(len(found) - len(plain)) <= 1


def test_a_rate_alone_has_the_right_sign_too():
    for walk in stroke_walks("pp03_002_right", "pp04_000_left"):
        detector = WearableDetector(walk.place)
        assert len(detector.feed(walk.t_s, walk.rate[:, 1])) >= 113
        assert detector.left[0] == -1


@pytest.mark.parametrize("rate_hz", [204.8, pytest.param(100, marks=pytest.mark.wide), 50])
def test_contacts_are_those_of_motion_capture(rate_hz):
    for walk in captured_walks():
        found, _ = measure(walk if rate_hz == 204.8 else walk.thinned(rate_hz))
        counted, _ = find_contacts([one for one in found if not one.reasons])
        initial, terminal = find_contacts(found)
        for true, times in ((walk.initial_s, initial), (walk.terminal_s, terminal)):
            late_s = match(times, true)
            assert np.isnan(late_s).sum() <= 1
            assert abs(np.nanmean(late_s)) < 0.010
            assert np.nanstd(late_s) < 0.008
        inside = (counted > walk.initial_s[0]) & (counted < walk.initial_s[-1])
        assert not np.isnan(match(walk.initial_s, counted[inside], 0.3)).any()


@pytest.mark.parametrize("seed", range(3))
def test_a_sensor_may_be_mounted_in_any_way(seed):
    matrix = random_mounting(seed)
    (walk,) = (one for one in captured_walks(is_rotated=False) if one.name.endswith("left"))
    walk = walk.thinned(60)
    plain, straight = measure(walk)
    found, turned = measure(walk.turned(matrix))
    assert len(found) == len(plain)
    for one, other in zip(found, plain, strict=True):
        assert one.initial_contact_s == pytest.approx(other.initial_contact_s, abs=0.001)
    assert matrix @ straight.left == pytest.approx(turned.left, abs=0.01)


def test_straight_walks_are_found_and_turns_are_flagged():
    missed = known = 0
    for walk in turning_walks("1-1", "5-2", "9-1"):
        found, _ = measure(walk)
        (begin_s, end_s), (turn_s, straight_s) = walk.facts["trial_s"], walk.facts["turn_s"]
        initial, _ = find_contacts(found)
        there = walk.initial_s[(walk.initial_s >= begin_s) & (walk.initial_s < turn_s)][1:-1]
        back = walk.initial_s[(walk.terminal_s > straight_s) & (walk.initial_s <= end_s)][1:-1]
        late_s = match(initial, np.concatenate((there, back)))
        missed, known = missed + int(np.isnan(late_s).sum()), known + len(late_s)
        for one in found:
            if one.end_s > turn_s and one.initial_contact_s < straight_s and not one.reasons:
                ends = np.array([one.initial_contact_s, one.end_s])
                assert not np.isnan(match(walk.initial_s, ends, 0.2)).any()
            if not one.reasons:
                assert begin_s - 0.5 < one.initial_contact_s
                assert one.end_s < end_s + 0.5
    assert missed <= 0.02 * known


def test_foot_and_shank_of_a_leg_agree():
    foot, shank = (measure(walk)[0] for walk in stroke_walks("pp06_003_left"))
    for mine, others in zip(find_contacts(foot), find_contacts(shank), strict=True):
        late_s = match(others, mine)
        assert abs(np.nanmedian(late_s)) < 0.015
        assert np.nanstd(late_s) < 0.015


# --- What a stride says ---


def test_figures_of_a_simulated_foot():
    found = WearableDetector("foot").feed(*walk_foot(30))
    assert len(found) >= 22
    for one in found:
        assert one.stride_s == pytest.approx(STRIDE_S, abs=0.002)
        assert one.initial_contact_s % STRIDE_S == pytest.approx(SWING_S, abs=0.01)
        assert one.cadence_min == pytest.approx(100, abs=0.5)
        # Its slap turns it by 5 · 2/π · 0.1 rad from toes-up to flat.
        assert one.foot_strike_rad == pytest.approx(0.318, abs=0.02)
        assert one.push_off_rad_s == pytest.approx(5.5, abs=0.1)
        assert one.shank_lean_rad is None
        assert one.reasons == ()


def test_a_shank_leans_against_how_it_stood():
    t_s, rate, acceleration = walk_foot(40)
    still = t_s < 3
    rate[still], acceleration[still] = (part[: still.sum()] for part in stand(t_s[still]))
    found = WearableDetector("shank").feed(t_s, rate, acceleration)
    assert len(found) > 20
    for one in found[5:]:
        assert one.foot_strike_rad is None
        assert one.push_off_rad_s is None
        # By its terminal contact, 39 ms before the swing, the heel rose by most of 0.7 rad.
        assert one.shank_lean_rad == pytest.approx(0.62, abs=0.1)


@pytest.mark.parametrize("size", [1, 7, 1000])
def test_the_same_in_any_chunks(size):
    walk = next(stroke_walks("pp03_002_rightfoot"))
    cut = slice(0, 3000)
    whole = WearableDetector("foot").feed(walk.t_s[cut], walk.rate[cut], walk.acceleration[cut])
    detector, found = WearableDetector("foot"), []
    for first in range(0, 3000, size):
        part = slice(first, min(first + size, 3000))
        found += detector.feed(walk.t_s[part], walk.rate[part], walk.acceleration[part])
    assert found == whole


def test_a_stride_is_known_soon():
    walk = next(stroke_walks("pp03_005_leftshank"))
    detector, waits = WearableDetector("shank"), []
    for t_s, rate, acceleration in zip(
        walk.t_s.tolist(), walk.rate.tolist(), walk.acceleration.tolist(), strict=True
    ):
        found = detector.add(t_s, tuple(rate), tuple(acceleration))
        waits += [t_s - one.end_s for one in found[-1:]]
    assert max(waits[1:]) <= 0.15  # the first ones wait until the sign is known


# --- What may go wrong ---


def test_standing_and_shuffling_are_silent():
    t_s = np.arange(0, 60, 0.01)
    for sway in (0.0, 0.05, 0.4):
        assert WearableDetector("foot").feed(t_s, *stand(t_s, sway)) == []
    rate, acceleration = stand(t_s)
    rate[:, 1] += 1.5 * np.sin(2 * np.pi * 6 * t_s)  # clonus, or a hand on the sensor
    assert WearableDetector("foot").feed(t_s, rate, acceleration) == []
    assert WearableDetector("foot").feed(t_s, np.full((len(t_s), 3), np.nan)) == []


def test_a_person_who_has_walked_stands_silently():
    t_s, rate, acceleration = walk_foot(60)
    later = t_s > 20
    rate[later], acceleration[later] = stand(t_s[later], sway=0.4)
    found = WearableDetector("foot").feed(t_s, rate, acceleration)
    assert 15 <= len(found) <= 17
    assert found[-1].end_s < 20.5


def test_a_gap_costs_its_strides_and_lost_samples_are_named():
    t_s, rate, acceleration = walk_foot(60)
    phase = t_s % STRIDE_S
    beside = (np.abs(t_s - 24.4) < 0.031) | (np.abs(t_s - 36) < 0.2)
    found = WearableDetector("foot").feed(t_s[~beside], rate[~beside], acceleration[~beside])
    whole = WearableDetector("foot").feed(t_s, rate, acceleration)
    assert phase[np.searchsorted(t_s, 24.4)] == pytest.approx(SWING_S)
    assert len(whole) - len(found) == 2  # it hides the contact between two
    assert not any(Doubt.SENSOR_MOVED in one.reasons for one in found)
    lost = [one for one in found if Doubt.SAMPLES_LOST in one.reasons]
    assert 1 <= len(lost) <= 2
    assert all(abs(at - 24.4) < 0.1 for at in {lost[0].end_s, lost[-1].initial_contact_s})


def test_a_slow_sensor_is_named():
    t_s, rate, acceleration = walk_foot(30, rate_hz=40)
    found = WearableDetector("foot").feed(t_s, rate, acceleration)
    assert found
    assert all(Doubt.LOW_RATE in one.reasons for one in found)


def test_a_turn_and_a_pause_do_not_count():
    t_s, rate, acceleration = walk_foot(40)
    turning = (t_s > 20) & (t_s < 22)
    rate[turning, 2] += math.pi / 2
    found = WearableDetector("foot").feed(t_s, rate, acceleration)
    flagged = [one for one in found if Doubt.TURNING in one.reasons]
    assert 2 <= len(flagged) <= 3
    assert all(one.end_s > 20 and one.initial_contact_s < 22 for one in flagged)

    t_s, rate, acceleration = walk_foot(40)
    t_s = np.concatenate((t_s[t_s < 20.9], t_s[t_s < 2] + 20.9, t_s[t_s >= 20.9] + 2))
    still = (t_s >= 20.9) & (t_s < 22.9)
    at = np.where(t_s < 20.9, t_s, t_s - 2)
    rate, acceleration = (
        np.stack([np.interp(at, np.arange(0, 40, 0.01), one) for one in part.T], 1)
        for part in (rate, acceleration)
    )
    rate[still], acceleration[still] = stand(t_s[still])
    found = WearableDetector("foot").feed(t_s, rate, acceleration)
    assert [one.initial_contact_s for one in found if Doubt.INTERRUPTED in one.reasons] == [
        pytest.approx(20.8, abs=0.05)
    ]


def test_a_contact_at_another_moment_than_usual_makes_both_its_strides_doubtful():
    found = WearableDetector("foot").feed(*stretch_a_swing(24.0))
    unclear = [one for one in found if Doubt.CONTACT_UNCLEAR in one.reasons]
    assert [round(one.end_s, 1) for one in unclear] == [24.8, 26.0]
    assert len([one for one in found if not one.reasons]) >= len(found) - 2


@pytest.mark.parametrize("trial", ["pp01_000", "pp01_003"])
def test_a_leg_that_turns_back_before_it_lands_has_no_jump_that_counts(trial):
    """Its contacts jump by 0.2 to 0.4 s between two moments, which those of its foot do not."""
    (walk,) = stroke_walks(f"{trial}_leftshank")
    found, _ = measure(walk)
    counts = np.array([not one.reasons for one in found])
    jumps = np.abs(np.diff([one.stance_share for one in found]))
    assert 0.4 < np.mean(counts) < 0.6
    assert jumps.max() > 0.14
    assert jumps[counts[1:] & counts[:-1]].max() < 0.1


@pytest.mark.long
def test_contacts_of_other_legs_are_not_called_unclear():
    own, strides = 0, 0
    for walk in stroke_walks():
        if walk.place == "shank" and not walk.name.startswith("pp01"):
            found, _ = measure(walk)
            own += sum(Doubt.CONTACT_UNCLEAR in one.reasons for one in found)
            strides += len(found)
    assert strides > 3500
    assert own <= 0.003 * strides


@pytest.mark.parametrize("angle_deg", [25, 180])
def test_a_sensor_that_slips_or_turns_over_is_noticed_and_found_anew(angle_deg):
    t_s, rate, acceleration = walk_foot(60)
    turn = math.radians(angle_deg)
    matrix = np.array(
        [[math.cos(turn), 0, math.sin(turn)], [0, 1, 0], [-math.sin(turn), 0, math.cos(turn)]]
    ) if angle_deg < 90 else np.diag([1.0, -1.0, -1.0])  # fmt: skip
    slipped = t_s > 30
    rate[slipped], acceleration[slipped] = (
        rate[slipped] @ matrix.T,
        acceleration[slipped] @ matrix.T,
    )
    detector = WearableDetector("foot")
    found = detector.feed(t_s, rate, acceleration)
    moved = [one for one in found if Doubt.SENSOR_MOVED in one.reasons]
    assert 5 <= len(moved) <= 8
    assert all(one.end_s > 30 for one in moved)
    after = [one for one in found if one.initial_contact_s > moved[-1].initial_contact_s]
    assert len(after) >= 10
    for one in after:
        assert one.initial_contact_s % STRIDE_S == pytest.approx(SWING_S, abs=0.02)
    assert detector.left == pytest.approx(tuple(matrix @ (0, 1, 0)), abs=0.02)


def lift_toes(t_s, begin_s, sign=1.0):
    """Return the rate of a foot whose toes go up by 20° and down again."""
    phase = (t_s - begin_s) / 0.8
    inside = (phase > 0) & (phase < 1)
    return np.where(inside, -sign * 0.349 * math.pi / 0.8 * np.sin(2 * np.pi * phase), 0.0)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_doubt_sends_nothing_until_the_toes_were_lifted(sign):
    """A foot that hardly rests in stance, without an accelerometer: either sign may be right."""
    t_s = np.arange(0, 60, 0.01)
    rate = 3 * np.sin(2 * np.pi * t_s) * (t_s < 30)
    rate = np.where((t_s > 40) & (t_s < 56), turn_foot(t_s), rate)
    rate += lift_toes(t_s, 35, sign)
    detector = WearableDetector("foot")
    begin = t_s < 34
    assert detector.feed(t_s[begin], rate[begin]) == []
    assert detector.is_in_doubt
    found = detector.feed(t_s[~begin], rate[~begin])
    assert not detector.is_in_doubt
    assert detector.left[0] == sign
    assert found


def test_a_step_is_no_answer():
    t_s = np.arange(0, 60, 0.01)
    rate = 3 * np.sin(2 * np.pi * t_s) * (t_s < 30)
    step = (t_s > 35.8) & (t_s < 36.9)
    rate = np.where(step, turn_foot(t_s + 0.8), rate)
    detector = WearableDetector("foot")
    assert detector.feed(t_s, rate) == []
    assert detector.is_in_doubt


def test_what_cannot_be_fed():
    with pytest.raises(GaitInputError, match="Use foot or shank"):
        WearableDetector("thigh")
    with pytest.raises(GaitInputError, match="as many rows"):
        WearableDetector("foot").feed([0.0, 0.1], np.zeros((3, 3)))


def test_the_command_measures_a_sensor(tmp_path, capsys):
    t_s, rate, acceleration = walk_foot(20)
    path = tmp_path / "foot.csv"
    table = np.column_stack([t_s, acceleration, np.degrees(rate)])
    np.savetxt(path, table, "%.9g", ",", header="time,ax,ay,az,gx,gy,gz", comments="")
    columns = "ax,ay,az,gx*0.0174533,gy*0.0174533,gz*0.0174533"
    assert main(["wearable", str(path), "--columns", columns]) == 0
    assert "left is (0.00, 1.00, 0.00)" in capsys.readouterr().out
    assert main(["wearable", str(path), "--columns", "gy*-0.0174533"]) == 0
    assert "left is (-1.00, 0.00, 0.00)" in capsys.readouterr().out
    assert main(["wearable", str(path), "--columns", "gyr"]) == 2
    assert "has no column gyr. It has: time, ax" in capsys.readouterr().err
    assert main(["wearable", str(path), "--columns", "gx"]) == 2
    assert "No strides are found" in capsys.readouterr().err
