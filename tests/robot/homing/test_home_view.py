"""What is learned at home is stored for each base, and checked when it is read."""

import math

import pytest

from robot.bases import BASES
from robot.calibration import (
    BadCalibration,
    calibration_file,
    find_home_view,
    home_file,
    store_calibration,
    store_home_view,
)
from robot.homing.home_view import BadHomeView, Carried, HomeView, Lens, Mount
from robot.motion.base_response import Response

VIEW = HomeView(
    "/dev/video2",
    7,
    0.16,
    Carried.TAG,
    Mount(0.1, 0.0, 0.5, 0.0),
    Lens(640, 480, math.radians(60)),
    (0.1, 0.2, 0.3),
    (0.0, 0.1, 0.9),
)


@pytest.fixture
def base():
    return BASES["kinematic"](lambda: 0.0)


def test_it_comes_back_as_it_was_stored_and_leaves_the_measurements_alone(base):
    assert find_home_view(base) is None
    store_calibration(base, Response())
    measured = calibration_file().read_bytes()
    assert store_home_view(base, VIEW) == home_file()
    assert find_home_view(base) == VIEW
    assert calibration_file().read_bytes() == measured


@pytest.mark.parametrize(
    ("name", "value"),
    [("family", "tag25h9"), ("tag", 587), ("tag", "seven"), ("size_m", 0.0), ("lens", None),
     ("carried", "nothing"), ("place_m", [0, 0]), ("place_m", [0, 0, -1]), ("more", 1)],
)  # fmt: skip
def test_what_cannot_be_is_refused_with_the_cure(base, name, value):
    stored = VIEW.to_json() | {name: value}
    with pytest.raises(BadHomeView):
        HomeView.from_json(stored)
    home_file().write_text('{"kinematic": []}')
    with pytest.raises(BadCalibration, match="tag learn"):
        find_home_view(base)


def test_a_camera_is_on_the_base_and_sees_ahead():
    for width_px, field_deg in ((640, 170), (640, 10), (0, 60)):
        with pytest.raises(BadHomeView):
            Lens(width_px, 480, math.radians(field_deg))
    for ahead_m, turned_rad in ((1.5, 0.0), (0.0, 4.0)):
        with pytest.raises(BadHomeView):
            Mount(ahead_m, 0.0, turned_rad)
