"""A simulated session is a live robot on another clock."""

import pytest

from robot.simulation import Rehearsal
from tests.support.robot_stage import CUE


def test_a_rehearsal_is_a_live_robot_on_another_clock(stage):
    performances = [0.5 + (number * 37 % 60) / 60 for number in range(60)]
    stage.walk(*performances)
    stage.wait(5)
    rehearsal = Rehearsal("kinematic", CUE)
    rehearsal.walk(zip(range(60), performances, strict=True))
    assert rehearsal.decisions == stage.of("decision")
    assert [gesture["outcome"] for gesture in rehearsal.gestures] == stage.ended
    assert len(rehearsal.gestures) > 5
    starts = [t for t, r in stage.reports if r.get("phase") == "started"]
    assert [g["started_s"] + 1000 for g in rehearsal.gestures] == pytest.approx(starts, abs=0.03)


def test_nothing_moves_at_a_null_base():
    rehearsal = Rehearsal("null", CUE)
    rehearsal.walk((number, 1.0) for number in range(30))
    assert {decision["reason"] for decision in rehearsal.decisions} == {"base_cannot_move"}
    assert not rehearsal.gestures


def test_a_rehearsal_refuses_what_a_robot_would():
    with pytest.raises(ValueError, match="window_s"):
        Rehearsal("kinematic", CUE | {"window_s": 0})
    for name in ("twin", "kobuki"):
        with pytest.raises(ValueError, match="no simulation"):
            Rehearsal(name, CUE)
