"""The topics of the original GARRY, published beside any base, so that its ROS nodes keep working.

Types and values are those that its nodes of 2024 expect (docs/reference/original.md#robot). Events,
which are steps and windows, are published at once or never; the feedback type is a state, and is
published again on every connection.

Its gesture node acts on the last ``True`` for as long as no ``False`` comes. So where our own robot
may not act, ``False`` is all that is published, again and again; so it is on each new connection,
at the end, and where no decision follows a ``True``. What it has begun is stopped at its base
(``robot.ros.holder``), and by a gate (deploy/ros/garry_watchdog.py) that passes its Twists on only
while it hears on ``/garry/may_act`` that a robot may act.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Collection, Iterator, Mapping
from contextlib import suppress
from typing import Any

from robot.ros.frames import (
    Frame,
    Incoming,
    Publication,
    Topic,
    advertise,
    publish,
    subscribe,
    unadvertise,
    unsubscribe,
)
from robot.ros.holder import DrivenBase, Holder
from robot.ros.messages import BOOL, STRING
from robot.wire.frames import BadFrame, read_number

FEEDBACK_TYPE = Topic("/garry/feedback_type", STRING)
GOOD_STEP = Topic("/garry/good_step", BOOL)
DATA = Topic("/garry/data", "garry_ros/UserData")
MAY_ACT = Topic("/garry/may_act", BOOL)
TOPICS = {"feedback_type": FEEDBACK_TYPE, "good_step": GOOD_STEP, "data": DATA}

# Exactly as gesture_generation.py compares them.
FEEDBACK_TYPES = {
    "positive": "Positive",
    "negative": "Negative",
    "binary": "Binary",
    "explicit": "Explicit",
}
# data_processing.py sends no good_step in the others, and gesture_generation.py would celebrate it.
WITH_GOOD_STEP = ("positive", "binary")

FRESH_S = 1.0  # an event that could not be sent for this long is dropped
MAX_EVENTS = 8
ECHO_S = 2.0  # a message without an echo by then has not arrived
NUMBER_MAX = 1e6
FALSE_EVERY_S = 0.5  # a new subscriber, or one that ROS has not connected yet, misses some
FIRST_FALSES = LAST_FALSES = 3
MAY_ACT_EVERY_S = 0.1  # the gate closes 0.5 s after the last one
# Without another decision after so many windows there are no steps: a True is taken back.
HOLDS_WINDOWS = 1.5


class OriginalTopicClient:
    """Publishes on the original's topics. Time is a parameter.

    Parameters
    ----------
    names
        Which of ``TOPICS`` to publish on.
    base
        The base that its nodes drive, which stops have to reach; None where they drive none.

    Attributes
    ----------
    is_allowed
        Whether anything that moves a robot is published.
    allowed_until_s
        When that is over, unless it is moved on: whoever allowed it may hang.
    """

    def __init__(self, names: Collection[str], base: DrivenBase | None = None) -> None:
        self._topics = [TOPICS[name] for name in names]
        self._holder = None if base is None else Holder(base)
        self._valence = ""
        self._published = ""  # the feedback type, on this connection
        self._events: deque[tuple[float, Topic, Mapping[str, Any]]] = deque(maxlen=MAX_EVENTS)
        self._unconfirmed: dict[str, float] = {}  # topic: since when its echo is missing
        self._is_open = self.is_allowed = False
        self._falses = FIRST_FALSES  # so many are still to come on this connection
        self._false_s = -math.inf  # the last one
        self._true_until_s = self.allowed_until_s = math.inf
        self._told_s = -math.inf  # whether it may act, the last time

    def allow(self, is_allowed: bool, now_s: float) -> None:
        """Allow ``True`` and data where our own robot may act; else withdraw what was published.

        Parameters
        ----------
        is_allowed
            Whether a robot may act.
        now_s
            The time [s].
        """
        if self.is_allowed != is_allowed:
            self._told_s = -math.inf
        if self.is_allowed and not is_allowed:
            self._take_back()
            if self._holder is not None:
                self._holder.hold(now_s)
        elif is_allowed and self._holder is not None:
            self._holder.release()
        self.is_allowed = is_allowed

    def handle_message(self, message: Mapping[str, Any], now_s: float) -> None:
        """Handle a message of the server.

        Parameters
        ----------
        message
            Of a step, the shown value and the goal are published; one without finite numbers is
            not. Of a welcome or a cue, the feedback type is stored.
        now_s
            When it came [s].
        """
        match message:
            case {"type": "welcome" | "cue", "valence": str(valence)}:
                self._valence = valence
            case {"type": "step"} if self.is_allowed:
                with suppress(BadFrame):
                    a2, goal = (
                        read_number(message, name, -NUMBER_MAX, NUMBER_MAX)
                        for name in ("shown", "goal")
                    )
                    self._add(now_s, DATA, {"a2": a2, "goal": goal})

    def publish_decision(self, above: bool, window_s: float, now_s: float) -> None:
        """Publish a decision about a window.

        Parameters
        ----------
        above
            Whether the window's mean reached the threshold.
        window_s
            Length of a window [s].
        now_s
            The time [s].
        """
        if self._valence in WITH_GOOD_STEP and self.is_allowed:
            self._add(now_s, GOOD_STEP, {"data": above})
            self._falses = 0
            self._true_until_s = now_s + HOLDS_WINDOWS * window_s if above else math.inf

    def open(self, now_s: float) -> Iterator[Frame]:
        """Yield the first frames of a new connection."""
        self.disconnect(now_s)
        self._is_open = True
        for topic in self._topics:
            yield advertise(topic, latch=topic is FEEDBACK_TYPE)
            yield subscribe(topic)
        yield advertise(MAY_ACT)
        if self._holder is not None:
            yield from self._holder.open()
            if not self.is_allowed:
                self._holder.hold(now_s)  # whoever was here before may have been stopped

    def due(self, now_s: float) -> Iterator[Frame]:
        """Yield the frames to send now."""
        if now_s > self.allowed_until_s:
            self.allow(False, now_s)
        if self._holder is not None:
            yield from self._holder.due(now_s)
        every_s = MAY_ACT_EVERY_S if self.is_allowed else FALSE_EVERY_S
        if now_s - self._told_s >= every_s - 1e-6:
            self._told_s = now_s
            yield publish(MAY_ACT, {"data": self.is_allowed})
        feedback_type = FEEDBACK_TYPES.get(self._valence, "")
        if FEEDBACK_TYPE in self._topics and feedback_type and feedback_type != self._published:
            self._published = feedback_type
            yield self._publish(FEEDBACK_TYPE, {"data": feedback_type}, now_s)
        if now_s > self._true_until_s:
            self._take_back()
        is_false_due = self._falses > 0 or not self.is_allowed
        if GOOD_STEP in self._topics and is_false_due and now_s - self._false_s >= FALSE_EVERY_S:
            self._false_s, self._falses = now_s, max(self._falses - 1, 0)
            yield self._publish(GOOD_STEP, {"data": False}, now_s)
        while self._events:
            made_s, topic, message = self._events.popleft()
            if now_s - made_s <= FRESH_S:
                yield self._publish(topic, message, now_s)

    def handle(self, incoming: Incoming, now_s: float) -> None:
        """Handle a frame of the bridge. Raises BadRosFrame.

        Parameters
        ----------
        incoming
            A publication is the echo that confirms its topic, or odometry; a response is ignored.
        now_s
            The time [s].
        """
        if self._holder is not None:
            self._holder.handle(incoming, now_s)
        if isinstance(incoming, Publication):
            self._unconfirmed.pop(incoming.topic, None)

    def disconnect(self, now_s: float) -> None:
        """Drop what was to be sent: it would be out of date on the next connection."""
        self._is_open, self._published, self._told_s = False, "", -math.inf
        self._take_back()
        self._unconfirmed.clear()

    def end(self, now_s: float) -> Iterator[Frame]:
        """Yield the last frames."""
        if GOOD_STEP in self._topics:
            for _ in range(LAST_FALSES):
                yield publish(GOOD_STEP, {"data": False})
        if self._holder is not None:
            self._holder.hold(now_s)
            for _ in range(LAST_FALSES):
                yield from self._holder.due(now_s)
        for _ in range(LAST_FALSES):
            yield publish(MAY_ACT, {"data": False})
        for topic in self._topics:
            yield unsubscribe(topic)
            yield unadvertise(topic)
        yield unadvertise(MAY_ACT)
        if self._holder is not None:
            yield from self._holder.end()

    def problem(self, now_s: float) -> str:
        """Return which topic does not arrive; empty where all do."""
        for topic in self._topics:
            if now_s - self._unconfirmed.get(topic.name, math.inf) > ECHO_S:
                cure = "; build the package garry_ros there" if topic is DATA else ""
                return (
                    f"Nothing that is sent on {topic.name} comes back. Its type has to be "
                    f"{topic.kind}, and no other program may use another{cure}."
                )
        return ""

    def _take_back(self) -> None:
        """Drop what waits, and publish ``False`` at once and some more times."""
        self._events.clear()
        self._falses, self._false_s, self._true_until_s = FIRST_FALSES, -math.inf, math.inf

    def _add(self, now_s: float, topic: Topic, message: Mapping[str, Any]) -> None:
        if self._is_open and topic in self._topics:
            self._events.append((now_s, topic, message))

    def _publish(self, topic: Topic, message: Mapping[str, Any], now_s: float) -> Frame:
        self._unconfirmed.setdefault(topic.name, now_s)
        return publish(topic, message)
