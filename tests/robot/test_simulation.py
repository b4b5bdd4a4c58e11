"""A simulated session is a live robot on another clock."""

import pytest

from robot.bases.kinematic import KinematicBase
from robot.simulation import Simulation
from tests.support.robot_stage import CUE, WELCOME, Stage


def test_a_simulation_is_a_live_robot_on_another_clock():
    stage = Stage(KinematicBase)
    stage.hear(**WELCOME)
    performances = [0.5 + (number * 37 % 60) / 60 for number in range(60)]
    stage.walk(*performances)
    stage.wait(5)
    simulation = Simulation("kinematic", CUE)
    simulation.walk(zip(range(60), performances, strict=True))
    assert simulation.decisions == stage.of("decision")
    assert [gesture["outcome"] for gesture in simulation.gestures] == stage.ended
    assert len(simulation.gestures) > 5
    starts = [t for t, r in stage.reports if r.get("phase") == "started"]
    assert [g["started_s"] + 1000 for g in simulation.gestures] == pytest.approx(starts, abs=0.03)


def test_nothing_moves_at_a_null_base():
    simulation = Simulation("null", CUE)
    simulation.walk((number, 1.0) for number in range(30))
    assert {decision["reason"] for decision in simulation.decisions} == {"base_cannot_move"}
    assert not simulation.gestures


def test_a_simulation_refuses_what_a_robot_would():
    with pytest.raises(ValueError, match="window_s"):
        Simulation("kinematic", CUE | {"window_s": 0})
    for name in ("twin", "kobuki"):
        with pytest.raises(ValueError, match="no simulation"):
            Simulation(name, CUE)
