"""Scores: success rises, failure falls, quiet rooms stay quiet, and composed tracks are checked."""

import math
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rehab.training.valences import VALENCES
from robot.bases.kinematic import IDEAL, KinematicBase
from robot.behavior.expression import Expression
from robot.motion.composed_gestures import Move, parse_gesture, to_data
from robot.motion.dry_run import dry_run
from robot.motion.gesture_errors import BadGesture
from robot.motion.gesture_variants import IDLE, POOLS
from robot.motion.gestures import BUILT_IN, GESTURES
from robot.motion.lights_and_sounds import (
    MAX_ENTRIES,
    NEUTRAL,
    Color,
    Light,
    Melody,
    Note,
    Score,
    read_score,
)
from robot.motion.preview import ANNOUNCED_S, preview
from tests.support.json_values import ANYTHING
from tests.support.variants import cases

ABOVE = ("joy", "streak_3", "streak_5", "streak_10", "comeback")


def pitches(gesture):
    return [note.frequency_hz for note in gesture.score.notes]


def test_success_rises_and_failure_falls():
    glad = [GESTURES["celebrate"], *(one for pool in ABOVE for one in POOLS[pool])]
    sad = [GESTURES["droop"], *POOLS["disappointment"]]
    for gesture in glad:
        rising = pitches(gesture)
        assert len(rising) > 2
        assert all(low <= high for low, high in pairwise(rising))
        assert gesture.score.mood == "glad"
    lowest_hz = min(min(pitches(gesture)) for gesture in glad)
    for gesture in sad:
        assert all(high > low for high, low in pairwise(pitches(gesture)))
        assert gesture.score.mood == "sad"
    for gesture in (*sad, *POOLS["near_miss"], *POOLS["effort"]):
        assert gesture.score.mood != "glad"
        assert max(pitches(gesture)) < lowest_hz  # never the sound of success


def test_explicit_feedback_stays_still():
    cue = VALENCES["explicit"].cue
    assert (cue.above, cue.below) == (None, None)


@pytest.mark.parametrize("name", cases(BUILT_IN))
def test_a_score_is_over_before_its_motion_and_tells_that_it_begins(name):
    gesture = BUILT_IN[name]
    ends_s = ANNOUNCED_S + dry_run(gesture).took_s
    entries: tuple[Light | Note, ...] = (*gesture.score.lights, *gesture.score.notes)
    for entry in entries:
        assert 0 <= entry.at_s <= ends_s
    assert gesture.score.lights[0].at_s == 0
    assert gesture in IDLE or gesture.score.notes[0].at_s == 0  # idle life makes no sound
    assert gesture.score.quiet == Score(gesture.score.lights)


class Lit(KinematicBase):
    """A base with lights and a loudspeaker."""

    def __init__(self):
        super().__init__(lambda: 0.0, IDEAL)
        self.lit, self.played = [], []

    def light(self, first, second):
        self.lit.append((first, second))

    def play(self, note):
        self.played.append(note.frequency_hz)


SCORE = Score(
    (Light(0.0, Color.ORANGE, Color.OFF), Light(1.0, Color.GREEN, Color.GREEN)),
    (Note(0.1, 440, 0.1), Note(0.2, 550, 0.1), Note(1.0, 660, 0.1)),
)


def test_it_is_played_by_the_clock_once():
    base = Lit()
    expression = Expression(base)
    expression.start(SCORE, 50.0)
    for tick in range(100):
        expression.tick(50.0 + tick * 0.02)
        if tick == 25:
            assert base.played == [440, 550]
            assert base.lit == [("orange", "off")]
    assert base.played == [440, 550, 660]
    assert base.lit == [("orange", "off"), ("green", "green")]


def test_what_a_hang_missed_is_not_played_at_once():
    base = Lit()
    expression = Expression(base)
    expression.start(SCORE, 50.0)
    expression.tick(53.0)
    assert base.played == [660]
    assert base.lit == [("green", "green")]


def test_a_gesture_that_is_stopped_falls_silent():
    base = Lit()
    expression = Expression(base)
    expression.start(SCORE, 50.0)
    expression.tick(50.1)
    expression.stop()
    expression.tick(60.0)
    assert base.played == [440]


def composed(**tracks):
    return to_data("wave", [Move(turn_rad=0.4), Move(turn_rad=-0.4)]) | tracks


def test_a_composed_gesture_has_tracks_of_its_own():
    gesture = parse_gesture(
        composed(
            lights=[{"at_s": 1, "first": "green"}, {"at_s": 0, "second": "orange"}],
            notes=[
                {"at_s": 0.5, "melody": "button"},
                {"at_s": 0, "frequency_hz": 440, "duration_s": 0.2},
            ],
        )
    )
    assert gesture.score == Score(
        (Light(0, Color.OFF, Color.ORANGE), Light(1, Color.GREEN, Color.OFF)),
        (Note(0, 440, 0.2), Note(0.5, melody=Melody.BUTTON)),
    )
    assert gesture.scaled(0.5).score == gesture.score
    assert parse_gesture(composed()).score == NEUTRAL
    assert parse_gesture(composed(notes=[])).score == Score()


@pytest.mark.parametrize(
    ("tracks", "cure"),
    [
        ({"lights": 3}, "list of up to 64"),
        ({"lights": [{"at_s": 0}] * (MAX_ENTRIES + 1)}, "list of up to 64"),
        ({"notes": [1]}, "notes, 1: no object"),
        ({"lights": [{"at_s": 0, "first": "red"}]}, "red says that the robot is stopped"),
        ({"lights": [{"at_s": 99, "first": "green"}]}, "Light 1: at_s is a number from 0 to 17"),
        ({"notes": [{"at_s": 0, "frequency_hz": 20, "duration_s": 0.1}]}, "from 150 to 4000"),
        ({"notes": [{"at_s": 0, "frequency_hz": 440, "duration_s": 3}]}, "from 0.02 to 0.25"),
        ({"notes": [{"at_s": math.nan, "melody": "on"}]}, "Note 1: at_s"),
        ({"notes": [{"at_s": 0, "melody": "error"}]}, "no such melody"),
    ],
)
def test_tracks_that_no_robot_may_play_are_refused(tracks, cure):
    with pytest.raises(BadGesture, match=cure):
        parse_gesture(composed(**tracks))


@given(st.fixed_dictionaries({}, optional={"lights": ANYTHING, "notes": ANYTHING}))
def test_any_tracks_are_read_or_refused(data):
    try:
        assert isinstance(read_score(data), Score)
    except BadGesture as refused:
        assert str(refused)


def test_a_preview_has_motion_lights_and_notes_on_one_clock():
    shown = preview(GESTURES["celebrate"])
    assert shown["poses"][0] == [ANNOUNCED_S, 0, 0, 0]
    assert shown["poses"][-1][0] == pytest.approx(shown["took_s"])
    assert max(x_m for _, x_m, _, _ in shown["poses"]) == pytest.approx(0.05, abs=0.005)
    assert shown["lights"][0] == [0.0, "orange", "off"]
    assert [note[1] for note in shown["notes"]] == pitches(GESTURES["celebrate"])
    assert preview(GESTURES["celebrate"], is_quiet=True)["notes"] == []
