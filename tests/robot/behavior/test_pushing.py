"""A foot in its way: no gesture pushes long against it, and gentle ones no longer than others."""

import pytest

from robot.bases.base import Abilities
from robot.bases.kinematic import Imperfections, KinematicBase
from robot.motion.gesture_variants import VARIANTS
from robot.motion.gestures import GESTURES
from robot.motion.limits import TICK_S
from robot.motion.twist import Twist
from tests.support.robot_stage import CUE, WELCOME, Stage
from tests.support.variants import cases

pytestmark = pytest.mark.matrix


class PushedBase(KinematicBase):
    """A real base that a foot can hold; counts how long it pushes."""

    abilities = Abilities(simulated=False, moves=True)

    def __init__(self, monotonic, dead_time_s):
        super().__init__(monotonic, Imperfections(dead_time_s))
        self.pushed_s, self.work_j, self.last_s = 0.0, 0.0, monotonic()

    def drive(self, twist: Twist) -> Twist:
        there, now_s = super().read(), self._monotonic()
        if self.held and there.sensors.push_n > 3:
            self.pushed_s += now_s - self.last_s
            speed_m_s = max(map(abs, self._drive_train._free))
            self.work_j += there.sensors.push_n * speed_m_s * (now_s - self.last_s)
        self.last_s = now_s
        return super().drive(twist)


def push(gesture, intensity, dead_time_s, after_s):
    stage = Stage(lambda clock: PushedBase(clock, dead_time_s))
    cue = CUE | {"above": gesture, "intensity": intensity}
    stage.hear(**WELCOME | {"cue": cue})
    stage.hear(type="arm")
    stage.walk(*[1.2] * 5)
    stage.hear(type="step", time_s=5.0, performance=1.2)
    began_s = stage.now_s
    while stage.robot.body.player.is_busy:
        stage.wait(TICK_S)
        stage.base.held = float(stage.now_s - began_s >= after_s)
    return stage


@pytest.mark.parametrize("gesture", GESTURES)
@pytest.mark.parametrize("intensity", [1.0, 0.5], ids=["normal", "gentle"])
@pytest.mark.parametrize("dead_time_s", [0.0, 0.2])
@pytest.mark.parametrize("after_s", [0.0, 0.6])
def test_pushing_is_short_and_its_work_is_bounded(gesture, intensity, dead_time_s, after_s):
    """Before, gentle celebrations pushed for 4.2 s and sways for 9.2 (issue 15)."""
    stage = push(gesture, intensity, dead_time_s, after_s)
    assert stage.ended == ["stalled"]
    assert stage.base.pushed_s <= 0.7 + dead_time_s  # a stop takes it, too
    assert stage.base.work_j <= 1.7  # MISSED_M, with the most that motors can push


@pytest.mark.parametrize("gesture", cases(VARIANTS))
def test_pushing_against_a_variant_is_as_short(gesture):
    for intensity, after_s in ((1.0, 0.6), (0.5, 0.3)):
        stage = push(gesture, intensity, 0.2, after_s)
        assert stage.ended == ["stalled"]
        assert stage.base.pushed_s <= 0.9
        assert stage.base.work_j <= 1.7


@pytest.mark.parametrize("gesture", cases(VARIANTS))
def test_free_to_go_no_variant_stalls(gesture):
    assert push(gesture, 1.0, 0.2, 99.0).ended == push(gesture, 0.5, 0.2, 99.0).ended == ["done"]


@pytest.mark.parametrize("gesture", GESTURES)
@pytest.mark.parametrize("intensity", [1.0, 0.5, 0.25])
def test_free_to_go_nothing_stalls(gesture, intensity):
    stage = push(gesture, intensity, 0.2, 99.0)
    assert stage.ended == ["done"]
