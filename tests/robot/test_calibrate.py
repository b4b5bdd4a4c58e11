"""What `python -m robot calibrate` measures and stores, and what is done with it."""

import json
import math

import pytest

from robot import calibrate, play_gesture
from robot.base_options import VirtualClock
from robot.bases.kinematic import Imperfections, KinematicBase
from robot.calibrate import NotMeasured, measure
from robot.calibration import BadCalibration, apply_calibration, store_calibration
from robot.motion.base_response import Response

pytestmark = pytest.mark.matrix


@pytest.fixture
def file(tmp_path, monkeypatch):
    path = tmp_path / "folder" / "robot.json"
    monkeypatch.setenv("GARRY_ROBOT_CALIBRATION", str(path))
    return path


def measured(faults):
    clock = VirtualClock()
    return measure(KinematicBase(clock.monotonic, faults), clock.monotonic, clock.sleep)


@pytest.mark.parametrize(("dead_time_s", "lag_s"), [(0.0, 0.02), (0.08, 0.06), (0.25, 0.06)])
def test_dead_time_and_lag_are_measured(file, dead_time_s, lag_s):
    response = measured(Imperfections(dead_time_s, lag_s, left_scale=0.99))
    assert response.delay_s == pytest.approx(dead_time_s + lag_s, abs=0.015)


@pytest.mark.parametrize("scale", [0.97, 1.0, 1.03])
@pytest.mark.parametrize("drift_deg_min", [-3.0, 30.0])
def test_wheels_and_gyro_are_measured(file, scale, drift_deg_min):
    response = measured(
        Imperfections(left_scale=scale, right_scale=scale, drift_deg_min=drift_deg_min)
    )
    assert response.wheel_scale == pytest.approx(1 / scale, abs=0.003)
    drift_rad_s = math.radians(drift_deg_min / 60)
    assert response.gyro_bias_rad_s == pytest.approx(drift_rad_s, abs=math.radians(0.3 / 60))


def test_a_base_that_is_held_is_not_measured(file):
    with pytest.raises(NotMeasured, match="stalled"):
        measured(Imperfections(held=1.0))


def test_the_command_stores_it_and_a_gesture_uses_it(file, capsys, monkeypatch):
    assert calibrate.main(["--base", "kinematic"]) == 0
    assert "It answers after 2" in capsys.readouterr().out
    stored = json.loads(file.read_text())["kinematic"]
    assert stored["dead_time_s"] + stored["lag_s"] == pytest.approx(0.24, abs=0.015)
    told = []
    monkeypatch.setattr(KinematicBase, "calibrate", lambda _base, response: told.append(response))
    assert play_gesture.main(["nod", "--base", "kinematic"]) == 0
    assert told == [Response(**stored)]


def test_each_base_has_its_own(file):
    base = KinematicBase(lambda: 0.0)
    assert not apply_calibration(base)
    file.parent.mkdir()
    file.write_text('{"another": {"dead_time_s": 0.1}}')
    assert not apply_calibration(base)
    store_calibration(base, Response(0.07, 0.03))
    assert apply_calibration(base)
    assert base.response == Response(0.07, 0.03)
    assert json.loads(file.read_text())["another"] == {"dead_time_s": 0.1}


@pytest.mark.parametrize(
    ("text", "cure"),
    [
        ("{", "Mend or remove it"),
        ("[]", "Remove it"),
        ('{"kinematic": {"dead_time_s": 9}}', "calibrate` again"),
        ('{"kinematic": {"dead_time_s": "x"}}', "calibrate` again"),
        ('{"kinematic": {"speed": 1}}', "calibrate` again"),
    ],
)
def test_a_file_that_cannot_be_used_tells_the_cure(file, text, cure, capsys):
    file.parent.mkdir()
    file.write_text(text)
    with pytest.raises(BadCalibration, match=cure):
        apply_calibration(KinematicBase(lambda: 0.0))
    assert play_gesture.main(["nod", "--base", "kinematic"]) == 2
    assert cure in capsys.readouterr().err
