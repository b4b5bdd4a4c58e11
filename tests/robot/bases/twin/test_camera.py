"""The twin's picture: drawn beside it, where it is now, and always whole."""

import io
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

from robot.bases.twin.__main__ import main
from robot.bases.twin.picture_process import Camera
from robot.motion.pose import HOME, Pose

pytest.importorskip("pybullet")
from PIL import Image  # comes with the twin

from robot.bases.twin.renderer import ROOM


def pixels(data):
    """Return a picture's pixels (height, width, RGBA)."""
    with Image.open(io.BytesIO(data)) as picture:
        assert picture.format == "PNG"
        return np.asarray(picture)


def dark(data):
    """Return the mean column of the dark pixels: where the robot is from left to right."""
    _, columns = np.nonzero(pixels(data)[:, :, :3].sum(axis=2, dtype=int) < 120)
    assert len(columns) > 500
    return columns.mean()


def wait_for(file, accept):
    until_s = time.monotonic() + 30
    while time.monotonic() < until_s:
        if file.exists() and accept(file.read_bytes()):
            return True
        time.sleep(0.05)
    return False


def test_it_shows_where_the_twin_is_now(tmp_path):
    file, poses = tmp_path / "twin.png", [HOME]
    with Camera(file, lambda: poses[0]):
        assert wait_for(file, lambda _: True)
        assert pixels(file.read_bytes()).shape == (ROOM.height_px, ROOM.width_px, 4)
        at_home = dark(file.read_bytes())
        poses[0] = Pose(0.3, 0.2, 1.0)
        assert wait_for(file, lambda data: abs(dark(data) - at_home) > 20)
    assert [path.name for path in tmp_path.iterdir()] == ["twin.png"]


@pytest.mark.server
def test_it_comes_and_goes_with_the_twin(tmp_path):
    file = tmp_path / "twin.png"
    with subprocess.Popen(
        [sys.executable, "-m", "robot", "twin", "--camera", str(file)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as twin:
        assert twin.stdout.readline().strip()
        assert wait_for(file, lambda _: True)
        twin.send_signal(signal.SIGTERM)
        assert twin.wait(10) == 0
        assert twin.stderr.read() == ""
        assert twin.stdout.read() == ""


@pytest.mark.parametrize("missing", ["folder", "pybullet"])
def test_what_it_needs_is_said(tmp_path, capsys, monkeypatch, missing):
    file = tmp_path / ("nowhere" if missing == "folder" else "") / "twin.png"
    if missing == "pybullet":
        monkeypatch.setattr("robot.bases.twin.__main__.find_spec", lambda _: None)
    with pytest.raises(SystemExit):
        main(["--camera", str(file)])
    said = capsys.readouterr().err
    assert missing in said
    assert ("Make it first" if missing == "folder" else "Cure") in said


@pytest.mark.parametrize("with_camera", [True, False])
def test_a_tag_is_seen_by_a_camera_and_takes_opencv(tmp_path, capsys, monkeypatch, with_camera):
    if with_camera:
        monkeypatch.setattr(
            "robot.bases.twin.__main__.find_spec", lambda name: None if name == "cv2" else name
        )
    with pytest.raises(SystemExit):
        main([*(["--camera", str(tmp_path / "seen.png")] if with_camera else []), "--tag", "7"])
    assert "garry[tag]" in capsys.readouterr().err


@pytest.mark.server
def test_what_it_sees_of_a_tag_is_where_geometry_has_it(tmp_path):
    pytest.importorskip("cv2", reason="pip install garry[tag]")
    from robot.bases.twin.tag_view import TagView
    from robot.homing.detector import find_tags, make_detector
    from tests.support.tag_room import TagRoom

    ((number, corners),) = find_tags(make_detector(), TagView(7).picture(HOME))
    assert number == 7
    assert np.abs(np.array(corners) - TagRoom().corners(HOME)).max() < 1.0
