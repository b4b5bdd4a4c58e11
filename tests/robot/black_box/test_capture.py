"""What a black box is told of a robot, and when it keeps what it has."""

from robot.bases import SensorState
from robot.black_box.capture import Capture
from robot.black_box.recorder import BlackBox
from robot.motion.limits import TICK_S
from tests.support.robot_stage import WELCOME, FeelingBase, Stage


class Watched:
    """A robot on a stage with its capture, whose box writes nothing."""

    def __init__(self, tmp_path):
        self.stage = Stage(FeelingBase)
        self.box = BlackBox(tmp_path, lambda: self.stage.now_s)
        self.capture = Capture(self.box, self.stage.robot, self.stage.base)

    def hear(self, **message):
        self.stage.hear(**message)
        self.capture.record_message(message)

    def run(self, span_s):
        for _ in range(round(span_s / TICK_S)):
            self.stage.wait(TICK_S)
            self.capture.record_tick(self.stage.now_s)

    def noted(self, what):
        return [one[what] for one in self.box._waiting if what in one]


def test_messages_ticks_and_reports_are_recorded(tmp_path):
    watched = Watched(tmp_path)
    watched.hear(**WELCOME)
    watched.hear(type="arm")
    for second in range(7):
        watched.hear(type="step", number=1 + second, time_s=second, performance=1.0)
        watched.run(0.3)
    assert watched.noted("received")[0] == WELCOME
    assert {"decision", "gesture", "status"} <= {one["kind"] for one in watched.noted("sent")}
    moving = [tick for tick in watched.noted("tick") if any(tick[:2])]
    assert moving
    assert watched.noted("retained") == []


def test_at_ease_it_records_a_tick_a_second(tmp_path):
    watched = Watched(tmp_path)
    watched.hear(**WELCOME)
    watched.run(10)
    assert 9 <= len(watched.noted("tick")) <= 11


def test_each_stop_is_kept_once_with_its_session(tmp_path):
    watched = Watched(tmp_path)
    watched.hear(**WELCOME)
    watched.hear(type="arm")
    watched.run(0.1)
    watched.stage.base.sensors = SensorState(hazards=frozenset({"bump"}))
    watched.run(0.2)
    watched.stage.base.sensors = SensorState()
    watched.run(2)
    watched.hear(type="arm")
    watched.run(0.2)
    watched.hear(type="stop")
    watched.hear(type="stop")
    watched.run(0.2)
    assert watched.noted("retained") == ["bump", "stopped"]
    assert watched.box._retention.reason == "bump"
    assert watched.box._retention.session == WELCOME["session"]
    assert any("bump" in one for one in watched.noted("hazards"))
