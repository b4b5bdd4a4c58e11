"""A rosbridge, and a base behind it, written from docs/reference/rosbridge.md#behavior alone.

``FakeRosbridge`` takes texts and gives texts; ``serve_ros`` puts it behind a real websocket. Like
the real one it complains of nothing: what is wrong goes into its log and nowhere else. Its graph is
its own, or real ROS (``ros_side.RosGraph``).
"""

from __future__ import annotations

import importlib.util
import json
import math
import threading
import time
from collections import defaultdict
from contextlib import suppress
from functools import cache
from pathlib import Path

from websockets.exceptions import ConnectionClosed
from websockets.sync.server import serve

from robot.motion.limits import TICK_S
from robot.motion.twist import STILL

WATCHDOG = Path(__file__).parents[2] / "deploy" / "ros" / "garry_watchdog.py"
TWIST, ODOMETRY = "geometry_msgs/Twist", "nav_msgs/Odometry"


class FakeGraph:
    """Topics that pass on what is published, at once."""

    def __init__(self):
        self.types: dict[str, str] = {}
        self.hearers = defaultdict(list)
        self.publishers = defaultdict(set)
        self.latched = {}
        self.actions = {}  # servers by name: see ``do_send_action_goal``

    def advertise(self, topic, kind, who, latch=False):
        if self.types.setdefault(topic, kind) != kind:
            raise ValueError(f"{topic} is of another type")
        self.publishers[topic].add(who)
        if latch:
            self.latched.setdefault(topic, [])

    def subscribe(self, topic, kind, hear):
        if self.types.setdefault(topic, kind) != kind:
            raise ValueError(f"{topic} is of another type")
        self.hearers[topic].append(hear)
        for message in self.latched.get(topic, []):
            hear(message)

    def publish(self, topic, message):
        if topic in self.latched:
            self.latched[topic] = [message]
        for hear in list(self.hearers[topic]):
            hear(message)


class FakeRosbridge:
    """One bridge. ``said`` has all frames in their order, ``log`` what it did not like."""

    def __init__(self, graph=None, has_rosapi=True):
        self.graph = graph or FakeGraph()
        self.has_rosapi = has_rosapi
        self.said, self.log = [], []
        self.is_old = False  # one of before 2026, which does not tell that a goal was rejected
        self.loses = 0  # so many messages of each new publisher are lost, as ROS may

    def join(self, send):
        return Client(self, send)


class Client:
    """One connection to it."""

    def __init__(self, bridge, send):
        self.bridge, self.send = bridge, send
        self.is_there = True
        self.advertised, self.heard = {}, set()
        self.goals = {}

    def take(self, text):
        frame = json.loads(text)
        self.bridge.said.append(frame)
        try:
            getattr(self, f"do_{frame['op']}")(frame)
        except (AttributeError, KeyError, ValueError) as problem:
            self.bridge.log.append(f"{frame.get('op')}: {problem!r}")

    def do_advertise(self, frame):
        latch = frame.get("latch", False)
        self.bridge.graph.advertise(frame["topic"], frame["type"], "/rosbridge", latch)
        self.advertised[frame["topic"]] = self.bridge.loses

    def do_unadvertise(self, frame):
        del self.advertised[frame["topic"]]

    def do_publish(self, frame):
        topic = frame["topic"]
        if self.advertised[topic] > 0:
            self.advertised[topic] -= 1
            return
        self.bridge.graph.publish(topic, frame["msg"])

    def do_subscribe(self, frame):
        topic, kind = frame["topic"], frame["type"]
        assert frame["queue_length"] in (0, 1)
        self.heard.add(topic)

        def hear(message):
            if self.is_there and topic in self.heard:
                self.send(json.dumps({"op": "publish", "topic": topic, "msg": message}))

        self.bridge.graph.subscribe(topic, kind, hear)

    def do_unsubscribe(self, frame):
        self.heard.discard(frame["topic"])

    def do_call_service(self, frame):
        graph, topic = self.bridge.graph, frame["args"]["topic"]
        answer = {"op": "service_response", "id": frame["id"], "service": frame["service"]}
        if not self.bridge.has_rosapi:
            answer |= {"values": f"Service {frame['service']} does not exist", "result": False}
        elif frame["service"] == "/rosapi/subscribers":
            there = ["/rosbridge", "/base"][: len(graph.hearers[topic])]
            answer |= {"values": {"subscribers": there}, "result": True}
        else:
            there = sorted(graph.publishers[topic])
            answer |= {"values": {"publishers": there}, "result": True}
        self.send(json.dumps(answer))

    def do_send_action_goal(self, frame):
        """Pass a goal on to its server, which calls back with its end, and can cancel it.

        As the capability send_action_goal does (docs/reference/rosbridge.md#actions).
        """
        assert frame["action_type"].count("/") == 2

        def respond(values, status, result=True):
            told = {"op": "action_result", "action": frame["action"], "id": frame["id"]}
            if self.is_there and not (self.bridge.is_old and not result):
                told |= {"values": values, "status": status, "result": result}
                self.send(json.dumps(told))

        server = self.bridge.graph.actions.get(frame["action"])
        if server is None:
            respond("No action server available", 0, result=False)
        else:
            self.goals[frame["id"]] = server.send(frame["args"], respond)

    def do_cancel_action_goal(self, frame):
        goal = self.goals.get(frame["id"])
        if goal is not None:
            goal.cancel()


class FakeBase:
    """A base on the graph: it follows Twists until its own timeout, and tells its odometry.

    ``turned_rad`` and ``at`` are where its odometry began; ``goes`` is the share of an order that
    it follows.
    """

    def __init__(self, graph, clock, order="/cmd_vel", odometry="/odom", timeout_s=0.6, kind=TWIST):
        self.graph, self.clock = graph, clock
        self.odometry, self.timeout_s = odometry, timeout_s
        self.x_m, self.y_m, self.heading_rad = 3.0, -2.0, 3.0
        self.v_m_s = self.w_rad_s = 0.0
        self.goes, self.is_mute = 1.0, False
        self.orders: list[tuple[float, float, float]] = []
        self._ordered_s = self._moved_s = clock()
        graph.subscribe(order, kind, self.follow)
        if odometry:
            graph.advertise(odometry, ODOMETRY, "/base")

    def follow(self, message):
        self.move()
        message = message.get("twist", message)  # a TwistStamped
        self.v_m_s, self.w_rad_s = message["linear"]["x"], message["angular"]["z"]
        self._ordered_s = self.clock()
        self.orders.append((self._ordered_s, self.v_m_s, self.w_rad_s))

    @property
    def is_moving(self):
        self.move()
        return bool(self.v_m_s or self.w_rad_s)

    def move(self):
        now_s = self.clock()
        span_s, self._moved_s = self.goes * (now_s - self._moved_s), now_s
        self.heading_rad += self.w_rad_s * span_s / 2
        self.x_m += self.v_m_s * span_s * math.cos(self.heading_rad)
        self.y_m += self.v_m_s * span_s * math.sin(self.heading_rad)
        self.heading_rad += self.w_rad_s * span_s / 2
        if now_s - self._ordered_s > self.timeout_s:
            self.v_m_s = self.w_rad_s = 0.0

    def tell(self):
        self.move()
        if self.odometry and not self.is_mute:
            self.graph.publish(self.odometry, self.message())

    def message(self):
        half = self.heading_rad / 2
        return {
            "header": {"seq": 1, "stamp": {"secs": 1, "nsecs": 2}, "frame_id": "odom"},
            "child_frame_id": "base_footprint",
            "pose": {
                "pose": {
                    "position": {"x": self.x_m, "y": self.y_m, "z": 0.0},
                    "orientation": {"x": 0.0, "y": 0.0, "z": math.sin(half), "w": math.cos(half)},
                },
                "covariance": [0.0] * 36,
            },
            "twist": {
                "twist": {
                    "linear": {"x": self.goes * self.v_m_s, "y": 0.0, "z": 0.0},
                    "angular": {"x": 0.0, "y": 0.0, "z": self.goes * self.w_rad_s},
                },
                "covariance": [0.0] * 36,
            },
        }


class ServedRos:
    """A bridge behind a real websocket, and a base that tells 50 times a second, on threads."""

    def __init__(self, bridge, port=0):
        self.bridge, self.sockets = bridge, []
        self._server = serve(self._meet, "127.0.0.1", port, compression=None)
        self.port = self._server.socket.getsockname()[1]
        self.url = f"ws://127.0.0.1:{self.port}"
        self._thread = threading.Thread(target=self._server.serve_forever)

    def __enter__(self):
        self._thread.start()
        return self

    def __exit__(self, *_):
        self._server.shutdown()
        for socket in self.sockets:
            socket.close()
        self._thread.join()

    def _meet(self, socket):
        self.sockets.append(socket)

        def send(text):
            with suppress(ConnectionClosed):
                socket.send(text)

        client = self.bridge.join(send)
        with suppress(ConnectionClosed):
            for text in socket:
                client.take(text)
        client.is_there = False

    def say(self, text):
        """Say anything at all on the newest connection."""
        self.sockets[-1].send(text)


class Ticking:
    """Lets a base tell its odometry 50 times a second, on a thread, while it is open."""

    def __init__(self, base):
        self.base, self._ends = base, threading.Event()
        self._thread = threading.Thread(target=self._run)

    def __enter__(self):
        self._thread.start()
        return self.base

    def __exit__(self, *_):
        self._ends.set()
        self._thread.join()

    def _run(self):
        while not self._ends.wait(0.02):
            self.base.tell()


def drive(base, twist, until, within_s=10.0):
    """Order a twist 50 times a second until something holds."""
    until_s = time.monotonic() + within_s
    while not until():
        assert time.monotonic() < until_s, base.problem or "it did not happen"
        base.drive(twist)
        time.sleep(TICK_S)


def release(base):
    """Order it to stand still until it may be ordered to move."""
    drive(base, STILL, lambda: not base._client.orders._is_held)


def wait_until(holds, within_s=10.0):
    """Wait for something that other threads bring about."""
    until_s = time.monotonic() + within_s
    while not holds():
        assert time.monotonic() < until_s, "it did not happen"
        time.sleep(0.002)


class FakeRelay:
    """The watchdog relay on a graph: its own code, on a clock that a test gives."""

    def __init__(self, graph, clock, output="/cmd_vel"):
        self.graph, self.clock, self.output = graph, clock, output
        self.is_dead = self.is_mute = False
        self.watchdog = load_watchdog().Watchdog(
            self.publish, lambda: twist_message(0.0, 0.0), is_still_message, clock()
        )
        graph.advertise("/garry/watchdog", "std_msgs/String", "/garry_watchdog")
        graph.subscribe("/garry/cmd_vel", TWIST, self.receive)

    def publish(self, message):
        self.graph.publish(self.output, message)

    def receive(self, message):
        if not self.is_dead:
            self.watchdog.receive(message, self.clock())

    def tell(self):
        """Check, and say that it is there."""
        if not self.is_dead:
            self.watchdog.check(self.clock())
            if not self.is_mute and self.watchdog.hears(self.clock()):
                self.graph.publish("/garry/watchdog", {"data": self.output})


def twist_message(v_m_s, w_rad_s):
    return {
        "linear": {"x": v_m_s, "y": 0.0, "z": 0.0},
        "angular": {"x": 0.0, "y": 0.0, "z": w_rad_s},
    }


def is_still_message(message):
    return not any((*message["linear"].values(), *message["angular"].values()))


@cache
def load_watchdog():
    """Return the module of the relay, which stands on its own."""
    spec = importlib.util.spec_from_file_location("garry_watchdog", WATCHDOG)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module
