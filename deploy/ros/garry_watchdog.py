#!/usr/bin/env python3
"""Passes GARRY's orders on to a base, and lets it stand as soon as they stop coming.

For ROS 1 (rospy) and ROS 2 (rclpy); copy it to the computer of the base's driver, and start it:

    python3 garry_watchdog.py /cmd_vel              # the topic that the driver listens to
    python3 garry_watchdog.py /cmd_vel --stamped    # one that takes TwistStamped (ROS 2)

GARRY publishes on /garry/cmd_vel. Each order is passed on at once; 0.25 s after the last one, and
when this program ends, the base is ordered to stand still. After such a pause nothing else is
passed on until GARRY orders to stand still: a motion that was interrupted is not resumed. Ten times
a second, while orders come, /garry/watchdog says which topic is watched; without that GARRY does
not move the base.

With --gate it passes on what the original GARRY's nodes order, while GARRY says that a robot may
act. Remap their output, so that it comes here:

    python3 garry_watchdog.py /mobile_base/commands/velocity --gate
    rosrun garry_ros gesture_generation.py /mobile_base/commands/velocity:=/garry/gated_cmd_vel

Where GARRY says on /garry/may_act that none may, or has said nothing for 0.5 s, the base is ordered
to stand, and the rest of what the nodes have begun is dropped: the gate opens again once they have
been silent for 2.5 s.
"""

import argparse
import signal
import sys
import threading
import time

INPUT, ALIVE = "/garry/cmd_vel", "/garry/watchdog"
GATED, MAY_ACT = "/garry/gated_cmd_vel", "/garry/may_act"
HOLDS_S = 0.25
CHECK_S = 0.02
ALIVE_EVERY_S = 0.1
HEARS_S = 1.0  # GARRY orders to stand ten times a second
STOPS = 3  # one may be lost

# Of the gate. The nodes order each part of a gesture once, and the next one 1 or 2 s later.
FRESH_S = 0.5  # GARRY says ten times a second that a robot may act
SILENT_S = 2.5
STANDS_S = 2.0  # so long it orders the base to stand, at each check


class Watchdog:
    """Decides what the base gets. Time is a parameter, in seconds.

    ``publish`` sends a message to the base, ``stop`` makes one that stands still, and ``is_still``
    says whether one does.
    """

    def __init__(self, publish, stop, is_still, now_s):
        self._publish, self._stop, self._is_still = publish, stop, is_still
        self._heard_s = None  # the last order, whether it was passed on or not
        self._received_s = self._checked_s = now_s
        self._halted_s = now_s
        self._is_moving, self._is_held = False, True
        self._lock = threading.Lock()  # messages and checks come on different threads

    def receive(self, message, now_s):
        """Pass an order on, or drop it."""
        with self._lock:
            self._check_hang(now_s)
            self._heard_s = now_s
            is_still = self._is_still(message)
            if is_still:
                self._is_held = False
            if self._is_held:
                return
            self._received_s, self._is_moving = now_s, not is_still
            self._publish(message)

    def check(self, now_s):
        """Let the base stand where orders have stopped coming; to be called every ``CHECK_S``."""
        with self._lock:
            self._check_hang(now_s)
            if self._is_moving and now_s - self._received_s > HOLDS_S:
                self._halt(now_s)
            self._checked_s = now_s

    def hears(self, now_s):
        """Return whether orders come at all."""
        return self._heard_s is not None and now_s - self._heard_s <= HEARS_S

    def end(self):
        """Let the base stand, for good."""
        with self._lock:
            self._halt(self._checked_s)

    def _check_hang(self, now_s):
        """Let the base stand after a hang of this program: what comes now has waited."""
        if now_s - self._checked_s > HOLDS_S:
            self._checked_s = now_s
            self._halt(now_s)

    def _halt(self, now_s):
        self._is_moving, self._is_held, self._halted_s = False, True, now_s
        for _ in range(STOPS):
            self._publish(self._stop())


class Gate(Watchdog):
    """Decides what the base gets of nodes that stop for nobody. Time is a parameter, in seconds."""

    def __init__(self, publish, stop, is_still, now_s):
        super().__init__(publish, stop, is_still, now_s)
        self._allowed_s = float("-inf")

    def allow(self, may_act, now_s):
        """Take GARRY's word whether a robot may act."""
        with self._lock:
            self._check_hang(now_s)
            self._allowed_s = now_s if may_act else float("-inf")
            self._update(now_s)

    def receive(self, message, now_s):
        """Pass an order of the nodes on, or drop it."""
        with self._lock:
            self._check_hang(now_s)
            self._update(now_s)
            self._heard_s = now_s
            if not self._is_held:
                self._received_s, self._is_moving = now_s, not self._is_still(message)
                self._publish(message)

    def check(self, now_s):
        """Let the base stand where it may not move; to be called every ``CHECK_S``."""
        with self._lock:
            self._check_hang(now_s)
            self._update(now_s)
            if self._is_held and now_s - self._halted_s <= STANDS_S:
                self._publish(self._stop())
            self._checked_s = now_s

    def _update(self, now_s):
        """Close it, or open it again."""
        may_act = now_s - self._allowed_s <= FRESH_S
        is_silent = self._heard_s is None or now_s - self._heard_s > SILENT_S
        if self._is_held:
            self._is_held = not (may_act and is_silent)
        elif not may_act or (self._is_moving and is_silent):  # the nodes have died in a motion
            self._halt(now_s)


def is_still_twist(twist):
    """Return whether a Twist, or the Twist of a TwistStamped, stands still."""
    twist = getattr(twist, "twist", twist)
    parts = (twist.linear, twist.angular)
    return not any(getattr(part, axis) for part in parts for axis in ("x", "y", "z"))


def run_ros1(options, ended):
    """Watch as a node of ROS 1 until ``ended`` is set."""
    import rospy
    from geometry_msgs.msg import Twist, TwistStamped
    from std_msgs.msg import Bool, String

    kind = TwistStamped if options.stamped else Twist
    rospy.init_node(name_of(options), disable_signals=True)
    orders = rospy.Publisher(options.output, kind, queue_size=STOPS)
    alive = rospy.Publisher(ALIVE, String, queue_size=1)
    watchdog = make_watchdog(options, orders.publish, kind)

    def subscribe(topic, kind, hear):
        rospy.Subscriber(topic, kind, hear, queue_size=1, tcp_nodelay=True)

    subscribe_all(options, watchdog, kind, Bool, subscribe)
    watch(watchdog, lambda: alive.publish(options.output), ended)
    rospy.signal_shutdown("ended")


def run_ros2(options, ended):
    """Watch as a node of ROS 2 until ``ended`` is set."""
    import rclpy
    from geometry_msgs.msg import Twist, TwistStamped
    from rclpy.executors import SingleThreadedExecutor
    from rclpy.signals import SignalHandlerOptions
    from std_msgs.msg import Bool, String

    kind = TwistStamped if options.stamped else Twist
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    node = rclpy.create_node(name_of(options))
    orders = node.create_publisher(kind, options.output, STOPS)
    alive = node.create_publisher(String, ALIVE, 1)
    watchdog = make_watchdog(options, orders.publish, kind)

    def subscribe(topic, kind, hear):
        node.create_subscription(kind, topic, hear, 1)

    subscribe_all(options, watchdog, kind, Bool, subscribe)
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    spinning = threading.Thread(target=executor.spin)
    spinning.start()
    watch(watchdog, lambda: alive.publish(String(data=options.output)), ended)
    time.sleep(0.05)  # the last messages leave on threads of their own
    executor.shutdown()
    spinning.join()
    node.destroy_node()
    rclpy.shutdown()


def name_of(options):
    """Return what the node is called: a relay and a gate may run beside each other."""
    return "garry_gate" if options.gate else "garry_watchdog"


def make_watchdog(options, publish, kind):
    """Return the watchdog or the gate of the options."""
    return (Gate if options.gate else Watchdog)(publish, kind, is_still_twist, time.monotonic())


def subscribe_all(options, watchdog, kind, kind_of_bool, subscribe):
    """Subscribe to what is passed on, and, as a gate, to what GARRY allows."""
    where = GATED if options.gate else INPUT
    subscribe(where, kind, lambda twist: watchdog.receive(twist, time.monotonic()))
    if options.gate:
        subscribe(MAY_ACT, kind_of_bool, lambda said: watchdog.allow(said.data, time.monotonic()))


def watch(watchdog, say_alive, ended):
    """Check and say so until ``ended`` is set; then let the base stand."""
    said_s = 0.0
    try:
        while not ended.wait(CHECK_S):
            now_s = time.monotonic()
            watchdog.check(now_s)
            if watchdog.hears(now_s) and now_s - said_s >= ALIVE_EVERY_S:
                said_s = now_s
                say_alive()
    finally:
        watchdog.end()


def main():
    """Run the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("output", help="the topic that the base's driver listens to, as /cmd_vel")
    parser.add_argument("--stamped", action="store_true", help="it takes TwistStamped")
    parser.add_argument(
        "--gate", action="store_true", help="pass the original's nodes on while GARRY lets them"
    )
    parser.add_argument("--ros", choices=["1", "2"], help="default: the one that is installed")
    options = parser.parse_args()
    ended = threading.Event()
    for name in ("SIGTERM", "SIGHUP", "SIGINT"):
        signal.signal(getattr(signal, name), lambda *_: ended.set())
    run = {"1": run_ros1, "2": run_ros2}.get(options.ros)
    if run is None:
        try:
            import rclpy  # noqa: F401

            run = run_ros2
        except ImportError:
            run = run_ros1
    run(options, ended)
    return 0


if __name__ == "__main__":
    sys.exit(main())
