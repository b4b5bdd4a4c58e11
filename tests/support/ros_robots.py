"""A Stretch and a Quori over a bridge, by fakes of their own interfaces."""

from dataclasses import replace

from robot.bases.rosbridge.joints import Joints
from robot.bases.rosbridge.topics import PROFILES
from robot.motion.limits import TICK_S
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
    """The robot of that name; ``topics`` are other than its own. ``told`` has all reports."""

    def __init__(self, name, **topics):
        super().__init__(replace(TOPICS[name], **topics), make_robot=MAKE[name], late_s=LATE_S)
        self.told = []
        self.wait(2.5)

    def perform(self, cue=CUE):
        super().perform(cue)
        self.performer.body.status.on_report = self.told.append
        return self

    def walk(self, seconds, performances=(1.2, 0.85, 0.6, 0.88)):
        """Walk for some seconds; give how each gesture ended, and where, in truth: [m], [°]."""
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
