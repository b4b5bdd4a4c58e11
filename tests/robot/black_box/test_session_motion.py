"""The motion of a session as MCAP, read by the format's own reader."""

from itertools import pairwise

import pytest

from robot.wire.cue_limits import VARIED
from robot.wire.incident import MOTION, TICK, read_lines, unpack
from tests.support.recorded_stage import RecordedStage, read
from tests.support.robot_stage import CUE, WELCOME

pytest.importorskip("mcap.reader", reason="pip install garry[motion]")


def walked(folder):
    stage = RecordedStage(folder)
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
        (*one["tick"][2:], 0.0) for one in ticks
    ]
    assert set(odometry[0][1]) == {*TICK[2:], "left_m_s"}
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
    stage = RecordedStage(tmp_path)
    stage.hear(type="welcome", session=None)
    stage.wait(2)
    stage.close()
    assert not (tmp_path / "sessions").exists()


def test_parts_for_the_server_have_a_tenth_of_a_second_and_each_report(tmp_path):
    stage = walked(tmp_path)
    assert {one.reason for one in stage.box.motion} == {MOTION}
    assert {one.session for one in stage.box.motion} == {7}
    sent = [record for one in stage.box.motion for record in unpack(one.recording)]
    logged = read_lines("".join(path.read_text() for path in sorted(tmp_path.glob("*.jsonl"))))
    known = {one["at_s"]: one["tick"] for one in logged if "tick" in one}
    ticks = {one["at_s"]: one["tick"] for one in sent if "tick" in one}
    assert all(known[at_s] == tick for at_s, tick in ticks.items())
    assert max(after - before for before, after in pairwise(ticks)) < 1.1
    assert min(after - before for before, after in pairwise(ticks)) > 0.09
    decisions = [one["sent"] for one in sent if one.get("sent", {}).get("kind") == "decision"]
    assert decisions == stage.of("decision")[: len(decisions)]
    assert all(len(one.recording) < 40_000 for one in stage.box.motion)


def test_the_end_of_a_session_sends_its_last_part_and_a_still_robot_sends_none(tmp_path):
    stage = RecordedStage(tmp_path)
    cue = CUE | {"above": VARIED, "below": VARIED}
    stage.hear(**WELCOME | {"cue": cue, "state": "ready"})
    stage.wait(70)
    stage.box.write()
    assert not stage.box.motion
    stage.hear(type="state", state="running", gesture="greeting")
    stage.wait(6)
    stage.hear(type="state", state="finished", gesture="farewell")
    stage.wait(7)
    stage.close()
    records = [record for one in stage.box.motion for record in unpack(one.recording)]
    names = [one["sent"]["name"] for one in records if "sent" in one]
    assert [name.rpartition("_")[0] for name in names] == ["greeting"] * 2 + ["farewell"] * 2
