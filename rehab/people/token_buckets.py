"""How often something may be done: token buckets in the memory of one process.

Lock-outs that must last, of accounts and of PINs, are rows of the database.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Hashable
from threading import Lock

MAX_KEYS = 10_000


class TokenBucket:
    """A burst at once, then one more in each interval."""

    __slots__ = ("_burst_s", "_full_at", "_interval_s")

    def __init__(self, burst: float, interval_s: float) -> None:
        self._burst_s = (burst - 1) * interval_s
        self._interval_s = interval_s
        self._full_at = float("-inf")  # when a whole burst is there again

    def wait_s(self, now_s: float) -> float:
        """Return how long to wait for the next token; 0 where there is one."""
        return max(0.0, self._full_at - now_s - self._burst_s)

    def take(self, now_s: float) -> float:
        """Take a token and return 0, or return how long to wait for one and take none."""
        wait_s = self.wait_s(now_s)
        if not wait_s:
            self._full_at = max(now_s, self._full_at) + self._interval_s
        return wait_s


class TokenBuckets:
    """A bucket for each key, such as an address or an account. Threads may share it."""

    def __init__(self, burst: float, interval_s: float) -> None:
        self.burst, self.interval_s = burst, interval_s
        self._buckets: OrderedDict[Hashable, TokenBucket] = OrderedDict()
        self._lock = Lock()

    def take(self, key: Hashable, now_s: float) -> float:
        """Take a token and return 0, or return how long to wait for one and take none."""
        with self._lock:
            bucket = self._buckets.setdefault(key, TokenBucket(self.burst, self.interval_s))
            self._buckets.move_to_end(key)
            if len(self._buckets) > MAX_KEYS:
                self._buckets.popitem(last=False)
            return bucket.take(now_s)

    def forget(self, key: Hashable) -> None:
        """Fill a key's bucket again."""
        with self._lock:
            self._buckets.pop(key, None)
