"""The joints of a head or of arms: their poses, and what moves them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from robot.bases.base import Answer
from robot.ros.frames import Topic
from robot.ros.messages import FOLLOW, without_msg

# The tip of an arm of 0.5 m then goes 0.25 m/s, the reduced speed of ISO 10218-1.
FASTEST_RAD_S = 0.5
PEAK = 1.5  # peak over mean speed of a cubic from rest to rest
SHORTEST_S = 0.6
LONGEST_S = 3.0  # ours: what a lost connection has begun ends by itself


@dataclass(frozen=True, slots=True)
class JointServer:
    """What moves joints.

    Parameters
    ----------
    topic
        Takes a trajectory_msgs/JointTrajectory; or an action, FollowJointTrajectory.
    names
        Joints that may be named; empty for any.
    takes_all
        Whether all of them have to be named.
    states
        A sensor_msgs/JointState that says where they are, for a server that goes on with a motion
        whose goal was canceled; None for one that holds them by itself.
    end_rad_s
        Velocity in the last point [rad/s]: 0, to end at rest; for a server that takes it for the
        largest one on the way, that.
    """

    topic: Topic
    names: tuple[str, ...] = ()
    takes_all: bool = False
    states: Topic | None = None
    end_rad_s: float = 0.0

    @property
    def is_action(self) -> bool:
        """Whether it is an action server."""
        return without_msg(self.topic.kind) == FOLLOW


@dataclass(frozen=True, slots=True)
class Joints:
    """The joints of a head or of arms, and their angles [rad] at rest, glad and sad.

    All of its motions take equally long (``takes_s``): long enough from any of its poses to any
    other, wherever a motion before was broken off.
    """

    server: JointServer
    names: tuple[str, ...]
    rest_rad: tuple[float, ...]
    glad_rad: tuple[float, ...]
    sad_rad: tuple[float, ...]

    @property
    def takes_s(self) -> float:
        """How long each motion takes [s], so that no joint is faster than ``FASTEST_RAD_S``."""
        angles = zip(self.rest_rad, self.glad_rad, self.sad_rad, strict=True)
        farthest_rad = max(max(joint) - min(joint) for joint in angles)
        return max(SHORTEST_S, PEAK * farthest_rad / FASTEST_RAD_S)

    def pose_rad(self, answer: Answer) -> list[float]:
        """Return the angles of an answer [rad]: a gentle one goes only part of the way."""
        goal_rad = self.glad_rad if answer.is_glad else self.sad_rad
        return [
            rest + answer.strength * (goal - rest)
            for rest, goal in zip(self.rest_rad, goal_rad, strict=True)
        ]

    def write_trajectory(self, pose_rad: list[float]) -> dict[str, Any]:
        """Return a trajectory_msgs/JointTrajectory that begins now and ends standing still.

        Bridges of ROS 1 know a time by ``secs`` and ``nsecs`` alone; those of ROS 2 by these, too.
        Actions are of ROS 2, and get its own names.
        """
        secs, rest_s = divmod(self.takes_s, 1)
        names = ("sec", "nanosec") if self.server.is_action else ("secs", "nsecs")
        point = {
            "positions": pose_rad,
            "velocities": [self.server.end_rad_s] * len(pose_rad),
            "time_from_start": dict(zip(names, (int(secs), int(rest_s * 1e9)), strict=True)),
        }
        return {"joint_names": list(self.names), "points": [point]}
