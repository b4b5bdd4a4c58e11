"""Any base that ROS drives: Twists out; odometry, bumpers and what was ordered back in."""

from __future__ import annotations

import math
import time
from argparse import ArgumentParser, Namespace, _ArgumentGroup
from collections.abc import Callable, Mapping
from contextlib import suppress

from robot.bases.base import Answer, BaseLost, BaseState, Indication, MobileBase
from robot.bases.rosbridge.base_client import BaseClient
from robot.bases.rosbridge.options import add_topic_arguments, read_topics
from robot.bases.rosbridge.topics import DEFAULT_PROFILE, PROFILES, Topics
from robot.motion.limits import TICK_S
from robot.motion.twist import STILL, Twist
from robot.ros.rosbridge_connection import Bridge, find_bridge

GREETING_S = 3.0  # a bridge that is there has sent odometry by then
HOLD_WITHIN_S = 0.6  # how long the end waits for head and arms to be held, at most


class RosbridgeBase(MobileBase):
    """Orders a base by way of a rosbridge. A connection that is lost is made again forever.

    It cannot stop the base once the connection is gone: the watchdog relay beside the base has to,
    or its own driver (docs/robot.md). Every connection begins with an order to stand still.
    """

    name = "rosbridge"
    abilities = PROFILES[DEFAULT_PROFILE].abilities

    def __init__(
        self, monotonic: Callable[[], float], topics: Topics = PROFILES[DEFAULT_PROFILE]
    ) -> None:
        self._monotonic = monotonic
        self._set_topics(topics)

    @classmethod
    def add_arguments(cls, group: ArgumentParser | _ArgumentGroup) -> None:
        """Add options for the base's topics."""
        add_topic_arguments(group)

    def configure(self, options: Namespace) -> None:
        """Apply the bridge's address and the base's topics. Raises BadOption."""
        self.port = options.ros_url
        self._set_topics(read_topics(options))

    def open(self) -> None:
        """Connect, wait a moment for the base's odometry, and let it be ordered to move."""
        self._bridge.open(self.port or find_bridge())
        until_s = self._monotonic() + GREETING_S
        while self._monotonic() < until_s and self.read().sensors.silent_s == math.inf:
            time.sleep(TICK_S)
        # Motion is refused until a stop was confirmed and ordered once more; a gesture that is not
        # announced begins with motion.
        self.stop()

    def close(self) -> None:
        """Hold head and arms, send the last frames, which are stops, and close the connection."""
        until_s = self._monotonic() + HOLD_WITHIN_S
        with self._bridge.sending():
            self._client.hold_joints()
        while self._client.is_holding and self._monotonic() < until_s:
            time.sleep(TICK_S)
        self._bridge.close()

    @property
    def counters(self) -> Mapping[str, int]:
        """How often something went wrong with the connection, with orders, and with odometry."""
        with self._bridge.lock:
            return self._client.counters | self._bridge.counters

    @property
    def problem(self) -> str:
        """Why the base cannot be reached; empty where it can."""
        with self._bridge.lock:
            return self._bridge.problem or self._client.problem(self._monotonic())

    def drive(self, twist: Twist) -> Twist:
        """Order a velocity; its speeds are clipped."""
        self.abilities.check(twist)
        if self._bridge.is_dead:
            raise BaseLost(
                "The thread that talks to the rosbridge has ended: see its messages above."
            )
        with self._bridge.sending():
            return self._client.orders.order(twist, self._monotonic())

    def stop(self) -> None:
        """Stand still at once."""
        with suppress(BaseLost):
            self.drive(STILL)

    def read(self) -> BaseState:
        """Return its state now."""
        with self._bridge.lock:
            return self._client.state(self._monotonic())

    def set_home(self) -> None:
        """Make this place home."""
        with self._bridge.lock:
            self._client.odometry.set_home()

    def show(self, indication: Indication, *, aloud: bool) -> None:
        """Show its state by its light.

        Parameters
        ----------
        indication
            The state.
        aloud
            Whether a short sound announces it too, if there is one for it.
        """
        with self._bridge.sending():
            self._client.show(str(indication), aloud=aloud)

    def answer(self, answer: Answer) -> None:
        """Send its words, and raise or lower head or arms, where it has any."""
        with self._bridge.sending():
            self._client.answer(answer)

    def _set_topics(self, topics: Topics) -> None:
        self.abilities = topics.abilities
        self._client = BaseClient(topics, self._monotonic())
        self._bridge = Bridge(self._client, self._monotonic)
