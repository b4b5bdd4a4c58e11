"""A performer on a clock that a test moves, and bases for it."""

import random
from dataclasses import replace
from typing import ClassVar

from robot.bases import Abilities, SensorState
from robot.bases.kinematic import IDEAL, KinematicBase
from robot.behavior.performer import Performer
from robot.motion.limits import TICK_S
from robot.motion.pose import HOME
from robot.motion.twist import STILL

CUE = {
    "above": "celebrate",
    "below": "droop",
    "threshold": 0.9,
    "window_s": 5,
    "rest_s": 5,
    "intensity": 1,
}
WELCOME = {"type": "welcome", "session": 7, "state": "running", "cue": CUE, "stopped": False}
WELCOME |= {"watched": True}


class IdealBase(KinematicBase):
    """A base that follows at once and exactly, where a test is about something else."""

    def __init__(self, monotonic):
        super().__init__(monotonic, IDEAL)


class RealBase(IdealBase):
    """A base that no program may arm."""

    name: ClassVar[str] = "real"
    abilities = Abilities(simulated=False, moves=True)


class Stage:
    """A performer with a clock, and everything that came of it."""

    def __init__(self, make=IdealBase):
        self.now_s = 1000.0
        self.base = make(lambda: self.now_s)
        self.robot = Performer(self.base)
        self.reports = []
        self.source_s = 0.0
        self.heartbeats = True

    def hear(self, **message):
        self.robot.handle(message, self.now_s)
        self.collect()

    def collect(self):
        while self.robot.reports:
            self.reports.append((round(self.now_s, 3), self.robot.reports.popleft()))

    def wait(self, span_s):
        for _ in range(round(span_s / TICK_S)):
            self.now_s += TICK_S
            if self.heartbeats:
                self.hear(type="heartbeat")
            self.robot.tick(self.now_s)
            self.collect()

    def walk(self, *performances, every_s=1.0):
        for performance in performances:
            self.hear(type="step", time_s=self.source_s, performance=performance)
            self.wait(every_s)
            self.source_s += every_s

    def of(self, kind):
        return [report for _, report in self.reports if report["kind"] == kind]

    @property
    def state(self):
        return self.of("status")[-1]["state"], self.of("status")[-1]["reason"]

    @property
    def ended(self):
        return [r["outcome"] for r in self.of("gesture") if r["phase"] == "ended"]

    def perform(self):
        """Walk until a gesture has begun and moves."""
        self.walk(1.0, 1.0, 1.0, 1.0, 1.0)
        self.hear(type="step", time_s=self.source_s, performance=1.0)
        self.wait(0.5)
        self.source_s += 0.5
        assert self.robot.body.player.is_busy
        assert not self.base.read().twist.is_still
        return self


def walk_ten_minutes(seed, **cue):
    """Return the stage after ten minutes of good and weak walking, as a seed has it."""
    stage, chance = Stage(KinematicBase), random.Random(seed)
    stage.hear(**WELCOME | {"cue": CUE | {"seed": seed} | cue})
    good = [1.0 if second // 40 % 3 < 2 else 0.8 for second in range(600)]
    stage.walk(*[chance.gauss(mean, 0.12) for mean in good])
    return stage


class FeelingBase(RealBase):
    """A real base that feels what a test tells it to, and has lights and sounds."""

    abilities = Abilities(simulated=False, moves=True, announces=True, notes=True)

    def __init__(self, monotonic):
        super().__init__(monotonic)
        self.sensors, self.shown, self.is_held = SensorState(), [], False
        self.lit, self.played, self.answered = [], [], []

    def read(self):
        there = super().read()
        if self.is_held:
            there = replace(there, pose=HOME, twist=STILL)
        return replace(there, sensors=self.sensors)

    def show(self, indication, *, aloud):
        self.shown.append((indication, aloud))

    def light(self, first, second):
        self.lit.append((first, second))

    def play(self, note):
        self.played.append(note)

    def answer(self, answer):
        self.answered.append(answer)
