"""A Stretch and a Quori by fakes of their own interfaces: sessions, stops and what goes wrong."""

from dataclasses import replace

import pytest

from robot.bases.rosbridge.joints import Joints
from robot.bases.rosbridge.topics import PROFILES
from robot.motion.limits import TICK_S
from robot.wire.cue_limits import VARIED
from tests.support.fake_quori import FakeQuori
from tests.support.fake_stretch import FakeStretch
from tests.support.robot_stage import CUE
from tests.support.rosbridge_stage import Stage

LATE_S = 0.02  # to the bridge and back: with the loops of driver and worker 0.1 s
ARMS = Joints(
    PROFILES["quori"].joint_server,
    PROFILES["quori"].joint_server.names,
    (0.0,) * 5,
    (0.5, 0.2, 0.5, 0.2, 0.1),
    (0.0, 0.0, 0.0, 0.0, -0.3),
)
TOPICS = {
    "stretch": replace(PROFILES["stretch"], own_timeout_s=0.5),
    "quori": replace(PROFILES["quori"], own_timeout_s=0.25, joints=ARMS),
}
MAKE = {"stretch": FakeStretch, "quori": FakeQuori}
NAMES = list(MAKE)


class RobotStage(Stage):
    def __init__(self, name, **more):
        super().__init__(TOPICS[name], make_robot=MAKE[name], late_s=LATE_S, **more)
        self.told = []
        self.wait(2.5)

    def perform(self, cue=CUE):
        super().perform(cue)
        self.performer.body.status.on_report = self.told.append
        return self

    def walk(self, seconds, performances=(1.2, 0.4, 1.0, 0.5)):
        """Walk for some seconds; give how each gesture ended, in truth: [m], [°]."""
        ended, seen = [], len(self.told)
        for second in range(6, 6 + seconds):
            performance = performances[second // 5 % len(performances)]
            step = {"type": "step", "time_s": float(second), "performance": performance}
            self.performer.handle(step, self.now_s)
            self.wait(1.0)
            news, seen = self.told[seen:], len(self.told)
            ended += [
                (one["outcome"], *self.robot.body.away()) for one in news if one.get("outcome")
            ]
        return ended

    def begin_answer(self):
        """Begin an answer with wheels and joints in motion."""
        self.perform(CUE | {"below": "droop", "threshold": 2.0})  # a weak window
        for _ in range(100):
            self.wait(TICK_S)
            if self.robot.is_moving and self.robot.are_joints_moving:
                return self
        raise AssertionError("nothing moves")

    def until_still(self):
        """Give how long wheels and joints move on [s]."""
        began_s = moved_s = self.now_s
        for _ in range(100):
            self.wait(TICK_S)
            if self.robot.is_moving or self.robot.are_joints_moving:
                moved_s = self.now_s
        return moved_s - began_s


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("minutes", [1, pytest.param(10, marks=pytest.mark.long)])
def test_each_gesture_of_a_session_ends_at_home(name, minutes):
    stage = RobotStage(name)
    stage.perform(CUE | {"above": VARIED, "below": VARIED, "seed": 3})
    ended = stage.walk(60 * minutes)
    assert {outcome for outcome, _, _ in ended} == {"done"}
    assert len(ended) >= 8 * minutes
    assert max(away_m for _, away_m, _ in ended) < 0.02
    assert max(turned_deg for _, _, turned_deg in ended) < 2
    assert not stage.bridge.log


@pytest.mark.parametrize("name", NAMES)
def test_a_stop_stills_wheels_and_joints(name):
    stage = RobotStage(name).begin_answer()
    stage.performer.handle({"type": "stop"}, stage.now_s)
    assert stage.until_still() <= 0.75
