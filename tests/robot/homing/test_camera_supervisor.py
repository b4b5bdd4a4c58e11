"""A camera is read by a process of its own, only while somebody looks; what is wrong is said."""

import os
import time

import numpy as np
import pytest

pytest.importorskip("cv2", reason="pip install garry[tag]")
import cv2

from robot.homing.camera import Camera
from robot.homing.camera_supervisor import CameraEye
from robot.homing.sighting import Sighting, read_sighting
from tests.support.tag_pictures import picture_of, show


def look(eye, accept, within_s=20.0):
    """Return the first sighting that is accepted, looking meanwhile."""
    until_s = time.monotonic() + within_s
    while time.monotonic() < until_s:
        eye.watch(time.monotonic())
        for sighting in eye.take():
            if accept(sighting):
                return sighting
        time.sleep(0.01)
    return None


@pytest.mark.server
def test_what_a_picture_shows_is_seen_while_somebody_looks(tmp_path):
    file = tmp_path / "seen.png"
    show(file, picture_of(7))
    with CameraEye(f"file:{file}") as eye:
        seen = look(eye, lambda sighting: sighting.tags)
        assert seen.corners_of(7)
        assert seen.size_px == (168, 168)
        assert abs(time.monotonic() - seen.at_s) < 5
        show(file, picture_of(12))
        assert look(eye, lambda sighting: sighting.corners_of(12))
        show(file, cv2.imencode(".png", np.zeros((48, 64), np.uint8))[1].tobytes())
        assert look(eye, lambda sighting: sighting.problem == "camera_dark")
        eye._process.kill()  # a driver that breaks takes its process with it
        show(file, picture_of(3))
        assert look(eye, lambda sighting: sighting.corners_of(3))
        process = eye._process
    assert process.poll() == 0


@pytest.mark.server
def test_a_camera_that_is_not_there_is_told(tmp_path):
    with CameraEye(str(tmp_path / "none.mp4")) as eye:
        assert look(eye, lambda sighting: sighting.problem == "no_camera")


def test_an_old_picture_has_its_age(tmp_path):
    file = tmp_path / "seen.png"
    file.write_bytes(picture_of(7))
    old_s = time.time() - 3
    os.utime(file, (old_s, old_s))
    with Camera(f"file:{file}") as camera:
        at_s, _ = camera.read(5.0)
        assert time.monotonic() - at_s == pytest.approx(3, abs=1)
        assert camera.read(0.2) is None  # the same picture again is no frame


def test_a_sighting_is_its_line_again():
    corners = ((1.5, 2.0), (9.25, 2.0), (9.0, 10.0), (1.0, 10.0))
    seen = Sighting(12.5, ((7, corners), (7, corners)), (640, 480))
    assert read_sighting(seen.to_line()) == seen
    assert len(seen.corners_of(7)) == 2


@pytest.mark.parametrize(
    "line",
    ["", "{}", "[1]", "null", '[1, [[7, [["a", 1]]]], [1, 1], ""]', '[NaN, [], [1, 1], ""]',
     '[1, [[7, [[1, 2], [1, 2], [1, 2], [1, 1e999]]]], [1, 1], ""]', "[" * 5000],
)  # fmt: skip
def test_a_line_that_is_none_is_refused(line):
    with pytest.raises(ValueError, match="no sighting"):
        read_sighting(line)
