"""Where a base is, by the corners of its tag in a camera's frame. Needs OpenCV.

A flat square leads to two poses of the tag, mirrored about the line of sight (Collins and Bartoli,
"Infinitesimal plane-based pose estimation", 2014; OpenCV's SOLVEPNP_IPPE_SQUARE). Each is fitted
again as the pose of a base on a floor, which hardly tips or rises. The one that fits worse by more
than chance is dropped; where that does not tell, odometry may, or else the middle of the two is
used as a place to look again from. How surely the corners tell the pose follows from the same fit.

A tag's x is to the right and its y down, as printed; its z points into the sheet. So one that is
seen from the front is not turned. (SOLVEPNP_IPPE_SQUARE has y up: half a turn away, where IPPE's
rotation vectors are wrong: docs/reference/kobuki.md#cameras-and-tags.)
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt
from scipy.optimize import least_squares

from robot.homing.home_view import Carried, HomeView, Lens, Mount
from robot.motion.pose import Pose, wrap

Matrix = npt.NDArray[np.float64]

# Corners err by this much [px], in each direction: the mean of some frames at one place, measured
# on rendered pictures with noise and blur (tests/bench/test_tag_home.py).
CORNER_PX = 0.2
# A base on a floor tips and rises by no more than this [rad; m, and m for each m of way], with a
# mount that is known to some degrees. More than three times as much is another tag, or another
# mount. (Ours.)
TIPS_RAD, RISES_M, RISES_M_M = math.radians(3.0), 0.02, 0.04
UNLIKELY = 3.0
MISFIT_PX = 1.5  # corners that fit no better are none of a flat square of that size (ours)
# One of two poses is that much likelier than the other (in χ²): 20 times.
LIKELIER = 6.0


@dataclass(frozen=True, slots=True)
class Solution:
    """A pose of the tag that its corners allow.

    Parameters
    ----------
    turn_rad, place_m
        The tag in the camera's frame: a rotation vector [rad], and a place [m].
    misfit_px
        Root mean square distance of its corners from those that were seen [px].
    """

    turn_rad: Matrix
    place_m: Matrix
    misfit_px: float

    @property
    def tag(self) -> Matrix:
        """The tag in the camera's frame (4 × 4)."""
        return rigid(self.turn_rad, self.place_m)


@dataclass(frozen=True, slots=True)
class Place:
    """Where a base is, by its tag.

    Parameters
    ----------
    pose
        From home.
    error_m, error_rad
        Standard errors of its place [m] and heading [rad].
    """

    pose: Pose
    error_m: float
    error_rad: float


@dataclass(frozen=True, slots=True)
class _Fit:
    place: Place
    chi2: float
    misfit_px: float
    is_likely: bool  # neither tips nor rises


def solve_tag(corners_px: Matrix, size_m: float, lens: Lens) -> list[Solution]:
    """Return the one or two poses of a tag, the better first; none where they are of no square.

    Parameters
    ----------
    corners_px
        Its corners (4 × 2) [px], top left first, then clockwise.
    size_m
        Side of its black square [m].
    lens
        Of the camera.
    """
    try:
        _, turns, places, misfits = cv2.solvePnPGeneric(
            _square(size_m),
            corners_px.astype(np.float64),
            _camera_matrix(lens),
            None,
            flags=cv2.SOLVEPNP_IPPE,
        )
    except cv2.error:  # corners on one line, or all in one place
        return []
    solutions = [
        Solution(
            np.asarray(turn.ravel(), np.float64),
            np.asarray(place.ravel(), np.float64),
            float(misfit.item()),
        )
        for turn, place, misfit in zip(turns, places, misfits, strict=True)
        if np.isfinite(turn).all() and np.isfinite(place).all() and place[2, 0] > 0
    ]
    return sorted(solutions, key=lambda solution: solution.misfit_px)


def is_clear(solutions: list[Solution]) -> bool:
    """Whether the first of a tag's poses fits its corners clearly better than the second."""
    chi2 = [4 * (solution.misfit_px / CORNER_PX) ** 2 for solution in solutions]
    return len(chi2) == 1 or chi2[1] - chi2[0] >= LIKELIER


def find_place(corners_px: Matrix, view: HomeView, expected: Pose | None = None) -> Place | None:
    """Return where the base is; None where no pose on a floor fits the corners.

    Parameters
    ----------
    corners_px
        The tag's corners (4 × 2) [px], top left first, then clockwise.
    view
        How the tag is seen from home.
    expected
        The pose by odometry since the last time; None where there was none.
    """
    fits = sorted(
        (
            fit
            for solution in solve_tag(corners_px, view.size_m, view.lens)
            if (fit := _fit(corners_px, view, base_from_home(solution.tag, view))).is_likely
        ),
        key=lambda fit: fit.chi2,
    )
    if not fits or fits[0].misfit_px > MISFIT_PX:
        return None
    best, other = fits[0].place, fits[-1].place
    if fits[-1].chi2 - fits[0].chi2 >= LIKELIER:
        return best
    apart_m, apart_rad = best.pose.distance_m(other.pose), best.pose.turn_rad(other.pose)
    if expected is not None:
        near, far = sorted((best, other), key=lambda place: _difference(place.pose, expected))
        if 2 * _difference(near.pose, expected) < _difference(far.pose, expected):
            return near
    middle = Pose(
        (best.pose.x_m + other.pose.x_m) / 2,
        (best.pose.y_m + other.pose.y_m) / 2,
        best.pose.heading_rad + wrap(other.pose.heading_rad - best.pose.heading_rad) / 2,
    )
    return Place(middle, best.error_m + apart_m / 2, best.error_rad + apart_rad / 2)


def _fit(corners_px: Matrix, view: HomeView, start: Matrix) -> _Fit:
    """Fit the pose of a base that hardly tips or rises to a tag's corners."""
    x_m, y_m = float(start[0, 3]), float(start[1, 3])
    rises_m = RISES_M + RISES_M_M * math.hypot(x_m, y_m)
    beliefs = np.array([TIPS_RAD, TIPS_RAD, rises_m])
    before, after = _around_base(view)
    square = after[:3, :3] @ _square(view.size_m).T + after[:3, 3:]
    lens = _camera_matrix(view.lens) @ before[:3, :3], _camera_matrix(view.lens) @ before[:3, 3:]

    def off(unknown: Matrix) -> Matrix:
        base = _base(unknown)
        if view.carried is Carried.CAMERA:
            points = base[:3, :3].T @ (square - base[:3, 3:])
        else:
            points = base[:3, :3] @ square + base[:3, 3:]
        seen = lens[0] @ points + lens[1]
        pixels = (seen[:2] / np.maximum(seen[2], 1e-3)).T
        return np.concatenate([((pixels - corners_px) / CORNER_PX).ravel(), unknown[3:] / beliefs])

    heading_rad = math.atan2(float(start[1, 0]), float(start[0, 0]))
    fitted = least_squares(off, np.array([x_m, y_m, heading_rad, 0.0, 0.0, 0.0]), method="lm")
    x_m, y_m, heading_rad = (float(number) for number in fitted.x[:3])
    slopes = np.asarray(fitted.jac, np.float64)
    spread = np.linalg.pinv(slopes.T @ slopes)
    corners_off_px = CORNER_PX * fitted.fun[:8]
    return _Fit(
        Place(
            Pose(x_m, y_m, wrap(heading_rad)),
            math.sqrt(spread[0, 0] + spread[1, 1]),
            math.sqrt(spread[2, 2]),
        ),
        2 * float(fitted.cost),
        math.sqrt(float((corners_off_px**2).sum()) / 4),
        bool((np.abs(fitted.fun[8:]) <= UNLIKELY).all()),
    )


def _base(unknown: Matrix) -> Matrix:
    """Return the pose (4 × 4) of x, y, heading, tips to two sides (small), and height."""
    x_m, y_m, heading_rad, tips_x_rad, tips_y_rad, z_m = map(float, unknown)
    cos, sin = math.cos(heading_rad), math.sin(heading_rad)
    cos_x, sin_x = math.cos(tips_x_rad), math.sin(tips_x_rad)
    cos_y, sin_y = math.cos(tips_y_rad), math.sin(tips_y_rad)
    turned = np.array([[cos, -sin, 0], [sin, cos, 0], [0, 0, 1]])
    tipped = np.array(
        [
            [cos_y, sin_y * sin_x, sin_y * cos_x],
            [0, cos_x, -sin_x],
            [-sin_y, cos_y * sin_x, cos_y * cos_x],
        ]
    )
    base = np.eye(4)
    base[:3, :3], base[:3, 3] = turned @ tipped, (x_m, y_m, z_m)
    return base


def base_from_home(tag: Matrix, view: HomeView) -> Matrix:
    """Return the pose of the base from home (4 × 4), by that of the tag in the camera's frame.

    With the mount M of what the base carries, and the tag T₀ in the camera's frame at home: a
    camera on a base at B sees the tag at T = M⁻¹ B⁻¹ M T₀, one in the room at T = T₀ M⁻¹ B M.
    """
    before, after = _around_base(view)
    base = np.linalg.inv(before) @ tag @ np.linalg.inv(after)
    return np.asarray(np.linalg.inv(base) if view.carried is Carried.CAMERA else base)


def _around_base(view: HomeView) -> tuple[Matrix, Matrix]:
    """Return what stands before and after the base's pose, or its inverse, in that product."""
    tag = rigid(np.array(view.turn_rad), np.array(view.place_m))
    mount = mount_matrix(view.mount, view.carried)
    if view.carried is Carried.CAMERA:
        return np.asarray(np.linalg.inv(mount)), np.asarray(mount @ tag)
    return np.asarray(tag @ np.linalg.inv(mount)), mount


def mount_matrix(mount: Mount, carried: Carried) -> Matrix:
    """Return the pose on the base (4 × 4) of a camera, or of a tag."""
    turned, tilted = mount.turned_rad, mount.tilted_rad
    looks = np.array(
        [
            math.cos(tilted) * math.cos(turned),
            math.cos(tilted) * math.sin(turned),
            math.sin(tilted),
        ]
    )
    right = np.array([math.sin(turned), -math.cos(turned), 0.0])
    if carried is Carried.TAG:  # it is seen by who looks at its face
        looks, right = -looks, -right
    matrix = np.eye(4)
    matrix[:3, :3] = np.column_stack([right, np.cross(looks, right), looks])
    matrix[:2, 3] = mount.ahead_m, mount.left_m
    return matrix


def rigid(turn_rad: Matrix, place_m: Matrix) -> Matrix:
    """Return a pose (4 × 4) of a rotation vector [rad] and a place [m]."""
    angle = float(np.linalg.norm(turn_rad))
    x, y, z = turn_rad / angle if angle > 1e-12 else (0.0, 0.0, 0.0)
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])  # Rodrigues' formula
    matrix = np.eye(4)
    matrix[:3, :3] += math.sin(angle) * cross + (1 - math.cos(angle)) * cross @ cross
    matrix[:3, 3] = place_m
    return matrix


def _camera_matrix(lens: Lens) -> Matrix:
    middle = (lens.width_px - 1) / 2, (lens.height_px - 1) / 2
    return np.array(
        [[lens.focal_px, 0, middle[0]], [0, lens.focal_px, middle[1]], [0, 0, 1]], np.float64
    )


def _square(size_m: float) -> Matrix:
    """Return the corners of a tag in its own frame (4 × 3) [m]."""
    half = size_m / 2
    return np.array([[-half, -half, 0], [half, -half, 0], [half, half, 0], [-half, half, 0]])


def _difference(pose: Pose, other: Pose) -> float:
    """Return how far apart two poses are [m], a radian as much as a meter."""
    return pose.distance_m(other) + pose.turn_rad(other)
