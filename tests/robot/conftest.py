"""What tests of the robot share."""

import pytest

from tests.support.robot_stage import WELCOME, FeelingBase, Stage


@pytest.fixture(autouse=True)
def measurements(tmp_path, monkeypatch):
    """Keep what this computer has measured of bases out of the tests."""
    monkeypatch.setenv("GARRY_ROBOT_CALIBRATION", str(tmp_path / "robot.json"))


@pytest.fixture
def stage():
    stage = Stage()
    stage.hear(**WELCOME)
    return stage


@pytest.fixture
def felt():
    stage = Stage(FeelingBase)
    stage.hear(**WELCOME)
    stage.hear(type="arm")
    return stage
