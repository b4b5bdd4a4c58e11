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
"""

import argparse
import signal
import sys
import threading
import time

INPUT, ALIVE = "/garry/cmd_vel", "/garry/watchdog"
HOLDS_S = 0.25
CHECK_S = 0.02
ALIVE_EVERY_S = 0.1
HEARS_S = 1.0  # GARRY orders to stand ten times a second
STOPS = 3  # one may be lost


class Watchdog:
    """Decides what the base gets. Time is a parameter, in seconds.

    ``publish`` sends a message to the base, ``stop`` makes one that stands still, and ``is_still``
    says whether one does.
    """

    def __init__(self, publish, stop, is_still, now_s):
        self._publish, self._stop, self._is_still = publish, stop, is_still
        self._heard_s = None  # the last order, whether it was passed on or not
        self._received_s = self._checked_s = now_s
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
                self._halt()
            self._checked_s = now_s

    def hears(self, now_s):
        """Return whether orders come at all."""
        return self._heard_s is not None and now_s - self._heard_s <= HEARS_S

    def end(self):
        """Let the base stand, for good."""
        with self._lock:
            self._halt()

    def _check_hang(self, now_s):
        """Let the base stand after a hang of this program: what comes now has waited."""
        if now_s - self._checked_s > HOLDS_S:
            self._checked_s = now_s
            self._halt()

    def _halt(self):
        self._is_moving, self._is_held = False, True
        for _ in range(STOPS):
            self._publish(self._stop())


def is_still_twist(twist):
    """Return whether a Twist, or the Twist of a TwistStamped, stands still."""
    twist = getattr(twist, "twist", twist)
    parts = (twist.linear, twist.angular)
    return not any(getattr(part, axis) for part in parts for axis in ("x", "y", "z"))


def run_ros1(output, is_stamped, ended):
    """Watch as a node of ROS 1 until ``ended`` is set."""
    import rospy
    from geometry_msgs.msg import Twist, TwistStamped
    from std_msgs.msg import String

    kind = TwistStamped if is_stamped else Twist
    rospy.init_node("garry_watchdog", disable_signals=True)
    orders = rospy.Publisher(output, kind, queue_size=STOPS)
    alive = rospy.Publisher(ALIVE, String, queue_size=1)
    watchdog = Watchdog(orders.publish, kind, is_still_twist, time.monotonic())
    rospy.Subscriber(
        INPUT,
        kind,
        lambda twist: watchdog.receive(twist, time.monotonic()),
        queue_size=1,
        tcp_nodelay=True,
    )
    watch(watchdog, lambda: alive.publish(output), ended)
    rospy.signal_shutdown("ended")


def run_ros2(output, is_stamped, ended):
    """Watch as a node of ROS 2 until ``ended`` is set."""
    import rclpy
    from geometry_msgs.msg import Twist, TwistStamped
    from rclpy.executors import SingleThreadedExecutor
    from rclpy.signals import SignalHandlerOptions
    from std_msgs.msg import String

    kind = TwistStamped if is_stamped else Twist
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    node = rclpy.create_node("garry_watchdog")
    orders = node.create_publisher(kind, output, STOPS)
    alive = node.create_publisher(String, ALIVE, 1)
    watchdog = Watchdog(orders.publish, kind, is_still_twist, time.monotonic())
    node.create_subscription(
        kind, INPUT, lambda twist: watchdog.receive(twist, time.monotonic()), 1
    )
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    spinning = threading.Thread(target=executor.spin)
    spinning.start()
    watch(watchdog, lambda: alive.publish(String(data=output)), ended)
    time.sleep(0.05)  # the last messages leave on threads of their own
    executor.shutdown()
    spinning.join()
    node.destroy_node()
    rclpy.shutdown()


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
    run(options.output, options.stamped, ended)
    return 0


if __name__ == "__main__":
    sys.exit(main())
