"""What stops a robot, what holds it back, and who lets it go on: each threshold from both sides."""

import math
from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robot.bases import Abilities, BaseState, SensorState
from robot.behavior import safety as rules
from robot.behavior.resistance import MISSED_M, WORK_J
from robot.behavior.safety import Safety
from robot.motion.gestures import BUILT_IN
from robot.motion.pose import HOME, Pose
from robot.motion.twist import STILL, Twist
from tests.support.extent import examples

pytestmark = pytest.mark.matrix

REAL = Abilities(simulated=False, moves=True, announces=True)
SIMULATED = Abilities(simulated=True, moves=True)
FINE = BaseState(HOME, STILL, SensorState(battery_v=15.5))
AHEAD = Twist(0.2, 0.0)


def feeling(**sensors):
    return replace(FINE, sensors=replace(FINE.sensors, **sensors))


class Watch:
    """A safety that is looked at 50 times a second."""

    def __init__(self, abilities=REAL, *, armed=True):
        self.safety, self.now_s = Safety(abilities), 100.0
        self.safety.is_watched = True
        if armed:
            assert self.safety.arm(self.now_s, FINE) == ""
        self.safety.start_gesture(self.now_s, FINE)

    def look(self, state=FINE, ordered=STILL, *, performing=True, for_s=0.02):
        """Return the first latch within a time, and when it came."""
        for tick in range(round(for_s / 0.02)):
            self.now_s += 0.02
            found = self.safety.check(self.now_s, state, ordered, performing=performing)
            if found:
                return found, round((tick + 1) * 0.02, 2)
        return "", for_s


HAZARDS = ["bump", "cliff", "wheel_drop", "over_current", "restarted"]


@pytest.mark.parametrize("hazard", HAZARDS)
@pytest.mark.parametrize("abilities", [REAL, SIMULATED], ids=["real", "simulated"])
@pytest.mark.parametrize("performing", [True, False])
def test_a_hazard_latches_at_the_first_look(hazard, abilities, performing):
    watch = Watch(abilities)
    felt = feeling(hazards=frozenset({hazard}))
    assert watch.look(felt, performing=performing) == (hazard, 0.02)
    assert watch.safety.latch == watch.safety.blocking_reason(FINE) == hazard
    assert watch.look(felt, for_s=1) == ("", 1)  # once; it stays so
    watch.now_s += 60
    assert watch.safety.blocking_reason(FINE) == hazard  # over, and nobody has said so
    assert watch.safety.arm(watch.now_s, felt) == hazard
    assert watch.safety.refused_arms == 1
    watch.now_s += 2
    assert watch.safety.arm(watch.now_s, FINE) == ""
    assert watch.safety.blocking_reason(FINE) == ""


def test_only_an_armed_robot_latches_by_itself():
    watch = Watch(armed=False)
    assert watch.look(feeling(hazards=frozenset({"wheel_drop"})), for_s=1) == ("", 1)  # carried
    assert watch.safety.blocking_reason(feeling(hazards=frozenset({"wheel_drop"}))) == "wheel_drop"
    assert watch.safety.blocking_reason(FINE) == "disarmed"
    assert watch.look(feeling(stop_pressed=True)) == ("button", 0.02)  # a person's word


def test_real_ones_are_armed_by_people_simulated_ones_arm_themselves():
    assert not Safety(REAL).is_armed
    assert Safety(SIMULATED).is_armed
    for abilities, armed in ((REAL, False), (SIMULATED, True)):
        watch = Watch(abilities)
        watch.safety.disconnect()
        assert watch.safety.is_armed is armed


def test_a_persons_stop_is_idempotent_and_ends_with_an_arming():
    watch = Watch()
    for _ in range(3):
        watch.safety.stop("stopped")
    assert watch.safety.blocking_reason(FINE) == "stopped"
    assert watch.safety.arm(watch.now_s, FINE) == ""  # the server knows their order
    assert watch.safety.blocking_reason(FINE) == ""


def test_the_first_cause_stays():
    watch = Watch()
    watch.look(feeling(hazards=frozenset({"bump"})))
    watch.safety.stop("stopped")
    assert watch.safety.latch == "bump"


def test_an_arming_that_nobody_can_have_meant():
    watch = Watch()
    watch.look(feeling(hazards=frozenset({"bump"})))
    assert watch.safety.arm(watch.now_s + 0.5, FINE) == "bump"
    assert watch.safety.arm(watch.now_s + 1.1, FINE) == ""


def test_a_silent_base():
    watch = Watch()
    assert watch.look(feeling(silent_s=0.2)) == ("", 0.02)
    assert watch.look(feeling(silent_s=0.21)) == ("base_silent", 0.02)
    assert watch.safety.arm(watch.now_s + 5, feeling(silent_s=9)) == "base_silent"


def test_a_robot_that_hung_does_not_go_on():
    watch = Watch()
    watch.look()
    watch.now_s += 0.22
    assert watch.look() == ("", 0.02)
    watch.now_s += 0.24
    assert watch.look() == ("order_lapsed", 0.02)


def test_hanging_at_rest_is_nothing():
    watch = Watch()
    watch.look(performing=False)
    watch.now_s += 60
    assert watch.look(performing=False) == ("", 0.02)
    watch.now_s += 60
    watch.safety.start_gesture(watch.now_s, FINE)
    assert watch.look() == ("", 0.02)


@pytest.mark.parametrize("performing", [True, False])
def test_the_tether(performing):
    watch = Watch()
    near, far = replace(FINE, pose=Pose(0.2, 0.2, 0)), replace(FINE, pose=Pose(0, -0.31, 0))
    assert watch.look(near, performing=performing, for_s=1) == ("", 1)
    assert watch.look(far, performing=performing) == ("tether", 0.02)


@pytest.mark.parametrize("share", [1, 0.5, 0.3])  # normal, gentle, small and gentle
@pytest.mark.parametrize(
    ("ordered", "follows", "found"),
    [
        (AHEAD, 0.0, "stalled"),
        (AHEAD, 0.9, ""),
        (AHEAD, -0.25, "stalled"),
        (Twist(-0.2, 0), 0.0, "stalled"),
        (Twist(0, 1.5), 0.0, "stalled"),
        (Twist(0, 1.5), 0.9, ""),
        (Twist(0, -1.5), -0.2, "stalled"),
    ],
    ids=str,
)
def test_a_base_that_is_held_is_noticed_at_any_speed(share, ordered, follows, found):
    """Half a second after what it should do, as fast or as gently as it goes."""
    watch = Watch()
    should = Twist(ordered.v_m_s * share, ordered.w_rad_s * share)
    does = Twist(should.v_m_s * follows, should.w_rad_s * follows)
    latch, after_s = watch.look(replace(FINE, twist=does), should, for_s=0.54)
    assert latch == found
    assert after_s <= 0.54


@pytest.mark.parametrize(
    "pushed", [Twist(0.15, 0), Twist(0.05, 0), Twist(0, 0.5), Twist(0, 0, -0.1)], ids=str
)
def test_a_base_that_moves_unordered_is_noticed(pushed):
    watch = Watch()
    state = replace(FINE, twist=pushed)
    assert watch.look(state, for_s=0.5) == ("", 0.5)
    assert watch.look(FINE) == ("", 0.02)  # and on again: it counts anew
    assert watch.look(state, for_s=0.5) == ("", 0.5)
    assert watch.look(state, for_s=0.04)[0] == "stalled"


def test_way_that_it_misses_is_bounded_however_slow_it_is():
    """A third of the way, for longer and longer: 3 cm of it, and the motors' work with that."""
    for speed_m_s in (0.2, 0.15, 0.1):
        watch = Watch()
        state = replace(FINE, twist=Twist(speed_m_s * 0.6, 0))
        found, after_s = watch.look(state, Twist(speed_m_s, 0), for_s=3)
        assert found == "stalled"
        assert speed_m_s * 0.4 * after_s <= 2 * MISSED_M


def test_a_holonomic_base_that_is_held_on_its_way_aside_is_noticed():
    found, after_s = Watch().look(FINE, Twist(0, 0, 0.1), for_s=0.54)
    assert found == "stalled"
    assert 0.1 * after_s <= 2 * MISSED_M
    aside = replace(FINE, twist=Twist(0, 0, 0.1))
    assert Watch().look(aside, Twist(0, 0, 0.1), for_s=2.0) == ("", 2.0)


def test_a_late_base_makes_up_for_it():
    watch = Watch()
    for _ in range(10):
        for should, does in ((AHEAD, STILL), (AHEAD, AHEAD), (STILL, AHEAD)):
            assert watch.look(replace(FINE, twist=does), should, for_s=0.12) == ("", 0.12)


def test_motors_that_push_while_the_wheels_slip():
    """As against a foot behind, where there is no bumper: the wheels turn as they should."""
    for speed_m_s in (0.2, 0.05, 0.02):
        watch, should = Watch(), Twist(-speed_m_s, 0)
        rolling = replace(feeling(push_n=6.0), twist=should)
        assert watch.look(rolling, should, for_s=10) == ("", 10)
        pushing = replace(feeling(push_n=30.0), twist=should)
        found, after_s = watch.look(pushing, should, for_s=3)
        assert found == "stalled"
        assert 30.0 * speed_m_s * after_s <= 2 * WORK_J


def test_wheels_and_gyro_that_disagree_about_a_gesture():
    watch = Watch()
    watch.safety.start_gesture(watch.now_s, feeling(slip_rad=2.0))
    assert watch.look(feeling(slip_rad=2.17)) == ("", 0.02)
    assert watch.look(feeling(slip_rad=1.82)) == ("slipped", 0.02)
    rest = Watch()
    assert rest.look(feeling(slip_rad=9.0), performing=False) == ("", 0.02)


def test_a_battery_that_runs_down():
    watch = Watch()
    for volts, reason in (
        (13.6, ""),
        (13.4, "battery_low"),
        (13.9, "battery_low"),  # recovered at rest, and soon low again
        (14.1, ""),
        (None, ""),
    ):
        assert watch.safety.blocking_reason(feeling(battery_v=volts)) == reason
    empty = feeling(battery_v=13.1)
    assert watch.look(empty, for_s=0.9) == ("", 0.9)  # a dip
    assert watch.look(FINE) == ("", 0.02)
    found, after_s = watch.look(empty, for_s=2)
    assert (found, 1 <= after_s < 1.1) == ("battery_empty", True)


def test_obstacles_pass_by_themselves():
    watch = Watch()
    assert watch.safety.blocking_reason(feeling(is_charging=True)) == "charging"
    watch.safety.is_watched = False
    assert watch.safety.blocking_reason(FINE) == "unwatched"
    watch.safety.is_watched = True
    assert watch.safety.blocking_reason(FINE) == ""
    assert watch.safety.blocking_reason(feeling(refusal="firmware_refused")) == "firmware_refused"
    assert not watch.safety.latch


states = st.builds(
    BaseState,
    pose=st.builds(Pose, st.floats(-0.4, 0.4), st.floats(-0.4, 0.4), st.floats(-7, 7)),
    twist=st.builds(Twist, st.floats(-0.3, 0.3), st.floats(-2, 2)),
    sensors=st.builds(
        SensorState,
        hazards=st.frozensets(st.sampled_from(HAZARDS), max_size=2),
        stop_pressed=st.booleans(),
        battery_v=st.none() | st.floats(12, 17),
        silent_s=st.floats(0, 0.4),
        slip_rad=st.floats(-0.3, 0.3),
    ),
)
deeds = st.one_of(
    st.tuples(st.just("look"), states, st.booleans(), st.floats(0, 0.4)),
    st.sampled_from([("arm",), ("stop",), ("lose",)]),
)


@settings(max_examples=examples(200), deadline=None)
@given(st.lists(deeds, max_size=40))
def test_nothing_but_an_arming_ends_a_latch(told):
    safety, now_s, state = Safety(REAL), 0.0, FINE
    for what, *more in told:
        before = safety.latch
        now_s += 0.02
        match what:
            case "look":
                state, performing, pause_s = more
                now_s += pause_s
                found = safety.check(now_s, state, AHEAD, performing=performing)
                assert not found or (safety.latch == found and not before)
            case "stop":
                safety.stop(rules.STOPPED)
            case "lose":
                safety.disconnect()
                assert not safety.is_armed
            case "arm":
                assert bool(safety.arm(now_s, state)) == bool(safety.latch)
        if before and what != "arm":
            assert safety.latch == before
            assert safety.blocking_reason(FINE) == before


@pytest.mark.parametrize(
    ("battery_v", "share"), [(17, 1), (16.5, 1), (14.85, 0.525), (13.2, 0.05), (12.9, 0), (0, 0)]
)
def test_a_battery_s_share_follows_from_its_voltage(battery_v, share):
    assert rules.battery_share(battery_v) == pytest.approx(share, abs=0.01)


OPEN = Abilities(simulated=False, moves=True, closed_loop=False)


def test_an_open_loop_refuses_long_gestures_and_halves_the_others():
    closed, opened = Safety(REAL), Safety(OPEN)
    assert (closed.share, opened.share) == (1.0, 0.5)
    for gesture in BUILT_IN.values():
        assert closed.rejection_reason(gesture) == ""
        is_long = gesture.min_duration_s() > 4.0
        assert opened.rejection_reason(gesture) == ("open_loop" if is_long else ""), gesture.name


@pytest.mark.parametrize(
    ("pose", "doubt_rad", "is_home"),
    [
        (Pose(0.05, 0.0, 0.087), 0.035, True),
        (Pose(0.03, 0.03, math.tau + 0.08), 0.0, True),
        (Pose(0.04, 0.04, 0.0), 0.0, False),
        (Pose(0.0501, 0.0, 0.0), 0.0, False),
        (Pose(0.0, 0.0, -0.0871), 0.0, False),
        (Pose(), 0.0351, False),
    ],
)
def test_home_is_near_straight_and_known(pose, doubt_rad, is_home):
    there = BaseState(pose, STILL, SensorState(doubt_rad=doubt_rad))
    assert Safety.is_at_home(there) is is_home


def test_an_open_loop_has_to_be_looked_at_after_twenty_gestures():
    for abilities, refusal in ((REAL, ""), (OPEN, "place_unknown")):
        watch = Watch(abilities)  # which begins the first
        for _ in range(18):
            watch.safety.start_gesture(watch.now_s, FINE)
        assert watch.safety.blocking_reason(FINE) == ""
        watch.safety.start_gesture(watch.now_s, FINE)
        assert watch.safety.blocking_reason(FINE) == refusal
        assert watch.safety.arm(watch.now_s, FINE) == ""
        assert watch.safety.blocking_reason(FINE) == ""
