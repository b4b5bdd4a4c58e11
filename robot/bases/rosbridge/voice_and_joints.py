"""What a base by ROS says, and how it moves its head or arms, beside its driving."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass

from robot.bases.base import Answer
from robot.bases.rosbridge.joint_mover import JointMover, TrajectoryAction, make_mover
from robot.bases.rosbridge.joints import Joints
from robot.ros.frames import ActionResult, Frame, Publication, Topic, publish
from robot.ros.messages import read_joints


@dataclass(frozen=True, slots=True)
class Voice:
    """Where to send what a base says (std_msgs/String), and its words; empty: it says nothing."""

    topic: Topic
    glad: str = ""
    sad: str = ""


class VoiceAndJoints:
    """The voice and the joints of a base, either of which it may lack.

    An answer raises it; it goes back to rest where the gesture has ended well, and stays as it is
    where anything else has ended it, also after an arming: that starts no motion.
    """

    def __init__(self, voice: Voice | None, joints: Joints | None) -> None:
        self._voice, self._joints = voice, joints
        self._mover: JointMover | None = None if joints is None else make_mover(joints)
        self._words: list[Frame] = []
        self._is_raised = False

    @property
    def counters(self) -> Counter[str]:
        """How often something went wrong."""
        return Counter() if self._mover is None else self._mover.counters

    @property
    def problem(self) -> str:
        """Why head or arms did not act, for people; empty where they did."""
        why = "" if self._mover is None else self._mover.problem
        return f"Head or arms do not act: {why}." if why else ""

    def answer(self, answer: Answer) -> None:
        """Begin an answer; nothing for what answers no window."""
        if answer.is_glad is None:
            return
        voice, joints = self._voice, self._joints
        if voice is not None and not answer.is_quiet:
            words = voice.glad if answer.is_glad else voice.sad
            if words:
                self._words.append(publish(voice.topic, {"data": words}))
        if joints is not None and self._mover is not None:
            self._is_raised = True
            self._mover.move(joints.pose_rad(answer))

    def show(self, state: str) -> None:
        """End an answer, where this state (an ``Indication``) does."""
        joints, mover = self._joints, self._mover
        if joints is None or mover is None or state == "moving":
            return
        if state != "ready":
            self._is_raised = False
            mover.hold()
        elif self._is_raised:
            self._is_raised = False
            mover.move(list(joints.rest_rad))

    def due(self, now_s: float) -> Iterator[Frame]:
        """Yield the frames to send now."""
        while self._words:
            yield self._words.pop(0)
        if self._mover is not None:
            yield from self._mover.due(now_s)

    def handle(self, incoming: Publication | ActionResult) -> bool:
        """Handle where the joints are, or the end of a goal; return whether it was either.

        Raises BadRosFrame.
        """
        states = None if self._joints is None else self._joints.server.states
        if isinstance(incoming, Publication):
            if states is None or incoming.topic != states.name:
                return False
            if isinstance(self._mover, TrajectoryAction):
                self._mover.handle_states(read_joints(incoming.message))
        elif isinstance(self._mover, TrajectoryAction):
            self._mover.handle_result(incoming)
        return True

    def hold(self) -> None:
        """Hold it as it is."""
        self.show("stopped")

    @property
    def is_holding(self) -> bool:
        """Whether it was told to hold, and that is not done yet."""
        return self._mover is not None and self._mover.is_holding

    def disconnect(self) -> None:
        """Forget the answer: nothing reaches it, and its motion ends by itself."""
        self._is_raised = False
        self._words.clear()
        if self._mover is not None:
            self._mover.disconnect()
