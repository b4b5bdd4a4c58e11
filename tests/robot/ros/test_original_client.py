"""The topics of the original GARRY: what is told to its nodes, and what is past and is not."""

import math

import pytest

from robot.__main__ import make_parser
from robot.ros.frames import Publication, Topic
from robot.ros.holder import GESTURE_S, DrivenBase, find_driven_base
from robot.ros.messages import TWIST
from robot.ros.original_nodes import TOPICS, OriginalTopicClient

WELCOME = {"type": "welcome", "session": 7, "state": "running"}
STEP = {"type": "step", "number": 1, "performance": 0.9, "shown": 0.99, "goal": 1.1}


def begin(valence="positive", names=tuple(TOPICS)):
    """Return a client on an open connection that knows its session, and all that it said."""
    client = OriginalTopicClient(names)
    opened = list(client.open(0.0))
    client.allow(True, 0.0)
    client.handle_message(WELCOME | {"valence": valence}, 0.0)
    opened += client.due(0.0)
    for now_s in (0.5, 0.99):
        list(client.due(now_s))
    return client, opened


FALSE, TRUE = ("/garry/good_step", {"data": False}), ("/garry/good_step", {"data": True})


MAY_ACT, HELD = "/garry/may_act", "/mobile_base/commands/velocity"


def published(frames, *, beside=(MAY_ACT,)):
    """Return what frames publish, beside on some topics."""
    frames = [frame for frame in frames if frame["op"] == "publish"]
    return [(frame["topic"], frame["msg"]) for frame in frames if frame["topic"] not in beside]


@pytest.mark.parametrize(
    ("valence", "told"),
    [
        ("positive", "Positive"),
        ("negative", "Negative"),
        ("binary", "Binary"),
        ("explicit", "Explicit"),
    ],
)
def test_the_feedback_type_letter_for_letter_and_latched(valence, told):
    _, said = begin(valence)
    assert published(said) == [("/garry/feedback_type", {"data": told}), FALSE]
    latched = [frame["topic"] for frame in said if frame.get("latch")]
    assert latched == ["/garry/feedback_type"]


def test_a_type_that_the_original_does_not_know_is_not_told():
    assert published(begin("neutral")[1]) == [FALSE]


def test_nothing_is_told_of_a_server_that_does_not_say_it():
    client = OriginalTopicClient(TOPICS)
    list(client.open(0.0))
    client.handle_message(WELCOME, 0.0)
    client.handle_message({"type": "welcome", "session": None}, 0.0)
    client.publish_decision(True, 5.0, 0.0)
    assert published(client.due(0.0)) == [FALSE]


@pytest.mark.parametrize("above", [True, False])
@pytest.mark.parametrize("valence", ["positive", "negative", "binary", "explicit"])
def test_a_good_step_where_the_original_tells_one(valence, above):
    client, _ = begin(valence)
    client.publish_decision(above, 5.0, 1.0)
    told = [("/garry/good_step", {"data": above})] if valence in ("positive", "binary") else [FALSE]
    assert published(client.due(1.0)) == told


def test_steps_are_what_was_shown_and_the_goal():
    client, _ = begin()
    client.handle_message(STEP, 1.0)
    assert published(client.due(1.0)) == [FALSE, ("/garry/data", {"a2": 0.99, "goal": 1.1})]


@pytest.mark.parametrize("bad", [None, "1", True, math.nan, math.inf, 1e300, {}])
def test_a_number_that_is_none_is_not_told(bad):
    client, _ = begin()
    client.handle_message(STEP | {"shown": bad}, 1.0)
    client.handle_message(STEP | {"goal": bad}, 1.0)
    client.handle_message({"type": "step"}, 1.0)
    assert published(client.due(1.0)) == [FALSE]


def test_a_reconnection_tells_what_holds_and_nothing_that_is_past():
    client, _ = begin()
    client.handle_message(STEP, 1.0)
    client.publish_decision(True, 5.0, 1.0)
    client.disconnect(1.0)
    client.handle_message(STEP, 1.1)
    client.publish_decision(True, 5.0, 1.1)
    frames = [*client.open(1.2), *client.due(1.2)]
    assert published(frames) == [("/garry/feedback_type", {"data": "Positive"}), FALSE]


def test_what_could_not_be_said_within_a_second_is_past():
    client, _ = begin()
    client.publish_decision(True, 5.0, 1.0)
    assert TRUE not in published(client.due(2.1))


def published_until(client, until_s, from_s=1.0):
    """Return what is published from one time to another, with when."""
    ticks = round((until_s - from_s) / 0.02)
    times = [from_s + 0.02 * tick for tick in range(1, ticks + 1)]
    return [(now_s, said) for now_s in times for said in published(client.due(now_s))]


def told_to_celebrate():
    client, _ = begin()
    client.publish_decision(True, 5.0, 1.0)
    assert published(client.due(1.0)) == [TRUE]
    return client


def test_where_our_robot_may_not_act_false_is_all_that_is_said():
    client = told_to_celebrate()
    client.allow(False, 1.0)
    client.publish_decision(True, 5.0, 1.01)
    client.handle_message(STEP, 1.01)
    said = published_until(client, 22.0)
    assert said[0] == (1.02, FALSE)
    assert [one for _, one in said] == [FALSE] * len(said)
    assert len(said) >= 40  # whoever subscribes later hears it, too
    client.allow(True, 0.0)
    client.publish_decision(True, 5.0, 22.0)
    assert TRUE in published(client.due(22.0))


def test_what_waits_is_dropped_with_a_stop():
    client, _ = begin()
    client.publish_decision(True, 5.0, 1.0)
    client.handle_message(STEP, 1.0)
    client.allow(False, 1.0)
    assert published(client.due(1.0)) == [FALSE]


def test_a_true_that_no_decision_follows_is_taken_back():
    client = told_to_celebrate()
    said = published_until(client, 20.0)
    assert [one for _, one in said] == [FALSE] * 3
    assert said[0][0] == pytest.approx(8.5, abs=0.05)
    assert published_until(told_to_celebrate(), 8.4) == []


def test_its_end_takes_back_what_was_said():
    ends = published(told_to_celebrate().end(1.1))
    assert ends == [FALSE] * 3
    assert published(begin(names=["data"])[0].end(1.1)) == []


def test_only_the_chosen_topics_are_used():
    client, said = begin(names=["good_step"])
    client.handle_message(STEP, 1.0)
    client.publish_decision(True, 5.0, 1.0)
    said += [*client.due(1.0), *client.end(1.0)]
    assert {frame["topic"] for frame in said} == {"/garry/good_step", MAY_ACT}


def test_what_does_not_come_back_is_told_with_the_cure():
    client, _ = begin()
    client.handle(Publication("/garry/feedback_type", {"data": "Positive"}), 0.1)
    client.handle(Publication("/garry/good_step", {"data": False}), 0.1)
    client.publish_decision(False, 5.0, 0.2)
    list(client.due(0.2))
    client.handle(Publication("/garry/good_step", {"data": False}), 0.3)
    client.handle_message(STEP, 1.0)
    list(client.due(1.0))
    assert client.problem(2.9) == ""
    assert "build the package garry_ros there" in client.problem(3.1)
    client.handle(Publication("/garry/data", {"a2": 0.99, "goal": 1.1}), 3.2)
    assert client.problem(9.0) == ""


# --- a gesture that its node has begun ------------------------------------------------------------


def run(client, until_s, from_s, allow=None, odometry=None):
    """Return what is published, with when, on the topics of the base and of the gate."""
    said, now_s = [], from_s
    while now_s < until_s:
        now_s = round(now_s + 0.02, 2)
        if allow is not None:
            client.allowed_until_s = now_s + 0.25
            client.allow(allow, now_s)
        if odometry is not None:
            client.handle(Publication("/odom", odometry(now_s)), now_s)
        said += [(now_s, *one) for one in published(client.due(now_s), beside=TOPIC_NAMES)]
    return said


TOPIC_NAMES = [topic.name for topic in TOPICS.values()]
STAND = {"linear": {"x": 0.0, "y": 0.0, "z": 0.0}, "angular": {"x": 0.0, "y": 0.0, "z": 0.0}}


def odometry(speed):
    """Return a message of odometry at a speed [m/s]."""
    at = {"position": {"x": 0.0, "y": 0.0}, "orientation": {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}}
    twist = {"linear": {"x": speed, "y": 0.0}, "angular": {"z": 0.0}}
    return {"pose": {"pose": at}, "twist": {"twist": twist}}


def begin_with_base():
    client = OriginalTopicClient(TOPICS, DrivenBase())
    list(client.open(0.0))
    run(client, 10.0, 0.0, allow=False)
    assert not any(topic == HELD for _, topic, _ in run(client, 12.0, 10.0, allow=False))
    client.handle_message(WELCOME | {"valence": "positive"}, 12.0)
    assert not any(topic == HELD for _, topic, _ in run(client, 14.0, 12.0, allow=True))
    return client


def holds(said):
    """Return when the base was ordered to stand."""
    assert all(message == STAND for _, topic, message in said if topic == HELD)
    return [at_s for at_s, topic, _ in said if topic == HELD]


def test_a_stop_holds_its_base_fifty_times_a_second_for_as_long_as_a_gesture_runs():
    client = begin_with_base()
    times = holds(run(client, 30.0, 14.0, allow=False))
    assert times[0] == pytest.approx(14.02)
    assert len(times) == pytest.approx(50 * GESTURE_S, abs=2)
    assert times[-1] - times[0] == pytest.approx(GESTURE_S, abs=0.1)


def test_what_still_moves_then_is_held_until_it_has_been_still():
    client = begin_with_base()
    rolls = lambda now_s: odometry(0.1 if now_s < 25.0 else 0.0)  # noqa: E731
    times = holds(run(client, 40.0, 14.0, allow=False, odometry=rolls))
    assert times[-1] == pytest.approx(26.0, abs=0.1)


def test_it_is_let_go_once_a_robot_may_act_again():
    client = begin_with_base()
    run(client, 15.0, 14.0, allow=False)
    assert holds(run(client, 20.0, 15.0, allow=True)) == []


def test_a_worker_that_hangs_is_held_by_its_own_bridge():
    client = begin_with_base()
    said = run(client, 15.0, 14.0)
    assert holds(said)[0] == pytest.approx(14.25, abs=0.03)
    assert (14.26, MAY_ACT, {"data": False}) in said


def test_the_gate_is_told_ten_times_a_second_and_at_once():
    client = begin_with_base()
    told = [one for one in run(client, 15.0, 14.0, allow=True) if one[1] == MAY_ACT]
    assert {message["data"] for *_, message in told} == {True}
    assert len(told) == pytest.approx(10, abs=1)
    told = [one for one in run(client, 15.1, 15.0, allow=False) if one[1] == MAY_ACT]
    assert told == [(15.02, MAY_ACT, {"data": False})]
    client.disconnect(16.0)
    list(client.open(17.0))
    assert (17.02, MAY_ACT, {"data": False}) in run(client, 17.1, 17.0, allow=False)
    assert (MAY_ACT, {"data": False}) in published(client.end(18.0), beside=())


@pytest.mark.parametrize(
    ("words", "base"),
    [
        ("--base null", DrivenBase()),
        ("--base rosbridge", None),
        ("--base null --original-cmd-topic none", None),
        (
            "--base null --original-cmd-topic /cmd_vel --original-odom-topic none",
            DrivenBase(Topic("/cmd_vel", TWIST), None),
        ),
    ],
)
def test_which_base_is_held(words, base):
    words = f"{words} --original-topics --server http://127.0.0.1:1".split()
    assert find_driven_base(make_parser().parse_args(words)) == base
