"""The motion of a session as MCAP, read by the format's own reader."""

import json
from itertools import pairwise
from typing import Any

import pytest

from robot.black_box.capture import Capture
from robot.black_box.recorder import BlackBox
from robot.wire.cue_limits import VARIED
from robot.wire.incident import TICK, read_lines
from tests.support.robot_stage import CUE, WELCOME, Stage

mcap_reader = pytest.importorskip("mcap.reader", reason="pip install garry[mcap]")


class Walked(Stage):
    """A stage whose black box records it."""

    def __init__(self, folder):
        super().__init__()
        self.box = BlackBox(folder, lambda: self.now_s, keeps_motion=True)
        self.box.begin()
        self.capture = Capture(self.box, self.robot, self.base)

    def hear(self, **message):
        super().hear(**message)
        self.capture.record_message(message)

    def wait(self, span_s):
        for _ in range(round(span_s / 0.02)):
            super().wait(0.02)
            self.capture.record_tick(self.now_s)

    def close(self):
        self.box._is_closing.set()
        self.box.write()


def read(path):
    """Return each topic's messages of a file."""
    topics: dict[str, list[tuple[int, Any]]] = {}
    with path.open("rb") as file:
        for _, channel, message in mcap_reader.make_reader(file).iter_messages():
            topics.setdefault(channel.topic, []).append(
                (message.log_time, json.loads(message.data))
            )
    return topics


def walked(folder):
    stage = Walked(folder)
    cue = CUE | {"above": VARIED, "below": VARIED}
    stage.hear(**WELCOME | {"cue": cue})
    stage.walk(*[1.0, 1.2, 0.4, 0.5] * 8)
    stage.hear(**WELCOME | {"session": 8, "cue": cue})
    stage.walk(*[1.0] * 3)
    stage.close()
    return stage


def test_its_odometry_is_the_log_s_and_its_decisions_are_those_reported(tmp_path):
    stage = walked(tmp_path)
    seventh, eighth = sorted((tmp_path / "sessions").glob("session-*.mcap"), key=str)
    assert (seventh.stem.rpartition("-")[2], eighth.stem.rpartition("-")[2]) == ("7", "8")
    topics = read(seventh)
    logged = read_lines("".join(path.read_text() for path in sorted(tmp_path.glob("*.jsonl"))))
    ticks = [one for one in logged if "tick" in one]
    odometry = topics["/odometry"] + read(eighth)["/odometry"]
    assert [tuple(message.values()) for _, message in odometry] == [
        tuple(one["tick"][2:]) for one in ticks
    ]
    assert set(odometry[0][1]) == set(TICK[2:])
    assert max(message["order_m_s"] for _, message in topics["/order"]) > 0.05
    decisions = [message for _, message in topics["/decision"]]
    assert decisions == stage.of("decision")[: len(decisions)]
    assert {one["seed"] for one in decisions if one["gesture"]} == {7}
    assert [message["phase"] for _, message in topics["/gesture"]][:2] == ["started", "ended"]
    steps_ns = [after - before for (before, _), (after, _) in pairwise(odometry)]
    assert min(steps_ns) == pytest.approx(20e6, abs=1e6)


def test_two_of_a_study_are_shown_to_have_seen_the_same(tmp_path):
    def variants(folder):
        walked(folder)
        first = min((folder / "sessions").glob("session-*.mcap"))
        return [one["gesture"] for _, one in read(first)["/decision"]]

    assert variants(tmp_path / "a") == variants(tmp_path / "b")


def test_without_a_session_there_is_no_file(tmp_path):
    stage = Walked(tmp_path)
    stage.hear(type="welcome", session=None)
    stage.wait(2)
    stage.close()
    assert not (tmp_path / "sessions").exists()
