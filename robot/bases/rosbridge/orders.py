"""Orders to a base by ROS: the newest twist and no other, a few on their way at a time."""

from __future__ import annotations

import math
from collections import Counter, deque
from dataclasses import astuple

from robot.motion.limits import ORDER_HOLDS_S, WHEEL_LIMITS
from robot.motion.twist import STILL, Twist

# A stop is repeated this often [s]: one message may be lost, and a mux
# gives a base to another program after 0.2 s without one (docs/reference/kobuki.md#watchdogs).
STILL_EVERY_S = 0.1
# Bridges write numbers with 9 digits and more; these are what we order anyhow [m/s, rad/s].
DIGITS, SAME = 4, 1e-5
MAX_UNCONFIRMED = 32  # twists whose echo is awaited
# So many moving ones may be on their way: an echo that comes 40 ms late then holds nothing up (a
# bridge without TCP_NODELAY, see docs/reference/rosbridge.md#behavior), and a network that holds
# everything back has four of them, which are followed by a stop.
IN_FLIGHT = 4


class Orders:
    """The newest twist, and those that were sent and are not confirmed yet.

    We subscribe to the topic that we publish on: an echo has passed through ROS. A moving twist is
    sent only while fewer than ``IN_FLIGHT`` are not confirmed, so that no network can pile them up;
    a stop is sent whenever it is due. After each opening of the connection, and after a pause in
    the orders or in the echoes, only stops are sent, until one is confirmed and ordered once more.

    Attributes
    ----------
    sent
        What was sent last; ``STILL`` after a loss.
    is_confirmed
        Whether an echo of anything that we sent has come on this connection.
    counters
        How many moving twists were ``dropped`` for a newer one, or ``refused`` before a stop was
        confirmed, how often orders ``lapsed``, and how many moving twists another program sent
        (``foreign``).
    """

    def __init__(self) -> None:
        self.sent = STILL
        self.counters: Counter[str] = Counter(dropped=0, refused=0, lapsed=0, foreign=0)
        self._wanted, self._wanted_s = STILL, -math.inf
        self._is_new = False  # the wanted one has not been sent
        self._sent_s = -math.inf
        self._unconfirmed: deque[tuple[float, Twist]] = deque(maxlen=MAX_UNCONFIRMED)
        self._recent: deque[Twist] = deque(maxlen=MAX_UNCONFIRMED)
        self._is_held, self._is_stop_confirmed = True, False
        self.is_confirmed = False

    def order(self, twist: Twist, now_s: float) -> Twist:
        """Store an order in place of the last one, and return what will be sent.

        Parameters
        ----------
        twist
            The velocity; its speeds are clipped and rounded. A motion becomes a stop until a stop
            has been confirmed and ordered once more.
        now_s
            The time [s].
        """
        clipped = WHEEL_LIMITS.clip(twist)
        speeds = (clipped.v_m_s, clipped.w_rad_s, clipped.vy_m_s)
        twist = Twist(*(round(speed, DIGITS) for speed in speeds))
        if twist.is_still and self._is_stop_confirmed:
            self._is_held = False
        if self._is_held and not twist.is_still:
            self.counters["refused"] += 1
            twist = STILL
        self.counters["dropped"] += self._is_new and not self._wanted.is_still
        self._wanted, self._wanted_s, self._is_new = twist, now_s, True
        return twist

    def reset(self) -> None:
        """Reset everything: the connection is lost, or there is a new one."""
        self.sent, self._sent_s = STILL, -math.inf
        self._wanted, self._is_new = STILL, False
        self._unconfirmed.clear()
        self._is_held, self._is_stop_confirmed = True, False
        self.is_confirmed = False

    def due(self, now_s: float) -> Twist | None:
        """Return the twist to send now, which counts as sent; None for none."""
        # The ordering program hangs, or the echo is missing: what was sent may arrive late, and
        # has to be followed by a stop.
        waits_s = max(now_s - self._wanted_s, self.unconfirmed_s(now_s))
        if not self._wanted.is_still and waits_s > ORDER_HOLDS_S:
            self.counters["lapsed"] += 1
            self._wanted, self._is_held, self._is_stop_confirmed = STILL, True, False
        if self._wanted.is_still:
            is_due = not self.sent.is_still or now_s - self._sent_s >= STILL_EVERY_S
        else:
            is_due = self._is_new and len(self._unconfirmed) < IN_FLIGHT
        if not is_due:
            return None
        self.sent, self._sent_s, self._is_new = self._wanted, now_s, False
        self._unconfirmed.append((now_s, self.sent))
        self._recent.append(self.sent)
        return self.sent

    def handle_echo(self, twist: Twist) -> bool:
        """Handle a twist from the topic, and return whether another program sent it to move."""
        # Of equal moving ones the first, so that none on its way counts as come; of stops the last:
        # an earlier one may be lost.
        places = range(len(self._unconfirmed))
        for place in reversed(places) if twist.is_still else places:
            if _are_same(self._unconfirmed[place][1], twist):
                for _ in range(place + 1):  # those before it have passed, too
                    self._unconfirmed.popleft()
                self.is_confirmed = True
                self._is_stop_confirmed = self._is_stop_confirmed or twist.is_still
                return False
        is_foreign = not twist.is_still and not any(_are_same(one, twist) for one in self._recent)
        self.counters["foreign"] += is_foreign
        return is_foreign

    def unconfirmed_s(self, now_s: float) -> float:
        """Return how long the oldest echo has been missing [s]; 0 where none is."""
        return now_s - self._unconfirmed[0][0] if self._unconfirmed else 0.0


def _are_same(one: Twist, other: Twist) -> bool:
    ours, theirs = astuple(one), astuple(other)
    return all(abs(a - b) < SAME for a, b in zip(ours, theirs, strict=True))
