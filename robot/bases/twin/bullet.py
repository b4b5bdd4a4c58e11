"""The twin's body in a world of physics, where pybullet is installed."""

from __future__ import annotations

import contextlib
import math
import os
from collections.abc import Sequence
from importlib.resources import as_file, files
from pathlib import Path
from typing import Any

from robot.bases.kobuki_protocol.feedback import SensorSide, Wheel
from robot.bases.twin.bodies import Touch
from robot.motion.pose import HOME, Pose, advance, wrap
from robot.motion.twist import Twist

# Of 2.5 ms each in a frame: 400 Hz, finer than the 240 Hz of docs/reference/kobuki.md#twin.
STEPS = 8

# Measures of the parts: docs/reference/kobuki.md#twin; the same as in kobuki.urdf.
WHEEL_M = 0.035
TORQUE_MAX_N_M = 1.0
FRICTION = {"base": 0.3, "left_wheel": 1.0, "right_wheel": 1.0}  # casters: 0
CENTER_OF_MASS_M = (0.01, 0.0, 0.0102)
SENSOR_HEIGHT_M = 0.0316
# Rays are cast down from these points: the floor sensors right, center and left, and the axles of
# the wheels right and left.
FLOOR_SENSORS_M = (
    (0.085, -0.136, SENSOR_HEIGHT_M),
    (0.156, 0.0, SENSOR_HEIGHT_M),
    (0.087, 0.136, SENSOR_HEIGHT_M),
)
AXLES_M = ((0.0, -0.115, WHEEL_M), (0.0, 0.115, WHEEL_M))
SENSOR_RANGE_M = 0.15  # how far the floor sensors see
LEVEL, LEVEL_M = 0.9999, 0.002  # standing like this (cosine of 0.8°, height), no wheel hangs
DROP_M = 0.01  # a wheel that hangs lower than this under its place has dropped; ours have no spring
# The bumper's three thirds of the front half; touched by what is nearer than 1 mm (both our own).
THIRD_RAD = math.pi / 6
TOUCH_M = 0.001

ROBOT, SURROUNDINGS = 1, 2  # collision groups, so that rays do not meet the robot itself
FLOOR_SIZE_M = (10.0, 10.0, 0.5)
WALL_SIZE_M = (0.05, 1.0, 0.25)


def redirect_output() -> int:
    """Return a file for answers alone in place of standard output, and import pybullet.

    pybullet prints past Python: its build date when it is imported, and more when it ends.
    """
    answers, errors = os.dup(1), os.dup(2)
    with Path(os.devnull).open("w") as nowhere:
        os.dup2(nowhere.fileno(), 1)
        os.dup2(nowhere.fileno(), 2)
    with contextlib.suppress(ImportError):
        import pybullet  # noqa: F401
    os.dup2(errors, 2)
    os.close(errors)
    return answers


class BulletBody:
    """A Kobuki of primitives in a world of its own, for frames of a length [s].

    Raises ImportError where pybullet is not installed.
    """

    def __init__(self, frame_s: float) -> None:
        import pybullet
        from pybullet_utils.bullet_client import BulletClient

        self._world: Any = BulletClient(pybullet.DIRECT)
        self._world.setTimeStep(frame_s / STEPS)
        self._world.setGravity(0, 0, -9.81)
        # Friction in two directions instead of a cone: odometry creeps ten times less (measured).
        self._world.setPhysicsEngineParameter(enableFileCaching=0, enableConeFriction=0)
        self._floor = self._put_box(FLOOR_SIZE_M, (0.0, 0.0, -FLOOR_SIZE_M[2] / 2), 0.0)
        with as_file(files("robot.bases.twin") / "kobuki.urdf") as urdf:
            self._robot = self._world.loadURDF(
                str(urdf),
                flags=pybullet.URDF_USE_IMPLICIT_CYLINDER | pybullet.URDF_USE_INERTIA_FROM_FILE,
            )
        names = {
            self._world.getJointInfo(self._robot, joint)[12].decode(): joint
            for joint in range(self._world.getNumJoints(self._robot))
        }
        self._wheels = [names["left_wheel"], names["right_wheel"]]
        for name, link in {"base": -1, **names}.items():
            # Its damping is left alone: setting it to 0 makes the wheels drag (measured).
            self._world.changeDynamics(self._robot, link, lateralFriction=FRICTION.get(name, 0.0))
            self._world.setCollisionFilterGroupMask(self._robot, link, ROBOT, SURROUNDINGS)
        # What is called in every frame, bound once.
        self._step = self._world.stepSimulation
        self._locate = self._world.getBasePositionAndOrientation
        self._rotate = self._world.getMatrixFromQuaternion
        self._read_joints = self._world.getJointStates
        self._find_contacts = self._world.getContactPoints
        self._cast_rays = self._world.rayTestBatch
        self._frame_s, self._walls = frame_s, list[int]()
        self._order: tuple[float, float] | None = None
        self._at_m = (0.0, 0.0, 0.0)
        self._axes = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)  # rows of the rotation
        self._torque_n_m = (0.0, 0.0)
        self.pose, self.turn_rad_s, self.rolled_m = HOME, 0.0, (0.0, 0.0)
        for _ in range(10):  # it comes to rest on its wheels
            self.roll(0.0, 0.0)
        self.carry_home()

    def roll(self, left_m_s: float, right_m_s: float) -> None:
        """Turn its wheels at ``left_m_s`` and ``right_m_s`` [m/s] for one frame's time."""
        world = self._world
        if (left_m_s, right_m_s) != self._order:
            self._order = (left_m_s, right_m_s)
            world.setJointMotorControlArray(
                self._robot,
                self._wheels,
                world.VELOCITY_CONTROL,
                targetVelocities=[left_m_s / WHEEL_M, right_m_s / WHEEL_M],
                forces=[TORQUE_MAX_N_M, TORQUE_MAX_N_M],
            )
        for _ in range(STEPS):
            self._step()
        was_rad = self.pose.heading_rad
        self._update_state()
        self.turn_rad_s = (self.pose.heading_rad - was_rad) / self._frame_s

    def touch(self) -> Touch:
        """Return what it touches now."""
        right_m, center_m, left_m = self._measure_down(FLOOR_SENSORS_M)
        return Touch(
            self._bumper_bits() if self._walls else 0,
            0 if self._is_level else self._wheel_drop_bits(),
            (right_m, center_m, left_m),
            self._torque_n_m,
        )

    def carry_home(self) -> None:
        """Put it where it began."""
        self._world.resetBasePositionAndOrientation(
            self._robot, CENTER_OF_MASS_M, (0.0, 0.0, 0.0, 1.0)
        )
        self._world.resetBaseVelocity(self._robot, (0, 0, 0), (0, 0, 0))
        self._update_state()
        self.pose = HOME

    def put_wall(self, ahead_m: float) -> None:
        """Put a wall so far in front of its middle [m]."""
        away_m = ahead_m + WALL_SIZE_M[0] / 2
        middle_m = self._place_ahead(away_m, WALL_SIZE_M[2] / 2)
        self._walls.append(self._put_box(WALL_SIZE_M, middle_m, self.pose.heading_rad))

    def put_edge(self, ahead_m: float) -> None:
        """End the floor so far in front of its middle [m]."""
        self._world.removeBody(self._floor)
        away_m = ahead_m - FLOOR_SIZE_M[0] / 2
        middle_m = self._place_ahead(away_m, -FLOOR_SIZE_M[2] / 2)
        self._floor = self._put_box(FLOOR_SIZE_M, middle_m, self.pose.heading_rad)

    def _update_state(self) -> None:
        """Read where it is and how far its wheels have rolled."""
        (x_m, y_m, z_m), turned = self._locate(self._robot)
        self._axes = a = self._rotate(turned)
        # What pybullet gives is the place of the center of mass.
        cx, _, cz = CENTER_OF_MASS_M
        self._at_m = x_m, y_m, z_m = (
            x_m - a[0] * cx - a[2] * cz,
            y_m - a[3] * cx - a[5] * cz,
            z_m - a[6] * cx - a[8] * cz,
        )
        was_rad = self.pose.heading_rad
        self.pose = Pose(x_m, y_m, was_rad + wrap(math.atan2(a[3], a[0]) - was_rad))
        left, right = self._read_joints(self._robot, self._wheels)
        self.rolled_m = (left[0] * WHEEL_M, right[0] * WHEEL_M)
        self._torque_n_m = (left[3], right[3])

    @property
    def _is_level(self) -> bool:
        return self._axes[8] > LEVEL and abs(self._at_m[2]) < LEVEL_M

    def _bumper_bits(self) -> int:
        """Return the bits of the bumper that walls press."""
        bumper, a, (x_m, y_m, _) = 0, self._axes, self._at_m
        for contact in self._find_contacts(self._robot, linkIndexA=-1):
            if contact[2] in self._walls and contact[8] <= TOUCH_M:
                east_m, north_m = contact[5][0] - x_m, contact[5][1] - y_m
                bumper |= _third(
                    math.atan2(a[1] * east_m + a[4] * north_m, a[0] * east_m + a[3] * north_m)
                )
        return bumper

    def _wheel_drop_bits(self) -> int:
        """Return the bits of the wheels that hang."""
        right_m, left_m = self._measure_down(AXLES_M)
        right = Wheel.RIGHT if right_m > WHEEL_M + DROP_M else 0
        return right | (Wheel.LEFT if left_m > WHEEL_M + DROP_M else 0)

    def _measure_down(self, points_m: Sequence[tuple[float, float, float]]) -> list[float]:
        """Return the distance down from each of these points to anything [m]."""
        a, (x_m, y_m, z_m) = self._axes, self._at_m
        down_x, down_y, down_z = SENSOR_RANGE_M * a[2], SENSOR_RANGE_M * a[5], SENSOR_RANGE_M * a[8]
        starts, ends = [], []
        for px, py, pz in points_m:
            x = x_m + a[0] * px + a[1] * py + a[2] * pz
            y = y_m + a[3] * px + a[4] * py + a[5] * pz
            z = z_m + a[6] * px + a[7] * py + a[8] * pz
            starts.append((x, y, z))
            ends.append((x - down_x, y - down_y, z - down_z))
        hits = self._cast_rays(starts, ends, collisionFilterMask=SURROUNDINGS)
        return [SENSOR_RANGE_M * hit[2] for hit in hits]

    def _place_ahead(self, away_m: float, z_m: float) -> tuple[float, float, float]:
        place = advance(self.pose, Twist(away_m), 1.0)
        return place.x_m, place.y_m, z_m

    def _put_box(
        self, size_m: tuple[float, float, float], middle_m: tuple[float, ...], heading_rad: float
    ) -> int:
        """Put a fixed box, and return its number."""
        world = self._world
        half = [side / 2 for side in size_m]
        box: int = world.createMultiBody(
            baseMass=0,
            baseCollisionShapeIndex=world.createCollisionShape(world.GEOM_BOX, halfExtents=half),
            baseVisualShapeIndex=world.createVisualShape(world.GEOM_BOX, halfExtents=half),
            basePosition=middle_m,
            baseOrientation=world.getQuaternionFromEuler((0, 0, heading_rad)),
        )
        world.changeDynamics(box, -1, lateralFriction=1.0)
        world.setCollisionFilterGroupMask(box, -1, SURROUNDINGS, ROBOT)
        return box


def _third(angle_rad: float) -> int:
    """Return the bumper's part at an angle, counter-clockwise from ahead; 0 at the back."""
    if abs(angle_rad) > math.pi / 2:
        return 0
    if abs(angle_rad) <= THIRD_RAD:
        return SensorSide.CENTER
    return SensorSide.LEFT if angle_rad > 0 else SensorSide.RIGHT
