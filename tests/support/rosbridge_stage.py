"""A rosbridge base with its bridge and robot, on a clock that a test moves."""

import json
import math
from argparse import ArgumentParser
from collections import deque
from contextlib import contextmanager, suppress
from types import SimpleNamespace
from unittest.mock import patch

from robot.base_options import add_base_arguments, make_base
from robot.bases.rosbridge import RosbridgeBase
from robot.bases.rosbridge.topics import PROFILES, Topics
from robot.behavior.performer import Performer
from robot.motion.limits import TICK_S
from robot.motion.twist import STILL
from robot.ros.frames import BadRosFrame, Topic, read_frame, to_text
from tests.support.fake_ros import FakeBase, FakeRelay, FakeRosbridge
from tests.support.robot_stage import CUE, WELCOME

CMD, ODOM = PROFILES["plain"].order, PROFILES["plain"].odometry
BUMPER = Topic("/bumper", "std_msgs/Bool")
CLOSED = Topics(CMD, ODOM, {"bump": BUMPER}, own_timeout_s=0.6)
OPEN = Topics(CMD, own_timeout_s=0.6)
WATCHED = Topics(CMD, ODOM, {"bump": BUMPER})


class Stage:
    """A base, a bridge and what it drives; ``wait`` lets time pass, a tick after the other.

    ``make_robot`` gets the graph and the clock; a frame takes ``late_s`` to the bridge, and back.
    """

    def __init__(self, topics=CLOSED, has_rosapi=True, make_robot=None, late_s=0.0):
        self.now_s, self.late_s = 100.0, late_s
        self.bridge = FakeRosbridge(has_rosapi=has_rosapi)
        # A base that is watched has no timeout of its own.
        timeout_s = topics.own_timeout_s or math.inf
        order = topics.order

        def make_base(graph, clock):
            return FakeBase(graph, clock, order.name, timeout_s=timeout_s, kind=order.kind)

        self.robot = (make_robot or make_base)(self.bridge.graph, lambda: self.now_s)
        self.relay = FakeRelay(self.bridge.graph, lambda: self.now_s) if topics.relay else None
        self.bridge.graph.advertise(BUMPER.name, BUMPER.kind, "/base")
        self.base = RosbridgeBase(lambda: self.now_s, topics)
        self.base_client = self.base._client
        self.is_frozen = False  # nothing passes any more, and nobody is told; later it does
        self.inbox, self.outbox, self.client = [], [], None
        self.late_in, self.late_out = (deque[tuple[float, str]]() for _ in range(2))
        self.performer = None
        self.open()

    def open(self):
        """Open the base as a program does, which may order motion from then on."""
        with self._patched():
            RosbridgeBase.open(self.base)

    def close(self):
        """Close it as a program does."""
        with self._patched():
            RosbridgeBase.close(self.base)

    @contextmanager
    def _patched(self):
        bridge = self.base._bridge
        with (
            patch.object(bridge, "open", lambda url: self.connect()),
            patch.object(bridge, "close", self.end),
            patch("robot.bases.rosbridge.base.time", SimpleNamespace(sleep=self.sleep)),
        ):
            yield

    def end(self):
        for frame in self.base_client.end(self.now_s):
            self.client.take(to_text(frame))
        self.lose()

    def sleep(self, span_s):
        self.now_s += span_s
        self.pass_on()

    def connect(self):
        self.client = self.bridge.join(self.inbox.append)
        for frame in self.base_client.open(self.now_s):
            self.client.take(to_text(frame))

    def lose(self):
        self.client.is_there, self.client = False, None
        for box in (self.inbox, self.outbox, self.late_in, self.late_out):
            box.clear()
        self.base_client.disconnect(self.now_s)

    def wait(self, span_s, order=STILL):
        for _ in range(round(span_s / TICK_S)):
            self.now_s += TICK_S
            if self.performer is None:
                self.base.drive(order)
            else:
                self.performer.handle({"type": "heartbeat"}, self.now_s)
                self.performer.tick(self.now_s)
            self.pass_on()

    def pass_on(self):
        if self.client is not None:
            self.outbox += map(to_text, self.base_client.due(self.now_s))
        for text in self._arrived(self.outbox, self.late_out):
            self.client.take(text)
        self.robot.tell()
        if self.relay is not None:
            self.relay.tell()
        for text in self._arrived(self.inbox, self.late_in):
            with suppress(BadRosFrame):
                self.base_client.handle(read_frame(text), self.now_s)

    def _arrived(self, box, late):
        """Give the frames that have been on their way for long enough; an order may add more."""
        while not self.is_frozen:
            late.extend((self.now_s + self.late_s, text) for text in box)
            box.clear()
            if not late or late[0][0] > self.now_s + 1e-9:
                return
            yield late.popleft()[1]

    def tell(self, topic, message):
        self.inbox.append(json.dumps({"op": "publish", "topic": topic, "msg": message}))
        self.pass_on()

    def perform(self, cue=CUE):
        """Have a performer drive it, armed, with a gesture begun."""
        self.performer = Performer(self.base)
        self.performer.handle(WELCOME | {"cue": cue}, self.now_s)
        self.performer.handle({"type": "arm"}, self.now_s)
        for number in range(6):
            step = {"type": "step", "time_s": float(number), "performance": 1.2}
            self.performer.handle(step, self.now_s)
        return self

    def begin_moving(self):
        self.perform().wait(0.5)
        assert self.robot.is_moving
        return self

    def of(self, kind):
        return [report for report in self.performer.reports if report["kind"] == kind]


def base_of(*words):
    """Return the base that `--base rosbridge` with these words stands for."""
    parser = ArgumentParser()
    add_base_arguments(parser)
    return make_base(parser.parse_args(["--base", "rosbridge", *words]), lambda: 0.0)


def moving(stage):
    return [order for order in stage.robot.orders if order[1] or order[2]]
