"""A base that our driver drives over real sockets, and a wire between them."""

import time
from contextlib import ExitStack, contextmanager
from dataclasses import replace

from robot.bases.rosbridge import RosbridgeBase
from robot.bases.rosbridge.topics import PROFILES, Topics
from robot.motion.twist import Twist
from tests.support.fake_ros import drive, release
from tests.support.wire import Wire

TIMEOUT_S = 0.6
PLAIN = replace(PROFILES["plain"], own_timeout_s=TIMEOUT_S)


def open_base(url: str, topics: Topics = PLAIN) -> RosbridgeBase:
    """Return a base at a bridge, to be opened by ``with``."""
    base = RosbridgeBase(time.monotonic, topics)
    base.port = url
    return base


@contextmanager
def wired_base(ros, topics: Topics = PLAIN):
    """Open a base at a served bridge over a wire, and give both."""
    with ExitStack() as stack:
        wire = stack.enter_context(Wire(ros.port))
        yield wire, stack.enter_context(open_base(f"ws://127.0.0.1:{wire.port}", topics))


def lose_while_moving(ros, wire, base):
    """Cut the wire while the base moves, until it says so."""
    release(base)
    drive(base, Twist(0.2, 0), lambda: ros.robot.is_moving)
    wire.go_down()
    drive(base, Twist(0.2, 0), lambda: "No rosbridge" in base.problem)


def come_back(ros, wire, base):
    """Mend the wire while motion is ordered; give the orders that reach the base then."""
    before = len(ros.robot.orders)
    wire.come_up()
    drive(base, Twist(0.2, 0), lambda: len(ros.robot.orders) > before + 3)
    return {order[1:] for order in ros.robot.orders[before:]}
