"""Gestures that people compose: what is none is refused with the cure, by both ends alike."""

import json
import math
import re
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot.motion.composed_gestures import (
    MAX_MOVES,
    NUMBERS,
    Move,
    build_gesture,
    parse_gesture,
    to_data,
)
from robot.motion.dry_run import dry_run, validate_gesture
from robot.motion.gesture_errors import BadGesture
from robot.motion.gestures import known_names
from robot.motion.limits import DEFAULT_LIMITS, REACH_M, TETHER_M, TICK_S
from robot.motion.player import DONE, Player
from robot.motion.pose import HOME
from tests.support.json_values import ANYTHING
from tests.support.robot_stage import IdealBase

QUARTER = math.pi / 2
NOD = [Move(forward_m=0.1), Move(forward_m=-0.1)]


def data(*moves: Move, name: str = "wave"):
    return to_data(name, moves)


def test_steps_become_the_places_that_they_lead_to():
    wave = build_gesture(
        "wave",
        [
            Move(turn_rad=QUARTER, forward_m=0.1, hold_s=0.5, pace=0.5),
            Move(forward_m=-0.1, turn_rad=0),
            Move(turn_rad=-QUARTER),
        ],
    )
    turn, out, back, home = wave.waypoints
    assert (turn.x_m, turn.y_m, turn.heading_rad, turn.hold_s) == (0, 0, QUARTER, 0)
    assert (out.x_m, out.y_m) == pytest.approx((0, 0.1))
    assert (out.heading_rad, out.pace, out.hold_s) == (QUARTER, 0.5, 0.5)
    assert (back.x_m, back.y_m, back.heading_rad) == (0, 0, QUARTER)
    assert home.pose == HOME
    assert (wave.name, wave.label) == ("wave", "wave")


def test_a_step_s_time_is_shared_by_its_turn_and_its_way():
    moves = [Move(QUARTER, 0.1, hold_s=1, within_s=9), Move(0, -0.1), Move(-QUARTER)]
    turn, out, *_ = build_gesture("wave", moves).waypoints
    assert turn.within_s + out.within_s == pytest.approx(9)
    assert out.within_s > turn.within_s  # the pause is part of it


def test_three_sides_come_home_although_they_are_rounded():
    triangle = [Move(QUARTER / 2, 0.14), Move(3 * QUARTER / 2, 0.1), Move(QUARTER, 0.1)]
    assert build_gesture("triangle", [*triangle, Move(turn_rad=QUARTER)]).waypoints[
        -1
    ].heading_rad == (pytest.approx(math.tau))


@pytest.mark.parametrize(
    ("moves", "cure"),
    [
        ([], "1 to 16 steps"),
        ([Move(hold_s=0.1)] * (MAX_MOVES + 1), "1 to 16 steps"),
        (
            [Move(forward_m=0.52), Move(forward_m=-0.52)],
            "Step 1 goes 0.52 m away .* Make it shorter",
        ),
        ([*NOD, Move(forward_m=0.2), Move(forward_m=0.06)], "Step 4 goes 0.26 m away"),
        ([Move(forward_m=0.1)], "It ends 10 cm from home. Add steps that lead back home"),
        ([Move(turn_rad=1)], "turned by 57° to the left"),
        ([Move(forward_m=-0.1), Move(forward_m=0.1)], "Step 1 backs where it did not come from"),
        ([*NOD, Move(turn_rad=7)], "Step 3 turns more than once around"),
        ([*NOD, Move()], "Step 3 does nothing"),
        ([Move(forward_m=0.004)], "Step 1 goes less than 0.01 m"),
        ([Move(turn_rad=0.01)], "Step 1 turns by less than 1°"),
        ([Move(forward_m=0.1, pace=0.1), NOD[1]], "Step 1 has a pace outside 0.2 to 1"),
        ([Move(forward_m=0.1, within_s=1.0), NOD[1]], "Step 1 needs 1.6 s. Give it as long"),
        ([Move(forward_m=0.1, hold_s=17), NOD[1]], "Step 1 may take up to 16 s"),
        ([Move(forward_m=0.1, hold_s=-1), NOD[1]], "Step 1 may take"),
        (NOD * 6, "takes at most 16 s. Make it smaller"),
        ([Move(forward_m=math.inf)], "Step 1 has a number that is not finite"),
        ([Move(within_s=math.nan, hold_s=1)], "Step 1 has a number that is not finite"),
        ([Move(forward_m=1e308), Move(forward_m=1e308)], "Step 1 goes"),
    ],
)
def test_what_no_base_should_perform_is_refused_with_the_cure(moves, cure):
    with pytest.raises(BadGesture, match=cure):
        validate_gesture(data(*moves))


@pytest.mark.parametrize("name", sorted(known_names()))
def test_no_name_stands_for_two_gestures(name):
    with pytest.raises(BadGesture, match="Choose another name"):
        build_gesture(name, NOD)


@pytest.mark.parametrize("name", ["", "a b", "x" * 33, "<b>", "é", None, 3])
def test_names_can_be_said_in_every_message(name):
    with pytest.raises(BadGesture, match="letters, digits"):
        build_gesture(name, NOD)


@pytest.mark.parametrize("limit", [2.0, 3.0])
def test_the_time_that_it_says_it_needs_is_enough(limit):
    moves = [Move(forward_m=0.1, within_s=0.1), Move(forward_m=-0.1)]
    with pytest.raises(BadGesture) as refused:
        build_gesture("wave", moves)
    needed_s = float(re.search(r"needs ([\d.]+) s", str(refused.value))[1])
    build_gesture("wave", [Move(forward_m=0.1, within_s=needed_s), moves[1]])
    assert needed_s < limit


# --- any gesture that is admitted -----------------------------------------------------------------

paces = st.floats(0.2, 1)
ways = st.floats(0.02, 0.2)
turns = st.floats(0.05, 3).map(lambda turn: round(turn, 3))
signs = st.sampled_from([1, -1])


@st.composite
def returning(draw):
    """Steps out and the same steps back, so that most of them are gestures; some are not."""
    out = []
    for _ in range(draw(st.integers(1, 3))):
        turn = draw(st.one_of(st.just(0.0), turns)) * draw(signs)
        way = draw(st.one_of(st.just(0.0), ways))
        out.append((turn, way, draw(st.floats(0, 0.5)), draw(paces)))
    moves = [Move(*step) for step in out]
    for turn, way, hold_s, pace in reversed(out):
        if way:
            moves.append(Move(forward_m=-way, hold_s=hold_s, pace=pace))
        if turn:
            moves.append(Move(turn_rad=-turn, pace=pace))
    return moves


anything = st.lists(
    st.builds(
        Move,
        turn_rad=st.one_of(st.just(0.0), st.floats(-7, 7)),
        forward_m=st.one_of(st.just(0.0), st.floats(-0.3, 0.3)),
        hold_s=st.floats(0, 2),
        pace=st.floats(0.1, 1.1),
        within_s=st.one_of(st.none(), st.floats(0, 20)),
    ),
    max_size=8,
)


def perform(gesture, pace):
    """Play it on a kinematic base, orders first and odometry after; not the trial's own way."""
    now_s = 0.0
    base = IdealBase(lambda: now_s)
    player, ordered = Player(DEFAULT_LIMITS), [(0.0, 0.0)]
    player.start(gesture, 0.0, base.read().pose, pace=pace)
    while player.is_busy:
        twist = base.drive(player.step(now_s, base.read().pose))
        ordered.append((twist.v_m_s, twist.w_rad_s))
        now_s += TICK_S
    return player.outcome, base.ground_truth(), ordered


@given(st.one_of(returning(), anything), st.floats(0.05, 1), st.sampled_from([1.0, 0.5]))
def test_what_is_admitted_stays_near_and_comes_home_at_any_intensity(moves, intensity, pace):
    try:
        gesture = validate_gesture(data(*moves))
    except BadGesture as refused:
        # The same words from the same data at the other end of the wire.
        with pytest.raises(BadGesture, match=re.escape(str(refused))):
            validate_gesture(json.loads(json.dumps(data(*moves))))
        return
    assert validate_gesture(json.loads(json.dumps(data(*moves)))) == gesture
    scaled = gesture.scaled(intensity)
    assert scaled.min_duration_s() <= gesture.min_duration_s() + 1e-9
    outcome, truth, ordered = perform(scaled, pace)
    assert outcome == DONE
    assert truth.farthest_m <= REACH_M + 0.01 < TETHER_M
    assert truth.pose.distance_m(HOME) < 0.01
    assert truth.pose.turn_rad(HOME) < math.radians(2)
    for (v, w), (next_v, next_w) in pairwise(ordered):
        assert abs(next_v) <= 0.2
        assert abs(next_w) <= 1.5
        assert abs(next_v - v) <= 0.5 * TICK_S + 1e-9
        assert abs(next_w - w) <= 3.5 * TICK_S + 1e-9


steps = st.fixed_dictionaries({}, optional=dict.fromkeys(NUMBERS, ANYTHING))


@given(
    ANYTHING
    | st.fixed_dictionaries({"name": ANYTHING | st.just("a"), "steps": st.lists(steps | ANYTHING)})
)
def test_any_json_is_a_gesture_or_is_refused(sent):
    try:
        parse_gesture(sent)
    except BadGesture as refused:
        assert str(refused)


@pytest.mark.parametrize("step", [{"forward_m": 10**400}, {"forward_m": True}, {"hold_s": "1"}, 3])
def test_steps_are_numbers(step):
    with pytest.raises(BadGesture, match="Step 1"):
        parse_gesture({"name": "wave", "steps": [step]})


def test_a_trial_tells_how_long_and_how_far():
    trial = dry_run(build_gesture("wave", NOD))
    assert trial.outcome == DONE
    assert 2 < trial.took_s < 4
    assert trial.farthest_m == pytest.approx(0.1, abs=0.01)
    slow = dry_run(build_gesture("wave", NOD), pace=0.5)
    assert slow.took_s > trial.took_s


def test_what_nobody_would_see_is_refused():
    with pytest.raises(BadGesture, match="Let it go 2 cm or turn by 6°"):
        build_gesture("wink", [Move(turn_rad=0.05), Move(turn_rad=-0.05)])
