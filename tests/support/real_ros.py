"""Real ROS: 1 as Debian packages it (a master and nodes of rospy), 2 from PyPI, on loopback.

rospy belongs to the system's Python, and rclpy to one of its own (``GARRY_ROS2_PYTHON``), so each
node is this file run by that, and takes its orders as JSON lines. A ``RosNode`` can stand in for a
``FakeGraph``: behind a ``FakeRosbridge`` it is the bridge's node, and of rosbridge, which neither
has, only the frames are played.
"""

from __future__ import annotations

import json
import os
import socket
import subprocess
import sys
import tempfile
import threading
import time
from collections import defaultdict
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any

PYTHON = "/usr/bin/python3"
PACKAGES = "python3-rospy python3-rosmaster python3-geometry-msgs python3-nav-msgs python3-std-msgs"
PACKAGES_2 = (
    "ros-rclpy ros-geometry-msgs ros-nav-msgs ros-std-msgs ros-sensor-msgs ros-trajectory-msgs "
    "ros-rmw-fastrtps-cpp"
)
USER_DATA = "float32 a2\nfloat32 goal\n"  # garry_ros/UserData, which ROS users have to build
START_S = 20.0


@cache
def why_missing() -> str:
    """Return why there is no ROS here; empty where there is."""
    look = "import rospy, rosmaster, geometry_msgs.msg, nav_msgs.msg, std_msgs.msg"
    if Path(PYTHON).exists():
        done = subprocess.run([PYTHON, "-c", look], capture_output=True)
        if done.returncode == 0:
            return ""
    return f"no ROS 1: apt-get install --no-install-recommends {PACKAGES}"


class RosMaster:
    """A master, as long as it is open."""

    def __enter__(self):
        self._home = tempfile.TemporaryDirectory(prefix="garry-ros-")
        with socket.create_server(("127.0.0.1", 0)) as free:
            port = free.getsockname()[1]
        self._env = {name: value for name, value in os.environ.items() if "PYTHON" not in name}
        self._env |= {"ROS_MASTER_URI": f"http://127.0.0.1:{port}", "ROS_IP": "127.0.0.1"}
        self._env |= {"ROS_HOME": self._home.name, "ROS_LOG_DIR": self._home.name}
        self.env, self.python = self._env, PYTHON
        begin = f"import rosmaster; rosmaster.rosmaster_main(['', '--core', '-p', '{port}'])"
        self._master = subprocess.Popen([PYTHON, "-c", begin], env=self._env, cwd=self._home.name)
        self._nodes = []
        until_s = time.monotonic() + START_S
        while True:  # a node that comes before it waits for long
            try:
                socket.create_connection(("127.0.0.1", port)).close()
            except OSError:
                assert time.monotonic() < until_s, "the master does not start"
                time.sleep(0.02)
            else:
                return self

    def __exit__(self, *_):
        for node in self._nodes:
            node.close()
        self._master.terminate()
        self._master.wait(10)
        self._home.cleanup()

    def node(self, name):
        """Start a node of that name, and give it when it is there."""
        self._nodes.append(RosNode(self._env, name))
        return self._nodes[-1]


class Ros2:
    """ROS 2 on a domain of its own, as long as it is open."""

    python = os.environ.get("GARRY_ROS2_PYTHON", sys.executable)

    def __enter__(self):
        self._home = tempfile.TemporaryDirectory(prefix="garry-ros2-")
        self.env = {name: value for name, value in os.environ.items() if "PYTHON" not in name}
        self.env |= {"ROS_DOMAIN_ID": str(1 + os.getpid() % 100), "ROS_LOG_DIR": self._home.name}
        self.env |= {"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
        self._nodes = []
        return self

    def __exit__(self, *_):
        for node in self._nodes:
            node.close()
        self._home.cleanup()

    def node(self, name):
        """Start a node of that name, and give it when it is there."""
        self._nodes.append(RosNode(self.env, name, self.python, "2"))
        return self._nodes[-1]


@cache
def why_ros2_missing() -> str:
    """Return why there is no ROS 2 here; empty where there is."""
    look = "import rclpy, geometry_msgs.msg, nav_msgs.msg, sensor_msgs.msg, trajectory_msgs.msg"
    done = subprocess.run([Ros2.python, "-c", look], capture_output=True)
    return "" if done.returncode == 0 else f"no ROS 2: pip install {PACKAGES_2}"


class RosNode:
    """A node of rospy or rclpy, with the methods of a ``FakeGraph``."""

    def __init__(self, env, name, python=PYTHON, version="1"):
        self._process = subprocess.Popen(
            [python, __file__, name, version],
            env=env,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
        self._hearers = defaultdict(list)
        self._lock, self._is_there = threading.Lock(), threading.Event()
        self._thread = threading.Thread(target=self._listen)
        self._thread.start()
        if not self._is_there.wait(START_S):
            self._process.kill()
            self.close()
            raise AssertionError(f"the node {name} does not start")

    def advertise(self, topic, kind, who="", latch=False):
        self._order(do="advertise", topic=topic, kind=kind, latch=latch)

    def subscribe(self, topic, kind, hear):
        self._hearers[topic].append(hear)
        if len(self._hearers[topic]) == 1:
            self._order(do="subscribe", topic=topic, kind=kind)

    def publish(self, topic, message):
        self._order(do="publish", topic=topic, message=message)

    def close(self):
        self._process.stdin.close()
        self._process.wait(10)
        self._thread.join()
        self._process.stdout.close()

    def _order(self, **order):
        with self._lock:
            self._process.stdin.write(json.dumps(order) + "\n")
            self._process.stdin.flush()

    def _listen(self):
        for line in self._process.stdout:
            said = json.loads(line)
            if "topic" not in said:
                self._is_there.set()
            else:
                for hear in list(self._hearers[said["topic"]]):
                    hear(said["message"])


# --- in the system's Python -----------------------------------------------------------------------


def to_json(value):
    """Return a message, or a part of one, as JSON has it."""
    if hasattr(value, "__slots__") and hasattr(value, "_type"):
        return {name: to_json(getattr(value, name)) for name in value.__slots__}
    if hasattr(value, "to_sec"):
        return {"secs": value.secs, "nsecs": value.nsecs}
    return [to_json(part) for part in value] if isinstance(value, (list, tuple)) else value


def run_node(name: str) -> None:
    """Be a node until standard input ends."""
    import genpy.dynamic
    import genpy.message
    import roslib.message
    import rospy

    def class_of(kind):
        if kind == "garry_ros/UserData":
            return genpy.dynamic.generate_dynamic(kind, USER_DATA)[kind]
        return roslib.message.get_message_class(kind)

    def say(**said):
        with lock:
            sys.stdout.write(json.dumps(said) + "\n")
            sys.stdout.flush()

    def hear(message, topic):
        say(topic=topic, message=to_json(message))

    lock, publishers = threading.Lock(), dict[str, rospy.Publisher]()
    rospy.init_node(name, disable_signals=True)
    say(ready=True)
    for line in sys.stdin:
        order = json.loads(line)
        topic = order["topic"]
        if order["do"] == "publish":
            message = publishers[topic].data_class()
            genpy.message.fill_message_args(message, [order["message"]])
            publishers[topic].publish(message)
        elif order["do"] == "subscribe":
            rospy.Subscriber(topic, class_of(order["kind"]), hear, topic)
        elif topic not in publishers:
            kind = class_of(order["kind"])
            publishers[topic] = rospy.Publisher(topic, kind, queue_size=1, latch=order["latch"])
    rospy.signal_shutdown("told to end")


def fill(message, value):
    """Store JSON in a message of ROS 2; fields that only ROS 1 has are left out."""
    for name, part in value.items():
        if not hasattr(message, name):
            continue
        if isinstance(part, dict):
            fill(getattr(message, name), part)
        elif isinstance(part, list) and part and isinstance(part[0], dict):
            kind = message.get_fields_and_field_types()[name]
            one = class_of_2(kind.removeprefix("sequence<").removesuffix(">"))
            setattr(message, name, [fill(one(), value) for value in part])
        else:
            setattr(message, name, part)
    return message


def read(value):
    """Return a message of ROS 2, or a part of one, as JSON has it."""
    if hasattr(value, "get_fields_and_field_types"):
        return {name: read(getattr(value, name)) for name in value.get_fields_and_field_types()}
    if isinstance(value, list):
        return [read(part) for part in value]
    return value.tolist() if hasattr(value, "tolist") else value


def class_of_2(kind):
    """Return the class of a type of ROS 2."""
    from importlib import import_module

    package, *_, name = kind.split("/")
    return getattr(import_module(f"{package}.msg"), name)


def run_node_2(name: str) -> None:
    """Be a node of ROS 2 until standard input ends."""
    import rclpy
    from rclpy.executors import ExternalShutdownException

    def say(**said):
        with lock:
            sys.stdout.write(json.dumps(said) + "\n")
            sys.stdout.flush()

    def spin():
        with suppress(ExternalShutdownException):
            rclpy.spin(node)

    lock, publishers = threading.Lock(), dict[str, tuple[Any, Any]]()
    rclpy.init()
    node = rclpy.create_node(name)
    threading.Thread(target=spin, daemon=True).start()
    say(ready=True)
    for line in sys.stdin:
        order = json.loads(line)
        topic = order["topic"]
        if order["do"] == "publish":
            publisher, kind = publishers[topic]
            publisher.publish(fill(kind(), order["message"]))
        elif order["do"] == "subscribe":

            def hear(message, topic=topic):
                say(topic=topic, message=read(message))

            node.create_subscription(class_of_2(order["kind"]), topic, hear, 10)
        elif topic not in publishers:
            kind = class_of_2(order["kind"])
            publishers[topic] = node.create_publisher(kind, topic, 1), kind
    rclpy.shutdown()


if __name__ == "__main__":
    {"1": run_node, "2": run_node_2}[sys.argv[2]](sys.argv[1])
