"""What a base's driver publishes and subscribes to at a rosbridge. Time is a parameter."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator

from robot.bases.base import BaseState, SensorState
from robot.bases.rosbridge.orders import Orders
from robot.bases.rosbridge.perception import DeadReckoning, HazardSensors, ReportedOdometry
from robot.bases.rosbridge.topics import Topics
from robot.motion.twist import STILL
from robot.ros.frames import (
    BadRosFrame,
    Frame,
    Incoming,
    Publication,
    ServiceResponse,
    advertise,
    call_service,
    publish,
    subscribe,
    unadvertise,
    unsubscribe,
)
from robot.ros.messages import (
    ODOMETRY,
    TWIST,
    read_event,
    read_odometry,
    read_twist,
    write_twist,
)

ODOMETRY_EVERY_MS = 20  # as often as orders go out
LAST_STOPS = 3  # one may be lost (docs/reference/kobuki.md#orders)

# Where rosapi runs, it knows who uses a topic; called this often [s], while the base stands.
SUBSCRIBERS, PUBLISHERS = "/rosapi/subscribers", "/rosapi/publishers"
CALL_EVERY_S = 2.0
LATE_S = 1.0  # after this it is reported as a problem

# Refusals, see ``SensorState``.
NOBODY_LISTENS = "nobody_listens"
SENSOR_MISSING = "feeler_missing"
# Hazards of its own.
RESTARTED = "restarted"
OTHER_DRIVER = "other_driver"


class BaseClient:
    """One base at one rosbridge."""

    def __init__(self, topics: Topics, now_s: float) -> None:
        self.topics = topics
        self.orders = Orders()
        self.odometry: ReportedOdometry | DeadReckoning = (
            DeadReckoning() if topics.odometry is None else ReportedOdometry()
        )
        self.sensors = HazardSensors()
        self._is_open = False
        self._opened_s = now_s
        self._called_s = -math.inf
        self._missing: dict[str, str] = {}  # topic: why it must not move

    @property
    def counters(self) -> Counter[str]:
        """How often something went wrong."""
        return self.orders.counters + self.sensors.counters

    def open(self, now_s: float) -> Iterator[Frame]:
        """Yield the first frames of a new connection. Its first order is to stand still."""
        self.disconnect(now_s)
        self._is_open, self._opened_s, self._called_s = True, now_s, -math.inf
        topics = self.topics
        yield advertise(topics.order)
        yield subscribe(topics.order)
        if topics.odometry is not None:
            yield subscribe(topics.odometry, newest_every_ms=ODOMETRY_EVERY_MS)
        for topic in topics.sensors.values():
            yield subscribe(topic)

    def due(self, now_s: float) -> Iterator[Frame]:
        """Yield the frames to send now."""
        twist = self.orders.due(now_s)
        if twist is not None:
            self.odometry.order(twist, now_s)
            yield publish(self.topics.order, write_twist(twist))
        if self.orders.sent.is_still and now_s - self._called_s >= CALL_EVERY_S:
            self._called_s = now_s
            name = self.topics.order.name
            yield call_service(SUBSCRIBERS, {"topic": name}, name)
            for topic in self.topics.sensors.values():
                yield call_service(PUBLISHERS, {"topic": topic.name}, topic.name)

    def handle(self, incoming: Incoming, now_s: float) -> None:
        """Handle a frame of the bridge. Raises BadRosFrame for impossible values."""
        if isinstance(incoming, ServiceResponse):
            self._handle_response(incoming)
            return
        odometry = self.topics.odometry
        if incoming.topic == self.topics.order.name:
            if self.orders.handle_echo(read_twist(incoming.message)):
                self.sensors.record(OTHER_DRIVER, now_s)
        elif odometry is not None and incoming.topic == odometry.name:
            pose, twist = read_odometry(incoming.message)
            if isinstance(self.odometry, ReportedOdometry) and self.odometry.update(
                pose, twist, now_s
            ):
                self.sensors.counters["jumped"] += 1
                self.sensors.record(RESTARTED, now_s)
        else:
            self._handle_event(incoming, now_s)

    def disconnect(self, now_s: float) -> None:
        """Reset orders and hazards: the connection is lost."""
        self._is_open = False
        self.orders.reset()
        self.odometry.order(STILL, now_s)
        self.sensors.reset()
        self._missing.clear()

    def end(self, now_s: float) -> Iterator[Frame]:
        """Yield the last frames: stand still, unsubscribe, unadvertise."""
        self.disconnect(now_s)
        topics = self.topics
        for _ in range(LAST_STOPS):
            yield publish(topics.order, write_twist(STILL))
        for topic in (topics.order, topics.odometry, *topics.sensors.values()):
            if topic is not None:
                yield unsubscribe(topic)
        yield unadvertise(topics.order)

    def state(self, now_s: float) -> BaseState:
        """Return the state of the base now."""
        self.odometry.move(now_s)
        sensors = SensorState(
            hazards=self.sensors.hazards(now_s),
            refusal=min(self._missing.values(), default=""),
            silent_s=self.silent_s(now_s),
        )
        return BaseState(self.odometry.pose, self.odometry.twist, sensors)

    def silent_s(self, now_s: float) -> float:
        """Return for how long it is unknown whether orders arrive, or where the base is [s]."""
        if not self._is_open or not self.orders.is_confirmed:
            return math.inf
        return max(0.0, self.orders.unconfirmed_s(now_s), now_s - self.odometry.seen_s)

    def problem(self, now_s: float) -> str:
        """Return what is wrong at a bridge that answers; empty where nothing is."""
        order, odometry = self.topics.order.name, self.topics.odometry
        if not self._is_open or now_s - self._opened_s < LATE_S:
            return ""
        if not self.orders.is_confirmed or self.orders.unconfirmed_s(now_s) > LATE_S:
            return f"Nothing that is sent on {order} comes back: is it of the type {TWIST}?"
        if odometry is not None and now_s - self.odometry.seen_s > LATE_S:
            return f"No {ODOMETRY} comes on {odometry.name}: does its driver run?"
        for topic, reason in self._missing.items():
            if reason == NOBODY_LISTENS:
                return f"No driver listens on {topic}: start it, or choose another --cmd-topic."
            return f"Nobody publishes on {topic}: start its driver, or give none for that topic."
        return ""

    def _handle_event(self, incoming: Publication, now_s: float) -> None:
        for hazard, topic in self.topics.sensors.items():
            if topic.name == incoming.topic:
                which, is_detected = read_event(topic.kind, incoming.message)
                self.sensors.update(hazard, which, is_detected, now_s)
                return
        raise BadRosFrame("Nobody asked for that topic.")

    def _handle_response(self, response: ServiceResponse) -> None:
        """Store who uses a topic. Without rosapi that is unknown, and nothing is refused."""
        is_order = response.call_id == self.topics.order.name
        there = (response.values or {}).get("subscribers" if is_order else "publishers")
        if not isinstance(there, list):
            return
        # The bridge itself listens to what we order.
        if len(there) >= (2 if is_order else 1):
            self._missing.pop(response.call_id, None)
        else:
            self._missing[response.call_id] = NOBODY_LISTENS if is_order else SENSOR_MISSING
