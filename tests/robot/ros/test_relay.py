"""The watchdog relay as a node of real ROS 1 and 2: a base without a timeout of its own stands."""

import signal
import subprocess
import time
from contextlib import ExitStack
from dataclasses import dataclass
from typing import Any

import pytest

from robot.bases.rosbridge import RosbridgeBase
from robot.bases.rosbridge.topics import PROFILES
from robot.motion.twist import STILL, Twist
from tests.support.fake_ros import (
    WATCHDOG,
    FakeBase,
    FakeRosbridge,
    ServedRos,
    Ticking,
    drive,
    release,
    wait_until,
)
from tests.support.real_ros import Ros2, RosMaster, why_missing, why_ros2_missing
from tests.support.wire import Wire

pytestmark = [pytest.mark.ros, pytest.mark.realtime]
ROS: dict[str, tuple[Any, Any]] = {
    "1": (RosMaster, why_missing),
    "2": (Ros2, why_ros2_missing),
}


@dataclass
class Scene:
    """A base of real ROS without a timeout, the relay, and our driver of it over a wire."""

    relay: Any
    robot: FakeBase
    wire: Wire
    base: RosbridgeBase

    def begin_moving(self):
        """Begin, again if need be: a slow machine may lose the first order."""
        for _ in range(5):
            drive(self.base, STILL, lambda: not self.base.read().sensors.refusal, 20.0)
            release(self.base)
            until_s = time.monotonic() + 0.5
            drive(self.base, Twist(0.2, 0), lambda: time.monotonic() > until_s)  # noqa: B023
            if self.robot.is_moving:
                return
        raise AssertionError("it does not move")

    def stands_after(self, deed):
        """Return how long after a deed it stands [s]; meanwhile we go on ordering motion."""
        since_s = time.monotonic()
        deed()
        drive(self.base, Twist(0.2, 0), lambda: not self.robot.is_moving, 3.0)
        return time.monotonic() - since_s


@pytest.fixture(params=ROS)
def scene(request):
    make, why = ROS[request.param]
    if reason := why():
        pytest.skip(reason)
    with ExitStack() as stack:
        ros = stack.enter_context(make())
        node = ros.node("base")
        robot = FakeBase(node, time.monotonic, timeout_s=float("inf"))
        words = [ros.python, str(WATCHDOG), "/cmd_vel", "--ros", request.param]
        relay = stack.enter_context(subprocess.Popen(words, env=ros.env))
        stack.callback(relay.kill)
        bridge = FakeRosbridge(ros.node("rosbridge"), has_rosapi=False)
        served = stack.enter_context(ServedRos(bridge))
        stack.enter_context(Ticking(robot))
        wire = stack.enter_context(Wire(served.port))
        base = RosbridgeBase(time.monotonic, PROFILES["plain"])
        base.port = f"ws://127.0.0.1:{wire.port}"
        stack.enter_context(base)
        yield Scene(relay, robot, wire, base)


def test_a_black_hole_and_an_end_of_the_relay(scene):
    scene.begin_moving()
    took_s = scene.stands_after(scene.wire.freeze)
    print(f"black hole: stands after {took_s:.2f} s")
    assert took_s < 0.75
    scene.wire.thaw()
    scene.begin_moving()
    took_s = scene.stands_after(lambda: scene.relay.send_signal(signal.SIGKILL))
    print(f"relay killed: stands after {took_s:.2f} s")
    assert took_s < 0.75
    drive(scene.base, STILL, lambda: scene.base.read().sensors.refusal == "nobody_watches")


def test_the_relay_ends_with_a_stop(scene):
    scene.begin_moving()
    assert scene.stands_after(lambda: scene.relay.send_signal(signal.SIGTERM)) < 0.75
    wait_until(lambda: scene.relay.poll() == 0)
