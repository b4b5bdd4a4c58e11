"""The topics of the original GARRY: what is told to its nodes, and what is past and is not."""

import math

import pytest

from robot.original_topics import TOPICS, OriginalTalk
from robot.ros.frames import Publication

WELCOME = {"type": "welcome", "session": 7, "state": "running"}
STEP = {"type": "step", "number": 1, "performance": 0.9, "shown": 0.99, "goal": 1.1}


def begin(valence="positive", names=tuple(TOPICS)):
    """Give a talk on an open connection that knows its session, and all that it said."""
    talk = OriginalTalk(names)
    opened = list(talk.open(0.0))
    talk.follow(WELCOME | {"valence": valence}, 0.0)
    return talk, opened + list(talk.due(0.0))


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
    assert published(said) == [("/garry/feedback_type", {"data": told})]
    latched = [frame["topic"] for frame in said if frame.get("latch")]
    assert latched == ["/garry/feedback_type"]


def test_a_type_that_the_original_does_not_know_is_not_told():
    assert published(begin("neutral")[1]) == []


def test_nothing_is_told_of_a_server_that_does_not_say_it():
    talk = OriginalTalk(TOPICS)
    list(talk.open(0.0))
    talk.follow(WELCOME, 0.0)
    talk.follow({"type": "welcome", "session": None}, 0.0)
    talk.decide(True, 0.0)
    assert list(talk.due(0.0)) == []


@pytest.mark.parametrize("above", [True, False])
@pytest.mark.parametrize("valence", ["positive", "negative", "binary", "explicit"])
def test_a_good_step_where_the_original_tells_one(valence, above):
    talk, _ = begin(valence)
    talk.decide(above, 1.0)
    told = [("/garry/good_step", {"data": above})] if valence in ("positive", "binary") else []
    assert published(talk.due(1.0)) == told


def test_steps_are_what_was_shown_and_the_goal():
    talk, _ = begin()
    talk.follow(STEP, 1.0)
    assert published(talk.due(1.0)) == [("/garry/data", {"a2": 0.99, "goal": 1.1})]


@pytest.mark.parametrize("bad", [None, "1", True, math.nan, math.inf, 1e300, {}])
def test_a_number_that_is_none_is_not_told(bad):
    talk, _ = begin()
    talk.follow(STEP | {"shown": bad}, 1.0)
    talk.follow(STEP | {"goal": bad}, 1.0)
    talk.follow({"type": "step"}, 1.0)
    assert list(talk.due(1.0)) == []


def test_a_reconnection_tells_what_holds_and_nothing_that_is_past():
    talk, _ = begin()
    talk.follow(STEP, 1.0)
    talk.decide(True, 1.0)
    talk.lose(1.0)
    talk.follow(STEP, 1.1)
    talk.decide(True, 1.1)
    frames = [*talk.open(1.2), *talk.due(1.2)]
    assert published(frames) == [("/garry/feedback_type", {"data": "Positive"})]


def test_what_could_not_be_said_within_a_second_is_past():
    talk, _ = begin()
    talk.decide(True, 1.0)
    assert published(talk.due(2.1)) == []


def test_only_the_chosen_topics_are_used():
    talk, said = begin(names=["good_step"])
    talk.follow(STEP, 1.0)
    talk.decide(True, 1.0)
    said += [*talk.due(1.0), *talk.end(1.0)]
    assert {frame["topic"] for frame in said} == {"/garry/good_step"}


def test_what_does_not_come_back_is_told_with_the_cure():
    talk, _ = begin()
    talk.hear(Publication("/garry/feedback_type", {"data": "Positive"}), 0.1)
    talk.follow(STEP, 1.0)
    list(talk.due(1.0))
    assert talk.problem(2.9) == ""
    assert "build the package garry_ros there" in talk.problem(3.1)
    talk.hear(Publication("/garry/data", {"a2": 0.99, "goal": 1.1}), 3.2)
    assert talk.problem(9.0) == ""
