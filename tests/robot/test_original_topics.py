"""The topics of the original GARRY: what is told to its nodes, and what is past and is not."""

import math

import pytest

from robot.original_topics import TOPICS, OriginalTopicClient
from robot.ros.frames import Publication

WELCOME = {"type": "welcome", "session": 7, "state": "running"}
STEP = {"type": "step", "number": 1, "performance": 0.9, "shown": 0.99, "goal": 1.1}


def begin(valence="positive", names=tuple(TOPICS)):
    """Return a client on an open connection that knows its session, and all that it said."""
    client = OriginalTopicClient(names)
    opened = list(client.open(0.0))
    client.allow(True)
    client.handle_message(WELCOME | {"valence": valence}, 0.0)
    opened += client.due(0.0)
    for now_s in (0.5, 0.99):
        list(client.due(now_s))
    return client, opened


FALSE, TRUE = ("/garry/good_step", {"data": False}), ("/garry/good_step", {"data": True})


def published(frames):
    return [(frame["topic"], frame["msg"]) for frame in frames if frame["op"] == "publish"]


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
    client.allow(False)
    client.publish_decision(True, 5.0, 1.01)
    client.handle_message(STEP, 1.01)
    said = published_until(client, 22.0)
    assert said[0] == (1.02, FALSE)
    assert [one for _, one in said] == [FALSE] * len(said)
    assert len(said) >= 40  # whoever subscribes later hears it, too
    client.allow(True)
    client.publish_decision(True, 5.0, 22.0)
    assert TRUE in published(client.due(22.0))


def test_what_waits_is_dropped_with_a_stop():
    client, _ = begin()
    client.publish_decision(True, 5.0, 1.0)
    client.handle_message(STEP, 1.0)
    client.allow(False)
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
    assert {frame["topic"] for frame in said} == {"/garry/good_step"}


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
