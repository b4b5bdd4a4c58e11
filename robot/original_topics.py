"""The topics of the original GARRY, published beside any base, so that its ROS nodes keep working.

Types and values are those that its nodes of 2024 expect (docs/reference/original.md#robot). What an
event is, a step or a window, is published at once or never; the feedback type is what holds, and is
published again on every connection.
"""

from __future__ import annotations

import math
import threading
import time
from collections import deque
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import suppress
from types import TracebackType
from typing import Any, Self

from robot.ros.bridge import Bridge
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
from robot.ros.messages import BOOL, STRING
from robot.wire.frames import BadFrame, read_number

FEEDBACK_TYPE = Topic("/garry/feedback_type", STRING)
GOOD_STEP = Topic("/garry/good_step", BOOL)
DATA = Topic("/garry/data", "garry_ros/UserData")
TOPICS = {"feedback_type": FEEDBACK_TYPE, "good_step": GOOD_STEP, "data": DATA}

# Letter for letter: gesture_generation.py compares them so.
FEEDBACK_TYPES = {
    "positive": "Positive",
    "negative": "Negative",
    "binary": "Binary",
    "explicit": "Explicit",
}
# data_processing.py sends no good_step in the others, and gesture_generation.py would celebrate it.
WITH_GOOD_STEP = ("positive", "binary")

FRESH_S = 1.0  # an event that could not be sent so long is past
KEPT = 8
LATE_S = 2.0  # what has not come back by then has not arrived
NUMBER_MAX = 1e6


class OriginalTopicClient:
    """What is published on the original's topics. Time is a parameter.

    Parameters
    ----------
    names
        Which of ``TOPICS`` to publish on.
    """

    def __init__(self, names: Collection[str]) -> None:
        self._topics = [TOPICS[name] for name in names]
        self._valence = ""
        self._told = ""  # the feedback type, on this connection
        self._events: deque[tuple[float, Topic, Mapping[str, Any]]] = deque(maxlen=KEPT)
        self._out: dict[str, float] = {}  # topic: since when what was sent has not come back
        self._is_open = False

    def follow(self, message: Mapping[str, Any], now_s: float) -> None:
        """Handle a message of the server; what it does not hold is not published."""
        match message:
            case {"type": "welcome" | "cue", "valence": str(valence)}:
                self._valence = valence
            case {"type": "step"}:
                with suppress(BadFrame):
                    a2, goal = (
                        read_number(message, name, -NUMBER_MAX, NUMBER_MAX)
                        for name in ("shown", "goal")
                    )
                    self._add(now_s, DATA, {"a2": a2, "goal": goal})

    def decide(self, above: bool, now_s: float) -> None:
        """Publish a decision: whether the window was above."""
        if self._valence in WITH_GOOD_STEP:
            self._add(now_s, GOOD_STEP, {"data": above})

    def open(self, now_s: float) -> Iterator[Frame]:
        """Yield the first frames of a new connection."""
        self.lose(now_s)
        self._is_open = True
        for topic in self._topics:
            yield advertise(topic, latch=topic is FEEDBACK_TYPE)
            yield subscribe(topic)

    def due(self, now_s: float) -> Iterator[Frame]:
        """Yield the frames to send now."""
        told = FEEDBACK_TYPES.get(self._valence, "")
        if FEEDBACK_TYPE in self._topics and told and told != self._told:
            self._told = told
            yield self._publish(FEEDBACK_TYPE, {"data": told}, now_s)
        while self._events:
            made_s, topic, message = self._events.popleft()
            if now_s - made_s <= FRESH_S:
                yield self._publish(topic, message, now_s)

    def hear(self, heard: Incoming, now_s: float) -> None:
        """Store what has come back."""
        if isinstance(heard, Publication):
            self._out.pop(heard.topic, None)

    def lose(self, now_s: float) -> None:
        """Drop what was to be sent: it is out of date when there is a connection again."""
        self._is_open, self._told = False, ""
        self._events.clear()
        self._out.clear()

    def end(self, now_s: float) -> Iterator[Frame]:
        """Yield the last frames."""
        for topic in self._topics:
            yield unsubscribe(topic)
            yield unadvertise(topic)

    def problem(self, now_s: float) -> str:
        """Return what does not arrive; empty where all does."""
        for topic in self._topics:
            if now_s - self._out.get(topic.name, math.inf) > LATE_S:
                cure = "; build the package garry_ros there" if topic is DATA else ""
                return (
                    f"Nothing that is sent on {topic.name} comes back. Its type has to be "
                    f"{topic.kind}, and no other program may use another{cure}."
                )
        return ""

    def _add(self, now_s: float, topic: Topic, message: Mapping[str, Any]) -> None:
        if self._is_open and topic in self._topics:
            self._events.append((now_s, topic, message))

    def _publish(self, topic: Topic, message: Mapping[str, Any], now_s: float) -> Frame:
        self._out.setdefault(topic.name, now_s)
        return publish(topic, message)


class OriginalTopics:
    """The same at a rosbridge, on its own connection, while it is open as a context manager."""

    def __init__(
        self,
        url: str,
        names: Collection[str] = tuple(TOPICS),
        monotonic: Callable[[], float] = time.monotonic,
    ) -> None:
        self._url, self._monotonic = url, monotonic
        self._client, self._lock = OriginalTopicClient(names), threading.Lock()
        self._bridge: Bridge | None = None

    def __enter__(self) -> Self:
        """Start to connect."""
        self._bridge = Bridge(self._url, self._client, self._lock, self._monotonic)
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        problem: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Hang up."""
        if self._bridge is not None:
            self._bridge.close()

    @property
    def problem(self) -> str:
        """Return why nothing arrives; empty where all does."""
        if self._bridge is None:
            return ""
        with self._lock:
            return self._bridge.problem or self._client.problem(self._monotonic())

    def follow(self, message: Mapping[str, Any]) -> None:
        """Publish what a message of the server tells."""
        with self._lock:
            self._client.follow(message, self._monotonic())
        self._wake()

    def decide(self, above: bool) -> None:
        """Publish what a window came to."""
        with self._lock:
            self._client.decide(above, self._monotonic())
        self._wake()

    def _wake(self) -> None:
        if self._bridge is not None:
            self._bridge.wake()
