"""An incident's orders on a simulated base: it comes to where it was recorded, unless pushed."""

from argparse import Namespace

import pytest

from robot.base_options import VirtualClock
from robot.bases.kinematic import IDEAL, KinematicBase
from robot.behavior.performer import Performer
from robot.black_box.capture import Capture
from robot.black_box.recorder import BlackBox
from robot.motion.gestures import GESTURES
from robot.motion.limits import TICK_S
from robot.motion.twist import Twist
from robot.replay import main, read_ticks, replay
from robot.wire.incident import read_lines, to_lines


@pytest.fixture
def recorded(tmp_path):
    """A gesture in the middle of which somebody stopped the robot, as its black box has it."""
    clock = VirtualClock()
    base = KinematicBase(clock.monotonic)
    box = BlackBox(tmp_path / "box", clock.monotonic)
    box.begin()
    performer = Performer(base)
    capture = Capture(box, performer, base)
    assert not performer.play_alone(GESTURES["celebrate"], clock.now_s)
    for tick in range(400):
        performer.tick(clock.now_s)
        capture.record_tick(clock.now_s)
        if tick == 90:
            performer.handle({"type": "stop"}, clock.now_s)
            capture.record_message({"type": "stop"})
        clock.sleep(TICK_S)
    box.write()
    (file,) = (tmp_path / "box").glob("incident-*-stopped.jsonl")
    return file


def test_orders_explain_where_it_was(recorded, capsys):
    assert main([str(recorded), "--base", "kinematic"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) > 3
    apart_mm = [float(line.rsplit(maxsplit=2)[1]) for line in lines]
    assert max(apart_mm) <= 10
    moved = [one for one in read_ticks(recorded.read_text()) if not one[1].is_still]
    assert len(moved) > 20


def test_what_goes_sideways_is_recorded_and_replayed(tmp_path, capsys):
    clock = VirtualClock()
    base = KinematicBase(clock.monotonic)
    base.configure(Namespace(port="", holonomic=True))
    box = BlackBox(tmp_path / "box", clock.monotonic)
    box.begin()
    performer = Performer(base)
    capture = Capture(box, performer, base)
    base.drive(Twist(0.0, 0.0, 0.2))  # set aside, as a person might
    for _ in range(10):
        clock.sleep(TICK_S)
        base.drive(Twist(0.0, 0.0, 0.2))
    base.stop()
    clock.sleep(0.5)
    base.read()
    assert not performer.play_alone(GESTURES["nod"], clock.now_s)
    for tick in range(600):
        performer.tick(clock.now_s)
        capture.record_tick(clock.now_s)
        if tick == 300:
            performer.handle({"type": "stop"}, clock.now_s)
            capture.record_message({"type": "stop"})
        clock.sleep(TICK_S)
    box.write()
    (file,) = (tmp_path / "box").glob("incident-*-stopped.jsonl")
    ordered = [order.vy_m_s for _, order, _ in read_ticks(file.read_text())]
    assert min(ordered) < -0.03  # back from what it was beside
    assert main([str(file), "--base", "kinematic"]) == 2
    assert "take --base kinematic --holonomic" in capsys.readouterr().err
    assert main([str(file), "--base", "kinematic", "--holonomic"]) == 0
    last = capsys.readouterr().out.splitlines()[-1]
    assert float(last.rsplit(maxsplit=2)[1]) <= 10


def test_what_orders_do_not_explain_shows(recorded):
    records = read_lines(recorded.read_text())
    for one in records:
        if "tick" in one and one["at_s"] > 1.0:
            one["tick"][3] += 0.1  # somebody pushed it aside
    ticks = read_ticks(to_lines(records))
    clock = VirtualClock()
    with KinematicBase(clock.monotonic, IDEAL) as base:
        *_, last = replay(ticks, base, clock.monotonic, clock.sleep)
    assert last.recorded.distance_m(last.replayed) == pytest.approx(0.1, abs=0.02)


@pytest.mark.parametrize("text", [None, "", "nonsense\n{}\n", '{"at_s":1,"tick":[1]}\n'])
def test_a_file_that_is_none_is_refused_with_the_cure(tmp_path, text, capsys):
    path = tmp_path / "one.jsonl"
    if text is not None:
        path.write_text(text)
    assert main([str(path), "--base", "kinematic"]) == 2
    assert str(path) in capsys.readouterr().err
