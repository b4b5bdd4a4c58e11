"""Bodies of the twin: what rolls, and what it touches. One with physics is in ``bullet``."""

from __future__ import annotations

from typing import NamedTuple, Protocol

from robot.motion.pose import HOME, Pose, advance
from robot.motion.twist import Twist

# Where the floor sensors see the floor they stand on [m]: 10.2 mm and 21.4 mm up
# (docs/reference/kobuki.md#twin).
FLOOR_M = 0.0316


class Touch(NamedTuple):
    """What a body touches.

    Parameters
    ----------
    bumper, wheel_drop
        Bits as in ``CoreSensors``.
    floor_m
        How far away the floor is from the sensors: right, center, left [m].
    torque_n_m
        Of the wheels, left and right [N·m].
    """

    bumper: int = 0
    wheel_drop: int = 0
    floor_m: tuple[float, float, float] = (FLOOR_M, FLOOR_M, FLOOR_M)
    torque_n_m: tuple[float, float] = (0.0, 0.0)


class WheeledBody(Protocol):
    """Two wheels and what they carry.

    Attributes
    ----------
    pose
        Where it is in truth, from where it began.
    turn_rad_s
        How fast it turns in truth [rad/s].
    rolled_m
        How far its wheels have rolled, left and right [m].
    """

    pose: Pose
    turn_rad_s: float
    rolled_m: tuple[float, float]

    def roll(self, left_m_s: float, right_m_s: float) -> None:
        """Turn its wheels at ``left_m_s`` and ``right_m_s`` [m/s] for one frame's time."""

    def touch(self) -> Touch:
        """Return what it touches now."""

    def carry_home(self) -> None:
        """Put it where it began."""

    def put_wall(self, ahead_m: float) -> None:
        """Put a wall so far in front of its middle [m]. Raises NotImplementedError."""

    def put_edge(self, ahead_m: float) -> None:
        """End the floor so far in front of its middle [m]. Raises NotImplementedError."""


class KinematicBody:
    """Rolls exactly as ordered on an endless empty floor, for frames of a length [s]."""

    def __init__(self, frame_s: float) -> None:
        self._frame_s = frame_s
        self.pose = HOME
        self.turn_rad_s = 0.0
        self.rolled_m = (0.0, 0.0)

    def roll(self, left_m_s: float, right_m_s: float) -> None:
        """Turn its wheels at ``left_m_s`` and ``right_m_s`` [m/s] for one frame's time."""
        twist = Twist.of_wheels(left_m_s, right_m_s)
        self.pose = advance(self.pose, twist, self._frame_s)
        self.turn_rad_s = twist.w_rad_s
        left_m, right_m = self.rolled_m
        self.rolled_m = (left_m + left_m_s * self._frame_s, right_m + right_m_s * self._frame_s)

    def touch(self) -> Touch:
        """Return that it touches the floor alone."""
        return Touch()

    def carry_home(self) -> None:
        """Put it where it began."""
        self.pose = HOME

    def put_wall(self, ahead_m: float) -> None:
        """Refuse: there is nothing here to touch."""
        raise NotImplementedError(NOTHING_TO_TOUCH)

    def put_edge(self, ahead_m: float) -> None:
        """Refuse: there is nothing here to fall from."""
        raise NotImplementedError(NOTHING_TO_TOUCH)


NOTHING_TO_TOUCH = (
    "The kinematic body touches nothing. Cure: --body bullet (pybullet), or set the bumper bits."
)
