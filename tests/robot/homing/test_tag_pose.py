"""Where a base is follows from its tag's corners, for both mountings; what is unsure says so."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

pytest.importorskip("cv2", reason="pip install garry[tag]")

from robot.homing.home_view import Carried, Mount
from robot.homing.tag_pose import base_from_home, find_place, is_clear, mount_matrix, solve_tag
from robot.motion.pose import HOME, Pose
from tests.support.tag_room import LENS, SIZE_M, TagRoom, on_floor, thing

# A camera that looks down by 45°.
DOWN = thing(1.2, 0.0, 1.2, 180.0, Carried.TAG)
DOWN[:3, :3] = mount_matrix(Mount(turned_rad=math.pi, tilted_rad=-math.pi / 4), Carried.CAMERA)[
    :3, :3
]
ROOMS = {
    "camera_on_base": TagRoom(),
    "camera_looks_aside": TagRoom(
        fixed=thing(-0.2, 0.9, 0.3, -120.0, Carried.CAMERA), mount=Mount(0.02, -0.1, math.pi / 2)
    ),
    "tag_on_mast": TagRoom(
        Carried.TAG, thing(1.0, 0.3, 0.4, -163.0, Carried.TAG), Mount(0.05, 0.02, -0.35)
    ),
    "tag_on_plate": TagRoom(Carried.TAG, DOWN, Mount(tilted_rad=math.pi / 2)),
}

places = st.builds(Pose, *[st.floats(-1.0, 1.0)] * 2, st.floats(-math.pi, math.pi, allow_nan=False))


@pytest.mark.parametrize("room", ROOMS.values(), ids=list(ROOMS))
@given(pose=places)
def test_the_pose_follows_from_the_tag_in_the_camera_s_frame(room, pose):
    base = base_from_home(room.tag_seen(pose), room.view())
    assert np.allclose(base, on_floor(pose), atol=1e-9)


@pytest.mark.parametrize("room", ROOMS.values(), ids=list(ROOMS))
@pytest.mark.parametrize(
    "pose", [HOME, Pose(-0.2, 0.05, 0.1), Pose(-0.1, -0.1, 0.05), Pose(-0.3, 0.0, 0.0)], ids=str
)
def test_the_pose_follows_from_its_corners(room, pose):
    corners = room.corners(pose)
    assert corners is not None
    place = find_place(corners, room.view())
    assert place is not None
    assert place.pose.distance_m(pose) < 0.002 + place.error_m
    assert place.pose.turn_rad(pose) < 0.002 + place.error_rad


def test_noise_of_corners_errs_as_it_says():
    room, errors, rng = TagRoom(), [], np.random.default_rng(1)
    exact = room.corners(HOME)
    for _ in range(60):
        place = find_place(exact + rng.normal(0.0, 0.2, (4, 2)), room.view())
        errors.append(place.pose.distance_m(HOME) / place.error_m)
    assert 0.6 < math.sqrt(np.mean(np.square(errors))) < 1.4


def test_from_the_front_far_away_it_does_not_pretend_to_know():
    """The two poses of a flat square are then alike: odometry chooses, or the doubt is told."""
    room = TagRoom(fixed=thing(2.3, 0.0, 0.25, 175.0, Carried.CAMERA))
    corners = room.corners(HOME) + np.array([[0.2, 0], [-0.2, 0], [-0.1, 0], [0.1, 0.1]])
    assert not is_clear(solve_tag(corners, SIZE_M, LENS))
    near = TagRoom()
    view = near.view()
    at_home = find_place(near.corners(HOME), view)
    frontal = find_place(corners, room.view())
    assert frontal.error_m > 10 * at_home.error_m
    expected = find_place(corners, room.view(), HOME)
    assert expected.pose.distance_m(HOME) <= frontal.error_m


def test_a_tag_that_is_tipped_is_no_pose_on_a_floor():
    room = TagRoom()
    tipped = room.tag_seen(HOME).copy()
    turn = math.radians(25)
    tip = np.array(
        [[1, 0, 0], [0, math.cos(turn), -math.sin(turn)], [0, math.sin(turn), math.cos(turn)]]
    )
    tipped[:3, :3] = tipped[:3, :3] @ tip
    half = SIZE_M / 2
    square = np.array([[-half, -half, 0], [half, -half, 0], [half, half, 0], [-half, half, 0]])
    points = square @ tipped[:3, :3].T + tipped[:3, 3]
    middle = np.array([(LENS.width_px - 1) / 2, (LENS.height_px - 1) / 2])
    corners = LENS.focal_px * points[:, :2] / points[:, 2:] + middle
    assert find_place(corners, room.view()) is None


def test_corners_of_no_square_are_no_pose():
    room = TagRoom()
    corners = room.corners(HOME).copy()
    corners[0] += 12.0
    assert find_place(corners, room.view()) is None
