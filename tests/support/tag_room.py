"""A room with a tag, and a camera of USB's cheap kind in it, on a clock that a test moves."""

from __future__ import annotations

import math
import random
from collections import deque
from collections.abc import Callable
from typing import Any, ClassVar

import numpy as np
from scipy.spatial.transform import Rotation

from robot.bases import Abilities
from robot.bases.kinematic import Imperfections
from robot.behavior.performer import Performer
from robot.homing.home_view import Carried, HomeView, Lens, Mount
from robot.homing.homing import Homing
from robot.homing.sighting import Corners, Sighting
from robot.homing.tag_pose import Matrix, mount_matrix
from robot.motion.base_response import Response
from robot.motion.pose import HOME, Pose
from tests.support.gesture_runs import OrdinaryBase
from tests.support.robot_stage import WELCOME, Stage

LENS = Lens(640, 480, math.radians(62.0))
SIZE_M = 0.16
# What a rendered tag of this size is found in (tests/bench/test_tag_home.py).
FARTHEST_M, MOST_OBLIQUE_RAD, MARGIN_PX = 3.0, math.radians(65.0), 4.0
AHEAD = Mount(0.1)
# Its corners stray by so much from frame to frame, and stand off by so much at a place [px]: what
# was measured of rendered pictures with noise (the same place), rounded up.
STRAY_PX, OFF_PX = 0.1, 0.2


def thing(x_m: float, y_m: float, z_m: float, turned_deg: float, carried: Carried) -> Matrix:
    """Return the pose in the room (4 × 4) of what is not carried: which way it looks, level."""
    other = Carried.TAG if carried is Carried.CAMERA else Carried.CAMERA
    matrix = mount_matrix(Mount(turned_rad=math.radians(turned_deg)), other)
    matrix[:3, 3] = x_m, y_m, z_m
    return matrix


def on_floor(pose: Pose) -> Matrix:
    """Return a pose on the floor (4 × 4)."""
    matrix = np.eye(4)
    matrix[:3, :3] = Rotation.from_euler("z", pose.heading_rad).as_matrix()
    matrix[:2, 3] = pose.x_m, pose.y_m
    return matrix


class TagRoom:
    """A base's tag and camera, one of which it carries; home is the room's middle.

    Parameters
    ----------
    carried
        What it carries.
    fixed
        Pose in the room of the other (4 × 4).
    mount
        Where on the base it carries it.
    """

    def __init__(
        self,
        carried: Carried = Carried.CAMERA,
        fixed: Matrix | None = None,
        mount: Mount = AHEAD,
        size_m: float = SIZE_M,
    ) -> None:
        self.carried, self.mount, self.size_m = carried, mount, size_m
        # The tag beside the treadmill, 0.9 m from home, turned away from its line of sight by 30°.
        self.fixed = thing(0.95, 0.25, 0.27, -135.0, carried) if fixed is None else fixed
        self._on_base = mount_matrix(mount, carried)
        self._on_base[2, 3] = 0.25

    def tag_seen(self, pose: Pose) -> Matrix:
        """Return the tag in the camera's frame (4 × 4) from where the base is."""
        carried = on_floor(pose) @ self._on_base
        if self.carried is Carried.CAMERA:
            return np.linalg.inv(carried) @ self.fixed
        return np.linalg.inv(self.fixed) @ carried

    def view(self, tag: int = 7) -> HomeView:
        """Return what is learned at home."""
        seen = self.tag_seen(HOME)
        x_rad, y_rad, z_rad = Rotation.from_matrix(seen[:3, :3]).as_rotvec().tolist()
        x_m, y_m, z_m = seen[:3, 3].tolist()
        return HomeView(
            "0",
            tag,
            self.size_m,
            self.carried,
            self.mount,
            LENS,
            (x_rad, y_rad, z_rad),
            (x_m, y_m, z_m),
        )

    def corners(self, pose: Pose) -> Matrix | None:
        """Return where its corners are in a frame (4 × 2) [px]; None where it is not found."""
        seen, half = self.tag_seen(pose), self.size_m / 2
        square = np.array([[-half, -half], [half, -half], [half, half], [-half, half]])
        points = square @ seen[:3, :2].T + seen[:3, 3]
        away_m = float(np.linalg.norm(seen[:3, 3]))
        oblique = float(seen[:3, 2] @ seen[:3, 3]) / away_m
        if points[:, 2].min() < 0.05 or oblique < math.cos(MOST_OBLIQUE_RAD) or away_m > FARTHEST_M:
            return None
        middle = np.array([(LENS.width_px - 1) / 2, (LENS.height_px - 1) / 2])
        found: Matrix = LENS.focal_px * points[:, :2] / points[:, 2:] + middle
        low, high = MARGIN_PX, 2 * middle - MARGIN_PX
        return found if (found > low).all() and (found < high).all() else None


class MovedBase(OrdinaryBase):
    """A real base that was moved: nobody knows where it is."""

    name: ClassVar[str] = "moved"
    abilities = Abilities(simulated=False, moves=True)

    def put(self, pose: Pose) -> None:
        """Put it somewhere, seen from home."""
        self._truth = pose


class SimulatedEye:
    """A camera and a detector: 12 frames a second, 50 to 150 ms late, with noise.

    Parameters
    ----------
    room
        Where it is.
    base
        The base, whose true pose counts.
    monotonic
        The clock [s].
    chance
        Of its noise.

    Attributes
    ----------
    see
        Returns the tags of a frame from a true pose. A test may replace it.
    every_s
        Between two frames, on average [s].
    problem
        Of each frame.
    is_silent
        Whether no frames come.
    late_s
        How much later than that they come, with an old stamp [s].
    watched
        How often it was asked to look.
    """

    def __init__(
        self,
        room: TagRoom,
        base: MovedBase,
        monotonic: Callable[[], float],
        chance: random.Random,
    ) -> None:
        self._room, self._base, self._monotonic, self._chance = room, base, monotonic, chance
        self._noise = np.random.default_rng(chance.getrandbits(32))
        self._next_s = -math.inf
        self._coming: deque[tuple[float, Sighting]] = deque()
        self._off_px: Matrix = np.zeros((4, 2))
        self._stood = HOME
        self.see: Callable[[Pose], list[tuple[int, Corners]]] = self.tags
        self.every_s, self.late_s = 1 / 12, 0.0
        self.problem, self.is_silent, self.watched = "", False, 0

    def watch(self, now_s: float) -> None:
        """Take a frame, where it is time for one."""
        self.watched += 1
        if now_s < self._next_s:
            return
        self._next_s = max(self._next_s, now_s) + self.every_s * self._chance.uniform(0.8, 1.2)
        if not self.is_silent:
            tags = () if self.problem else tuple(self.see(self._base.ground_truth().pose))
            comes_s = now_s + self._chance.uniform(0.05, 0.15)
            size_px = LENS.width_px, LENS.height_px
            frame = Sighting(comes_s, tags, size_px, self.problem)
            self._coming.append((comes_s + self.late_s, frame))

    def take(self) -> list[Sighting]:
        """Return the frames that have come since the last call."""
        came = list[Sighting]()
        while self._coming and self._coming[0][0] <= self._monotonic():
            came.append(self._coming.popleft()[1])
        return came

    def tags(self, pose: Pose, number: int = 7) -> list[tuple[int, Corners]]:
        """Return the room's tag from a pose, with noise; none where it is not found."""
        corners = self._room.corners(pose)
        if corners is None:
            return []
        if pose.distance_m(self._stood) > 0.002 or pose.turn_rad(self._stood) > 0.002:
            self._stood, self._off_px = pose, self._noise.normal(0.0, OFF_PX, (4, 2))
        corners = corners + self._off_px + self._noise.normal(0.0, STRAY_PX, (4, 2))
        return [(number, tuple((float(x), float(y)) for x, y in corners))]


class HomingStage(Stage):
    """A real base that was moved, armed, whose session does not run, with a tag to find home by.

    Parameters
    ----------
    moved
        Where it is, seen from home.
    seed
        Of the base's faults, and of the camera's noise.
    room
        Where it is.
    """

    def __init__(self, moved: Pose, seed: int = 1, room: TagRoom | None = None) -> None:
        chance = random.Random(seed)
        faults = Imperfections(
            chance.uniform(0.08, 0.25),
            chance.uniform(0.02, 0.06),
            left_scale=1 - chance.uniform(0.0, 0.02),
            drift_deg_min=3.0,
        )
        super().__init__(lambda monotonic: MovedBase(monotonic, faults))
        self.room = room or TagRoom()
        self.base: MovedBase
        self.base.response = Response()  # nobody has measured it
        self.eye = SimulatedEye(self.room, self.base, lambda: self.now_s, chance)
        homing = Homing(self.room.view(), self.eye, self.base.response)
        self.robot = Performer(self.base, homing=homing)
        self.ordered: list[Any] = []
        self.hear(**WELCOME | {"state": "paused"})
        self.hear(type="arm")
        self.wait(0.1)
        self.base.put(moved)

    @property
    def code(self) -> str:
        """How its way home goes, or ended."""
        assert self.robot.body.homing is not None
        return self.robot.body.homing.code

    @property
    def truth(self) -> Pose:
        """Where it is."""
        return self.base.ground_truth().pose

    def hold(self, for_s: float, until: Callable[[], bool] = lambda: False) -> None:
        """Hold the button that drives it home: an order every 0.1 s."""
        for _ in range(round(for_s / 0.1)):
            if until():
                return
            self.hear(type="drive", ahead=0, left=0, home=True)
            for _ in range(5):
                self.wait(0.02)
                self.ordered.append(self.robot.body.ordered)

    def go_home(self, within_s: float = 120.0) -> str:
        """Hold the button until it is home or gives up, and return which."""
        self.hold(0.1)
        homing = self.robot.body.homing
        assert homing is not None
        self.hold(within_s, lambda: homing.is_home or homing.has_given_up or self.is_disarmed)
        return self.code

    @property
    def is_disarmed(self) -> bool:
        """Whether a person has to arm it."""
        return not self.robot.body.safety.is_armed


def find_start(room: TagRoom, chance: random.Random) -> Pose:
    """Return a place 0.3 to 1.5 m from home where its tag is found in some direction."""
    while True:
        away_m, at_rad = chance.uniform(0.3, 1.5), chance.uniform(-math.pi, math.pi)
        x_m, y_m = away_m * math.cos(at_rad), away_m * math.sin(at_rad)
        headings = [math.radians(10 * step) for step in range(36)]
        if any(room.corners(Pose(x_m, y_m, heading)) is not None for heading in headings):
            return Pose(x_m, y_m, chance.uniform(-math.pi, math.pi))
