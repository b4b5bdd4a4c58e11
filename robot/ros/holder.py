"""Holds the base of the original's nodes still after a stop: zero Twists until it is still.

Its gesture node goes through what it has begun, one Twist after the other, whatever is said on the
topics that it hears. So the base itself is ordered to stand, 50 times a second, on the topic that
the node drives it by: each of the node's Twists is overruled within 20 ms.
"""

from __future__ import annotations

import math
from argparse import ArgumentParser, Namespace
from collections.abc import Iterator
from typing import NamedTuple

from robot.motion.twist import STILL
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
from robot.ros.messages import ODOMETRY, TWIST, read_odometry, write_twist

# The longest gesture of gesture_generation.py, with slack (docs/reference/original.md#robot): for
# so long after a stop another Twist of it may come.
GESTURE_S = 8.0
# Then it has to have been still for this long [s]; slower wheels stand (ours).
STILL_S = 1.0
STILL_M_S = 0.01


class DrivenBase(NamedTuple):
    """The topics of the base that the original's nodes drive; without odometry it is timed."""

    order: Topic = Topic("/mobile_base/commands/velocity", TWIST)
    odometry: Topic | None = Topic("/odom", ODOMETRY)


def add_driven_base_arguments(parser: ArgumentParser) -> None:
    """Add the topics of the base that the original's nodes drive to a command line."""
    usual = DrivenBase()
    parser.add_argument(
        "--original-cmd-topic",
        default=usual.order.name,
        metavar="TOPIC",
        help="with --original-topics: where its nodes drive their base, which a stop then holds "
        "still; none for no base (default: %(default)s)",
    )
    parser.add_argument(
        "--original-odom-topic",
        default="/odom",
        metavar="TOPIC",
        help="odometry of that base; none where it has none (default: %(default)s)",
    )


def find_driven_base(options: Namespace) -> DrivenBase | None:
    """Return the base that the original's nodes drive; None where we drive a ROS base ourselves."""
    order, odometry = options.original_cmd_topic, options.original_odom_topic
    if options.base == "rosbridge" or order == "none":
        return None
    return DrivenBase(
        Topic(order, TWIST), None if odometry == "none" else Topic(odometry, ODOMETRY)
    )


class Holder:
    """Orders a base to stand while it is held. Time is a parameter.

    Parameters
    ----------
    base
        The topics of the base.
    """

    def __init__(self, base: DrivenBase) -> None:
        self._base = base
        self._held_until_s = self._moved_until_s = -math.inf

    @property
    def topics(self) -> tuple[str, ...]:
        """What is subscribed to."""
        return () if self._base.odometry is None else (self._base.odometry.name,)

    def hold(self, now_s: float) -> None:
        """Hold it from now on."""
        self._held_until_s, self._moved_until_s = now_s + GESTURE_S, -math.inf

    def release(self) -> None:
        """Leave it to whoever drives it."""
        self._held_until_s = -math.inf

    def open(self) -> Iterator[Frame]:
        """Yield the first frames of a new connection."""
        yield advertise(self._base.order)
        if self._base.odometry is not None:
            yield subscribe(self._base.odometry, newest_every_ms=100)

    def due(self, now_s: float) -> Iterator[Frame]:
        """Yield the order to stand, where it is held; to be asked 50 times a second."""
        if now_s < max(self._held_until_s, self._moved_until_s):
            yield publish(self._base.order, write_twist(STILL))

    def handle(self, incoming: Incoming, now_s: float) -> None:
        """Look whether it moves. Raises BadRosFrame."""
        is_held = now_s < max(self._held_until_s, self._moved_until_s)
        if isinstance(incoming, Publication) and incoming.topic in self.topics and is_held:
            _, twist = read_odometry(incoming.message)
            if twist.fastest_wheel_m_s > STILL_M_S:
                self._moved_until_s = now_s + STILL_S

    def end(self) -> Iterator[Frame]:
        """Yield the last frames."""
        if self._base.odometry is not None:
            yield unsubscribe(self._base.odometry)
        yield unadvertise(self._base.order)
