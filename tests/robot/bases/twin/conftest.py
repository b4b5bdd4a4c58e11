"""What tests of the twin share."""

import pytest

from robot.bases.kobuki_protocol.frames import FRAME_S
from robot.bases.twin.__main__ import make_body
from robot.bases.twin.bodies import KinematicBody
from robot.bases.twin.bullet import BulletBody
from tests.support.twin_bench import HAS_PHYSICS, Bench, needs_physics


@pytest.fixture(params=["kinematic", pytest.param("bullet", marks=needs_physics)])
def bench(request):
    return Bench(make_body(request.param, pytest.fail))


@pytest.fixture
def simple():
    return Bench(KinematicBody(FRAME_S))


@pytest.fixture
def physics():
    if not HAS_PHYSICS:
        pytest.skip("pybullet is not installed")
    return Bench(BulletBody(FRAME_S))
