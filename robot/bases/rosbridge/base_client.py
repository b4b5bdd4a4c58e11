"""What a base's driver publishes and subscribes to at a rosbridge. Time is a parameter."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator

from robot.bases.base import Answer, BaseState, SensorState
from robot.bases.rosbridge.orders import Orders
from robot.bases.rosbridge.perception import (
    DeadReckoning,
    HazardSensors,
    ReportedOdometry,
    Turret,
)
from robot.bases.rosbridge.topics import ALL_HAZARDS, RELAY_ALIVE, STOP_BUTTON, Topics
from robot.bases.rosbridge.voice_and_joints import VoiceAndJoints
from robot.bases.unordered_motion import UNORDERED, UnorderedMotion
from robot.motion.twist import STILL, Twist
from robot.ros.frames import (
    ActionResult,
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
    AT_CHARGER,
    ODOMETRY,
    read_event,
    read_flag,
    read_hazards,
    read_joints,
    read_odometry,
    read_stamp_s,
    read_twist,
    without_msg,
    write_twist,
)
from robot.ros.signals import write_light, write_sound

ODOMETRY_EVERY_MS = 20  # as often as orders go out
LAST_STOPS = 3  # one may be lost (docs/reference/kobuki.md#orders)

# Where rosapi runs, it knows who uses a topic; called this often [s], while the base stands.
SUBSCRIBERS, PUBLISHERS = "/rosapi/subscribers", "/rosapi/publishers"
CALL_EVERY_S = 2.0
UNCONFIRMED_S = 1.0  # after this it is reported as a problem
RELAY_SILENT_S = 0.5  # the relay reports every 0.1 s

# Refusals, see ``SensorState``.
NOBODY_LISTENS = "nobody_listens"
SENSOR_MISSING = "feeler_missing"
NOT_WATCHED = "nobody_watches"
WRONG_MODE = "wrong_mode"
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
        self._voice_and_joints = VoiceAndJoints(topics.voice, topics.joints)
        self._turret = None if topics.turret is None else Turret(topics.turret.ahead_m)
        self._mode = ""  # of its driver; empty where it has not told yet
        self._unordered = UnorderedMotion()
        self._is_open = False
        self._opened_s = now_s
        self._called_s = -math.inf
        self._missing: dict[str, str] = {}  # topic: why it must not move
        self._relay_s = -math.inf  # when the relay was last heard
        self._is_docked = False
        self._state, self._signals = "", list[Frame]()  # what it shows, and what is to be sent

    @property
    def counters(self) -> Counter[str]:
        """How often something went wrong."""
        return self.orders.counters + self.sensors.counters + self._voice_and_joints.counters

    def open(self, now_s: float) -> Iterator[Frame]:
        """Yield the first frames of a new connection. Its first order is to stand still."""
        self.disconnect(now_s)
        self._is_open, self._opened_s, self._called_s = True, now_s, -math.inf
        topics = self.topics
        for topic in topics.published:
            yield advertise(topic)
        for topic in topics.subscribed:
            is_motion = topic in (topics.odometry, topics.turret and topics.turret.topic)
            yield subscribe(topic, newest_every_ms=ODOMETRY_EVERY_MS if is_motion else 0)
        self.show(self._state, aloud=False)

    def show(self, state: str, *, aloud: bool) -> None:
        """Show a state by light, and by sound where ``aloud``; again on each new connection."""
        topics, self._state = self.topics, state
        if state and self._is_open and topics.light is not None:
            self._signals.append(publish(topics.light, write_light(topics.light.kind, state)))
        if aloud and self._is_open and topics.sound is not None:
            sound = write_sound(topics.sound.kind, state)
            if sound is not None:
                self._signals.append(publish(topics.sound, sound))
        if self._is_open:
            self._voice_and_joints.show(state)

    def answer(self, answer: Answer) -> None:
        """Begin to answer; one that finds no connection is left out."""
        if self._is_open:
            self._voice_and_joints.answer(answer)

    def hold_joints(self) -> None:
        """Hold head and arms."""
        if self._is_open:
            self._voice_and_joints.hold()

    @property
    def is_holding(self) -> bool:
        """Whether head and arms were told to hold, and that is not done yet."""
        return self._voice_and_joints.is_holding

    def due(self, now_s: float) -> Iterator[Frame]:
        """Yield the frames to send now."""
        twist = self.orders.due(now_s)
        if twist is not None:
            self.odometry.order(twist, now_s)
            if not twist.is_still:
                self._unordered.order_motion(now_s)
            yield from self._order(twist)
        while self._signals:
            yield self._signals.pop(0)
        yield from self._voice_and_joints.due(now_s)
        if self.orders.sent.is_still and now_s - self._called_s >= CALL_EVERY_S:
            self._called_s = now_s
            name = self.topics.order.name
            yield call_service(SUBSCRIBERS, {"topic": name}, name)
            for topic in self.topics.sensors.values():
                yield call_service(PUBLISHERS, {"topic": topic.name}, topic.name)

    def handle(self, incoming: Incoming, now_s: float) -> None:
        """Handle a frame of the bridge.

        Parameters
        ----------
        incoming
            A message on one of the topics, a response of rosapi, or the end of a goal.
        now_s
            When it came, on a monotonic clock [s].

        Raises
        ------
        BadRosFrame
            For impossible values.
        """
        if isinstance(incoming, ServiceResponse):
            self._handle_response(incoming)
            return
        if self._voice_and_joints.handle(incoming) or isinstance(incoming, ActionResult):
            return
        topics, odometry = self.topics, self.topics.odometry
        if incoming.topic == self.topics.order.name:
            if self.orders.handle_echo(read_twist(incoming.message, self.topics.order.kind)):
                self.sensors.record(OTHER_DRIVER)
        elif odometry is not None and incoming.topic == odometry.name:
            self._handle_odometry(incoming, now_s)
        elif topics.turret is not None and incoming.topic == topics.turret.topic.name:
            angle_rad = read_joints(incoming.message).get(topics.turret.joint)
            if angle_rad is not None and self._turret is not None:
                self._turret.turn(angle_rad, now_s)
        elif incoming.topic == RELAY_ALIVE.name:
            if incoming.message.get("data") == self.topics.order.name:
                self._relay_s = now_s
        elif topics.dock is not None and incoming.topic == topics.dock.name:
            flag = AT_CHARGER[without_msg(topics.dock.kind)]
            self._is_docked = read_flag(incoming.message, flag)
        elif topics.mode is not None and incoming.topic == topics.mode[0].name:
            self._mode = str(incoming.message.get("data"))
        else:
            self._handle_event(incoming)

    def disconnect(self, now_s: float) -> None:
        """Reset orders and hazards: the connection is lost."""
        self._is_open = False
        self.orders.reset()
        self.odometry.order(STILL, now_s)
        self.sensors.reset()
        self._voice_and_joints.disconnect()
        self._missing.clear()
        self._signals.clear()
        self._relay_s = -math.inf
        self._mode = ""

    def end(self, now_s: float) -> Iterator[Frame]:
        """Yield the last frames: stand still, unsubscribe, unadvertise."""
        self._voice_and_joints.hold()
        last_pose = list(self._voice_and_joints.due(now_s))
        self.disconnect(now_s)
        topics = self.topics
        for _ in range(LAST_STOPS):
            yield from self._order(STILL)
        yield from last_pose
        for topic in topics.subscribed:
            yield unsubscribe(topic)
        for topic in topics.published:
            yield unadvertise(topic)

    def state(self, now_s: float) -> BaseState:
        """Return the state of the base now."""
        self.odometry.move(now_s)
        hazards = self.sensors.hazards()
        sensors = SensorState(
            hazards=hazards - {STOP_BUTTON},
            refusal=self._refusal(now_s),
            stop_pressed=STOP_BUTTON in hazards,
            is_charging=self._is_docked,
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
        if not self._is_open or now_s - self._opened_s < UNCONFIRMED_S:
            return ""
        if not self.orders.is_confirmed or self.orders.unconfirmed_s(now_s) > UNCONFIRMED_S:
            kind = self.topics.order.kind
            return f"Nothing that is sent on {order} comes back: is it of the type {kind}?"
        if self._refusal(now_s) == NOT_WATCHED:
            return (
                f"Nobody would stop the base if this program were gone: start the watchdog relay "
                f"for {order} (deploy/ros/garry_watchdog.py), or say --own-timeout-s "
                f"of a base that stops by itself."
            )
        if self._refusal(now_s) == WRONG_MODE and self.topics.mode is not None:
            return (
                f"Its driver is in {self._mode!r} mode, in which it is not driven: bring it to "
                f"{self.topics.mode[1]!r} mode."
            )
        if odometry is not None and now_s - self.odometry.seen_s > UNCONFIRMED_S:
            return f"No {ODOMETRY} comes on {odometry.name}: does its driver run?"
        for topic, reason in self._missing.items():
            if reason == NOBODY_LISTENS:
                return f"No driver listens on {topic}: start it, or choose another --cmd-topic."
            return f"Nobody publishes on {topic}: start its driver, or give none for that topic."
        return self._voice_and_joints.problem

    def _order(self, twist: Twist) -> Iterator[Frame]:
        """Yield an order: a motion by way of the relay, a stop also past it."""
        topics = self.topics
        message = write_twist(twist, topics.order.kind)
        if topics.relay is not None:
            yield publish(topics.relay, message)
        if topics.relay is None or twist.is_still:
            yield publish(topics.order, message)

    def _refusal(self, now_s: float) -> str:
        if self.topics.relay is not None and now_s - self._relay_s > RELAY_SILENT_S:
            return NOT_WATCHED
        if self.topics.mode is not None and self._mode not in ("", self.topics.mode[1]):
            return WRONG_MODE
        return min(self._missing.values(), default="")

    def _handle_odometry(self, incoming: Publication, now_s: float) -> None:
        pose, twist = read_odometry(incoming.message)
        if self._turret is not None:
            body = self._turret.locate(pose, read_stamp_s(incoming.message), now_s)
            if body is None:
                return
            pose, twist = body
        if self._unordered.update(twist.fastest_wheel_m_s, now_s):
            self.sensors.record(UNORDERED)
        if isinstance(self.odometry, ReportedOdometry) and self.odometry.update(pose, twist, now_s):
            self.sensors.counters["jumped"] += 1
            self.sensors.record(RESTARTED)

    def _handle_event(self, incoming: Publication) -> None:
        for hazard, topic in self.topics.sensors.items():
            if topic.name == incoming.topic and hazard == ALL_HAZARDS:
                self.sensors.replace(read_hazards(incoming.message))
                return
            if topic.name == incoming.topic:
                which, is_detected = read_event(topic.kind, incoming.message)
                self.sensors.update(hazard, which, is_detected)
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
