"""`python -m robot gesture`: on the simulation, on the twin, and on a Kobuki of bytes."""

import json
import math
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

from robot.__main__ import main
from robot.bases.twinned import TwinBase
from robot.motion.gestures import GESTURES, ORIGINALS
from robot.motion.limits import TETHER_M
from robot.play_gesture import play_gesture
from tests.support.commands import hear_sigint
from tests.support.fake_kobuki import FakeKobuki

POSIX = pytest.mark.skipif(sys.platform == "win32", reason="no pty")
ROOT = Path(__file__).parents[2]


def is_home(pose):
    away_m = math.hypot(pose["x_m"], pose["y_m"])
    return away_m <= 0.02 and abs(pose["heading_rad"]) <= math.radians(2)


@pytest.mark.parametrize("name", {**GESTURES} | ORIGINALS)
def test_every_gesture_on_the_simulation(name, capsys):
    assert main(["gesture", name, "--base", "kinematic", "--json", "--times", "2"]) == 0
    for line in capsys.readouterr().out.splitlines():
        played = json.loads(line)
        assert played["outcome"] == "done"
        assert is_home(played["true_pose"])
        assert played["true_farthest_m"] <= TETHER_M


def test_it_says_it_to_people(capsys):
    assert main(["gesture", "nod", "--base", "kinematic"]) == 0
    assert "nod: done after" in capsys.readouterr().out


@pytest.mark.parametrize("words", [["waltz", "--base", "twin"], ["nod"], ["nod", "--base", "null"]])
def test_a_wrong_command_line(words):
    with pytest.raises(SystemExit) as ended:
        main(["gesture", *words])
    assert ended.value.code == 2


@pytest.mark.essential
@pytest.mark.realtime
def test_the_twin_comes_home_in_truth():
    done = subprocess.run(
        [sys.executable, "-m", "robot", "gesture", "celebrate", "--base", "twin", "--json"],
        cwd=ROOT,
        capture_output=True,
        text=True,
    )
    played = json.loads(done.stdout)
    assert (done.returncode, played["outcome"]) == (0, "done")
    assert is_home(played["true_pose"])
    assert 0.05 < played["true_farthest_m"] <= TETHER_M


@pytest.mark.realtime
def test_a_bump_ends_it_and_another_one_is_refused():
    with TwinBase(time.monotonic) as twin:
        bump = {"do": "set", "name": "bumper", "value": 2}
        threading.Timer(1.0, lambda: twin.send_order(bump)).start()
        played = play_gesture(GESTURES["celebrate"], twin, time.monotonic, time.sleep)
        assert played["outcome"] == "bump"
        assert twin.send_order({"do": "look"})["setpoint"] == [0, 0]
        assert play_gesture(GESTURES["nod"], twin, time.monotonic, time.sleep)["outcome"] == "bump"
        twin.send_order(bump | {"value": 0})
        twin.set_home()
        time.sleep(0.3)
        assert twin.ground_truth().pose.x_m == pytest.approx(0, abs=0.001)


@pytest.mark.realtime
@POSIX
def test_a_kobuki_plays_it_announced():
    with FakeKobuki() as kobuki:
        began_s = time.monotonic()
        assert main(["gesture", "nod", "--base", "kobuki", "--port", kobuki.url]) == 0
        moved_s = next(at_s for at_s, speed, _ in kobuki.orders if speed)
        assert moved_s - began_s > 0.5
        assert kobuki.notes == [(826, 120)]  # 440 Hz, 0.12 s
        assert kobuki.melodies == []
        assert not kobuki.is_moving


@POSIX
def test_a_kobuki_that_is_not_there_plays_nothing(capsys):
    assert main(["gesture", "nod", "--base", "kobuki", "--port", "/dev/no-such"]) == 1
    assert "base_silent" in capsys.readouterr().out


def start(*words):
    return subprocess.Popen(
        [sys.executable, "-W", "error", "-m", "robot", "gesture", *words],
        cwd=ROOT,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=hear_sigint,  # noqa: PLW1509 (it takes no lock)
    )


@pytest.mark.realtime
@POSIX
@pytest.mark.essential
@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM", "SIGHUP"])
def test_a_signal_stops_a_kobuki(name):
    with FakeKobuki() as kobuki:
        process = start("celebrate", "--base", "kobuki", "--port", kobuki.url)
        kobuki.until(lambda: kobuki.is_moving)
        since_s = time.monotonic()
        process.send_signal(getattr(signal, name))
        process.send_signal(signal.SIGTERM)  # an impatient one disturbs nothing
        _, said = process.communicate(timeout=10)
        assert process.returncode == 128 + getattr(signal, name), said
        assert kobuki.moved_after(since_s) < 0.35
        assert "Traceback" not in said


@pytest.mark.realtime
@POSIX
def test_a_port_that_is_lost_in_a_gesture_gets_its_stop_when_it_is_back(tmp_path):
    port = tmp_path / "kobuki"
    with FakeKobuki() as kobuki:
        port.symlink_to(kobuki.url)
        process = start("celebrate", "--base", "kobuki", "--port", str(port))
        kobuki.until(lambda: kobuki.is_moving)
        port.unlink()
        kobuki.unplug()
        time.sleep(1.5)
        assert process.poll() is None
        with FakeKobuki() as again:
            back_s = time.monotonic()
            port.symlink_to(again.url)
            again.until(lambda: len(again.orders) >= 3)
            assert time.monotonic() - back_s < 0.3
            _, said = process.communicate(timeout=10)
            assert not any(speed for _, speed, _ in again.orders)
    assert process.returncode == 1
    assert "switch it off" in said
    assert "was stopped" in said
    assert "Traceback" not in said
