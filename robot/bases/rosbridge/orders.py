"""Orders to a base by ROS: the newest twist and no other, one on its way at a time."""

from __future__ import annotations

import math
from collections import Counter, deque

from robot.motion.limits import CEILING_M_S, CEILING_RAD_S, ORDER_HOLDS_S, Limits
from robot.motion.twist import STILL, Twist

WHEELS = Limits(v_m_s=CEILING_M_S, w_rad_s=CEILING_RAD_S)

# Standing still is said so often [s]: once is not enough where a message may be lost, and a mux
# gives a base to somebody else after 0.2 s without one (docs/reference/kobuki.md#watchdogs).
STILL_EVERY_S = 0.1
# Bridges write numbers with 9 digits and more; these are what we order anyhow [m/s, rad/s].
DIGITS, SAME = 4, 1e-5
REMEMBERED = 32  # twists that may still come back


class Orders:
    """The one twist that may be waiting, and those that have not come back yet.

    We subscribe to the topic that we publish on: what comes back has passed through ROS. A twist
    that moves is sent only when the one before it is back, so that no network can pile them up;
    standing still is sent whenever it is due. After each opening of the connection, and after a
    pause in the orders or in what comes back, nothing else is sent until it has come back and is
    ordered once more.

    Attributes
    ----------
    sent
        What was sent last; still after a loss.
    is_answered
        Whether anything that we sent on this connection has come back.
    counters
        How many moving twists were ``dropped`` for a newer one, or ``refused`` before standing
        still had come back, how often orders ``lapsed``, and how many moving twists were of
        another program (``foreign``).
    """

    def __init__(self) -> None:
        self.sent = STILL
        self.counters: Counter[str] = Counter(dropped=0, refused=0, lapsed=0, foreign=0)
        self._wanted, self._wanted_s = STILL, -math.inf
        self._is_new = False  # the wanted one has not been sent
        self._sent_s = -math.inf
        self._out: deque[tuple[float, Twist]] = deque(maxlen=REMEMBERED)
        self._recent: deque[Twist] = deque(maxlen=REMEMBERED)
        self._is_held, self._is_still_back = True, False
        self.is_answered = False

    def order(self, twist: Twist, now_s: float) -> Twist:
        """Store an order in place of the last one, and return what will be sent."""
        clipped = WHEELS.clip(twist)
        twist = Twist(round(clipped.v_m_s, DIGITS), round(clipped.w_rad_s, DIGITS))
        if twist.is_still and self._is_still_back:
            self._is_held = False
        if self._is_held and not twist.is_still:
            self.counters["refused"] += 1
            twist = STILL
        self.counters["dropped"] += self._is_new and not self._wanted.is_still
        self._wanted, self._wanted_s, self._is_new = twist, now_s, True
        return twist

    def forget(self) -> None:
        """Reset everything: the connection is lost, or there is a new one."""
        self.sent, self._sent_s = STILL, -math.inf
        self._wanted, self._is_new = STILL, False
        self._out.clear()
        self._is_held, self._is_still_back = True, False
        self.is_answered = False

    def due(self, now_s: float) -> Twist | None:
        """Return the twist to send now, which counts as sent; None for none."""
        # The program that orders hangs, or what was sent does not come back: it may arrive late,
        # and what follows it has to be standing still.
        waits_s = max(now_s - self._wanted_s, self.unanswered_s(now_s))
        if not self._wanted.is_still and waits_s > ORDER_HOLDS_S:
            self.counters["lapsed"] += 1
            self._wanted, self._is_held, self._is_still_back = STILL, True, False
        if self._wanted.is_still:
            is_due = not self.sent.is_still or now_s - self._sent_s >= STILL_EVERY_S
        else:
            is_due = self._is_new and not self._out
        if not is_due:
            return None
        self.sent, self._sent_s, self._is_new = self._wanted, now_s, False
        self._out.append((now_s, self.sent))
        self._recent.append(self.sent)
        return self.sent

    def come_back(self, twist: Twist) -> bool:
        """Handle a twist from the topic, and return whether it moves and is of another program."""
        for place in reversed(range(len(self._out))):
            if _are_same(self._out[place][1], twist):
                for _ in range(place + 1):
                    self._out.popleft()
                self.is_answered = True
                self._is_still_back = self._is_still_back or twist.is_still
                return False
        is_foreign = not twist.is_still and not any(_are_same(one, twist) for one in self._recent)
        self.counters["foreign"] += is_foreign
        return is_foreign

    def unanswered_s(self, now_s: float) -> float:
        """Return how long something has not come back [s]; 0 where all has."""
        return now_s - self._out[0][0] if self._out else 0.0


def _are_same(one: Twist, other: Twist) -> bool:
    return abs(one.v_m_s - other.v_m_s) < SAME and abs(one.w_rad_s - other.w_rad_s) < SAME
