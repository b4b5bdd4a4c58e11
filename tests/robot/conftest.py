"""What tests of the robot share."""

import pytest

from tests.support.robot_stage import WELCOME, FeelingBase, Stage


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
