"""What a base by ROS says, and how it moves its head or arms, beside its driving."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from robot.bases.base import Answer
from robot.ros.frames import Frame, Topic, publish

# The tip of an arm of 0.5 m then goes 0.25 m/s, the reduced speed of ISO 10218-1.
FASTEST_RAD_S = 0.5
PEAK = 1.5  # peak over mean speed of a cubic from rest to rest
SHORTEST_S = 0.6
LONGEST_S = 3.0  # ours: ROS 2 has no message that ends a motion which was begun

# A controller of ROS 1 stays where it is at a trajectory without points; one of ROS 2 refuses it
# (docs/reference/rosbridge.md#head-arms-and-speech).
HOLD: dict[str, Any] = {"joint_names": [], "points": []}


@dataclass(frozen=True, slots=True)
class Voice:
    """Where to send what a base says (std_msgs/String), and its words; empty: it says nothing."""

    topic: Topic
    glad: str = ""
    sad: str = ""


@dataclass(frozen=True, slots=True)
class Joints:
    """The joints of a head or of arms, and their angles [rad] at rest, glad and sad.

    All of its motions take equally long (``takes_s``): long enough from any of its poses to any
    other, wherever a motion before was broken off.
    """

    topic: Topic  # of trajectory_msgs/JointTrajectory
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
        """
        secs, rest_s = divmod(self.takes_s, 1)
        point = {
            "positions": pose_rad,
            "velocities": [0.0] * len(pose_rad),
            "time_from_start": {"secs": int(secs), "nsecs": int(rest_s * 1e9)},
        }
        return {"joint_names": list(self.names), "points": [point]}


class VoiceAndJoints:
    """The voice and the joints of a base, either of which it may lack.

    An answer raises it; it goes back to rest where the gesture has ended well, and stays as it is
    where anything else has ended it, also after an arming: that starts no motion.
    """

    def __init__(self, voice: Voice | None, joints: Joints | None) -> None:
        self._voice, self._joints = voice, joints
        self._is_raised = False

    def answer(self, answer: Answer) -> Iterator[Frame]:
        """Yield what begins an answer; nothing for what answers no window."""
        if answer.is_glad is None:
            return
        voice, joints = self._voice, self._joints
        if voice is not None and not answer.is_quiet:
            words = voice.glad if answer.is_glad else voice.sad
            if words:
                yield publish(voice.topic, {"data": words})
        if joints is not None:
            self._is_raised = True
            yield publish(joints.topic, joints.write_trajectory(joints.pose_rad(answer)))

    def show(self, state: str) -> Iterator[Frame]:
        """Yield what ends an answer, where this state (an ``Indication``) does."""
        joints = self._joints
        if joints is None or not self._is_raised or state == "moving":
            return
        self._is_raised = False
        to_rest = state == "ready"
        yield publish(
            joints.topic, joints.write_trajectory(list(joints.rest_rad)) if to_rest else HOLD
        )

    def disconnect(self) -> None:
        """Forget the answer: nothing reaches it, and its motion ends by itself."""
        self._is_raised = False
