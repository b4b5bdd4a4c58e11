"""Moves joints by way of a rosbridge: by a topic, or by the goals of an action server."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Mapping
from typing import Any, Protocol
from uuid import uuid4

from robot.bases.rosbridge.joints import Joints
from robot.ros.frames import ActionResult, Frame, cancel_goal, publish, send_goal

# A controller of ROS 1 stays where it is at a trajectory without points; one of ROS 2 refuses it
# (docs/reference/rosbridge.md#head-arms-and-speech).
HOLD: dict[str, Any] = {"joint_names": [], "points": []}

# A Stretch rejects a goal that follows a running one within 0.2 s
# (docs/reference/rosbridge.md#names-of-a-stretch). The next one is sent so long after it [s], or as
# soon as it has ended; a goal to hold that was refused is sent again so often.
GOAL_EVERY_S = 0.25
# A goal that has not ended so long after its motion should have [s] never will: bridges of before
# 2026 do not tell that one was rejected (docs/reference/rosbridge.md#actions).
OVERDUE_S = 1.0
LATE_MOTION_S = 0.5  # a motion that is late may last so much longer


class JointMover(Protocol):
    """Moves joints by way of a rosbridge. Time is a parameter."""

    counters: Counter[str]
    problem: str  # why they did not move, or were not held; empty where they did

    def move(self, pose_rad: list[float]) -> None:
        """Move them to angles [rad], in place of what was begun before."""

    def hold(self) -> None:
        """Hold them where they are, if they may be moving."""

    @property
    def is_holding(self) -> bool:
        """Whether they were told to hold, and that is not done yet."""

    def due(self, now_s: float) -> Iterator[Frame]:
        """Yield the frames to send now."""

    def disconnect(self) -> None:
        """Forget what was begun: nothing reaches them, and their motion ends by itself."""


class TrajectoryTopic:
    """Moves joints by a topic, whose controller reports nothing."""

    def __init__(self, joints: Joints) -> None:
        self.counters: Counter[str] = Counter()
        self.problem = ""
        self._joints = joints
        self._next: dict[str, Any] | None = None
        self._moves_until_s = -math.inf

    def move(self, pose_rad: list[float]) -> None:
        """Move them to angles [rad], in place of what was begun before."""
        self._next = self._joints.write_trajectory(pose_rad)

    def hold(self) -> None:
        """Hold them where they are, if they may be moving."""
        self._next = HOLD

    @property
    def is_holding(self) -> bool:
        """Whether they were told to hold, and that is not done yet."""
        return self._next is HOLD

    def due(self, now_s: float) -> Iterator[Frame]:
        """Yield the trajectory to send now."""
        following, self._next = self._next, None
        if following is None or (following is HOLD and now_s > self._moves_until_s):
            return
        is_moving = following is not HOLD
        self._moves_until_s = (
            now_s + self._joints.takes_s + LATE_MOTION_S if is_moving else -math.inf
        )
        yield publish(self._joints.server.topic, following)

    def disconnect(self) -> None:
        """Forget what was begun."""
        self._next, self._moves_until_s = None, -math.inf


class TrajectoryAction:
    """Moves joints by the goals of an action server, one at a time.

    To hold them cancels the goal, again until it has ended. Where the server's motion goes on all
    the same, a goal to where they are follows, until one is reached.

    Attributes
    ----------
    counters
        How many goals were not reached (``goals_refused``): rejected, broken off, or without an
        end in time. Those that were canceled here do not count.
    problem
        Why the last one was not, in the server's words; empty where it was.
    """

    def __init__(self, joints: Joints) -> None:
        self.counters: Counter[str] = Counter(goals_refused=0)
        self.problem = ""
        self._joints = joints
        self._there: Mapping[str, float] = {}  # where the joints are
        self._next: list[float] | None = None  # the angles to move to
        self._name, self._goals = uuid4().hex, 0  # a bridge has one list of ids for all its clients
        self._running = ""  # id of the newest goal, until it has ended
        self._sent_s = self._moves_until_s = -math.inf
        self._canceled_s: float | None = None  # when the newest goal was canceled last
        self._is_hold = False  # whether the newest goal holds them
        self.is_holding = False  # they were told to hold, and that is not done yet

    def move(self, pose_rad: list[float]) -> None:
        """Move them to angles [rad], in place of what was begun before."""
        self._next, self.is_holding = pose_rad, False

    def hold(self) -> None:
        """Hold them where they are, if they may be moving."""
        self._next, self.is_holding = None, True

    def handle_states(self, there: Mapping[str, float]) -> None:
        """Store where the joints are [rad], by their names."""
        self._there = there

    def handle_result(self, result: ActionResult) -> None:
        """Handle the end of a goal; that of an earlier one says nothing."""
        if result.goal_id == self._running:
            self._end(result.problem)

    def due(self, now_s: float) -> Iterator[Frame]:
        """Yield the frames to send now."""
        action = self._joints.server.topic
        if now_s > self._moves_until_s:
            self.is_holding = False
        if self._running and now_s - self._sent_s > self._joints.takes_s + OVERDUE_S:
            yield cancel_goal(action, self._running)
            self._end(f"no end of a goal of {action.name} was reported")
        is_canceled = self._canceled_s is not None and now_s - self._canceled_s < GOAL_EVERY_S
        if self.is_holding and self._running and not (self._is_hold or is_canceled):
            self._canceled_s = now_s
            yield cancel_goal(action, self._running)
        if (self._running or self._is_hold) and now_s - self._sent_s < GOAL_EVERY_S:
            return
        if self._next is not None:
            following, self._next = self._next, None
            self._moves_until_s = now_s + self._joints.takes_s + LATE_MOTION_S
            yield self._send(following, now_s, is_hold=False)
        elif self.is_holding and self._joints.server.states is not None:
            yield from self._hold(now_s)
        elif self.is_holding and not self._running:  # what was canceled holds by itself
            self.is_holding = False

    def disconnect(self) -> None:
        """Forget what was begun."""
        self._next, self._running, self.is_holding = None, "", False
        self._there, self._moves_until_s = {}, -math.inf

    def _hold(self, now_s: float) -> Iterator[Frame]:
        if all(name in self._there for name in self._joints.names):
            yield self._send(
                [self._there[name] for name in self._joints.names], now_s, is_hold=True
            )
        else:
            self.problem = "nobody tells where its joints are, so they were not held"
            self.is_holding = False

    def _send(self, pose_rad: list[float], now_s: float, *, is_hold: bool) -> Frame:
        self._goals += 1
        self._running, self._sent_s = f"{self._name}_{self._goals}", now_s
        self._canceled_s, self._is_hold = None, is_hold
        goal = {"trajectory": self._joints.write_trajectory(pose_rad)}
        return send_goal(self._joints.server.topic, goal, self._running)

    def _end(self, problem: str) -> None:
        """Store that the newest goal has ended, and why it was not reached."""
        self._running = ""
        if self._canceled_s is not None:
            return
        if self._is_hold and not problem:
            self.is_holding = False
        self.problem = problem
        self.counters["goals_refused"] += bool(problem)


def make_mover(joints: Joints) -> JointMover:
    """Return what moves these joints."""
    return TrajectoryAction(joints) if joints.server.is_action else TrajectoryTopic(joints)
