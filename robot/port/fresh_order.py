"""The frame to send to a base now: the last order while it is fresh, else the stop."""

from __future__ import annotations

import json
import threading
from collections import Counter
from dataclasses import dataclass

from robot.motion.limits import ORDER_HOLDS_S
from robot.wire.frames import to_number

MAX_AHEAD_S = 0.05  # an order from further in the future is refused
MAX_FRAME_BYTES = 64  # a Kobuki's buffer for commands [bytes] (docs/reference/kobuki.md#framing)


class BadOrder(ValueError):
    """A line that is no order; the message says what an order is."""


@dataclass(frozen=True, slots=True)
class Order:
    """One line of the orders."""

    number: int
    sent_s: float
    frame: bytes
    once: bytes

    @classmethod
    def read(cls, line: bytes) -> Order:
        """Return the order of a line. Raises BadOrder."""
        try:
            fields = json.loads(line)
            number, sent_s = fields["number"], to_number(fields["sent_s"])
            frame, once = bytes.fromhex(fields["frame"]), bytes.fromhex(fields.get("once", ""))
        except (ValueError, TypeError, KeyError, AttributeError, RecursionError):
            raise BadOrder("An order is a JSON object with number, sent_s and frame.") from None
        if type(number) is not int or sent_s is None:
            raise BadOrder('"number" is a whole number, "sent_s" a finite one.')
        if not 0 < len(frame) <= MAX_FRAME_BYTES >= len(once):
            raise BadOrder(f"Frames have up to {MAX_FRAME_BYTES} bytes.")
        return cls(number, sent_s, frame, once)

    def is_fresh(self, now_s: float) -> bool:
        """Return whether a base may still move by it now [s]."""
        return -MAX_AHEAD_S <= now_s - self.sent_s <= ORDER_HOLDS_S


class FreshOrder:
    """The last order while it is fresh, else the stop. Nothing is queued.

    After a pause in the orders, and at the beginning, only the stop is sent until the stop is
    ordered: a motion that was interrupted is not resumed.

    Parameters
    ----------
    stop
        The frame that stops the base.

    Attributes
    ----------
    counters
        How many orders were ``bad`` (not an order), ``old`` (their number is not new, or they are
        out of date), ``refused`` (before a stop was ordered), and how often orders ``lapsed``.
    """

    def __init__(self, stop: bytes) -> None:
        self.stop = stop
        self.counters: Counter[str] = Counter(bad=0, old=0, refused=0, lapsed=0)
        self._order: Order | None = None
        self._number = -1
        self._is_held = True
        self._lock = threading.Lock()  # orders come from another thread

    def store(self, line: bytes, now_s: float) -> bytes:
        """Store an order, and return the frame that it wants sent once.

        Parameters
        ----------
        line
            One line of the orders; one that is none is counted.
        now_s
            The computer's monotonic clock [s].
        """
        try:
            order = Order.read(line)
        except BadOrder:
            self.counters["bad"] += 1
            return b""
        with self._lock:
            return self._store(order, now_s)

    def _store(self, order: Order, now_s: float) -> bytes:
        if order.number <= self._number or not order.is_fresh(now_s):
            self.counters["old"] += 1
            return b""
        self._number = order.number
        if order.frame == self.stop:
            self._is_held = False
        if self._is_held:
            self.counters["refused"] += 1
        else:
            self._order = order
        return order.once

    def frame(self, now_s: float) -> bytes:
        """Return the frame to send now."""
        with self._lock:
            order = self._order
            if order is None or order.frame == self.stop:
                return self.stop
            if order.is_fresh(now_s):
                return order.frame
            self.counters["lapsed"] += 1
            self._order, self._is_held = None, True
            return self.stop

    def hold(self) -> None:
        """Send nothing but the stop until it is ordered."""
        with self._lock:
            self._order, self._is_held = None, True
