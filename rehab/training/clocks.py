"""What another clock shows, told by nothing but the times of what happened there.

One that is heard over a network: each time arrives some delay after it was true, and the shortest
delay tells most.
"""

from __future__ import annotations

# A step later than this is stored and counted, but never shown as live
# (docs/reference/scoring.md#late-steps).
LATE_S = 5.0
# How much slower than ours a clock may run. A ceramic resonator, the worst that times a sensor, is
# off by ±0.5 % when it is made and ±0.2 % by temperature (Murata, CERALOCK catalog P16E), a quartz
# by less than ±0.01 %; ours is a quartz. So no drift alone makes anything late, and what a fresh
# time may be behind grows by at most 0.6 s for each minute in which none was.
LEAK = 0.01


class HeardClock:
    """Tells what came just now from what was held up on its way, by the time that it has there.

    The quickest time so far stands for a fresh one. What it tells leaks away by ``LEAK``, so that a
    clock that runs slow is followed; a delay that grows no faster cannot be told from that. A time
    that lies more than ``LATE_S`` before the last one was read from a clock that was set back, by a
    device that began anew or by its network time: what was known of it says nothing any more.

    Parameters
    ----------
    speed
        Seconds of that clock in one of ours.
    time_s, now_s
        What it shows while ours shows ``now_s``, where it was told [s].
    """

    def __init__(self, speed: float = 1.0, time_s: float | None = None, now_s: float = 0.0) -> None:
        self._speed = speed
        # That clock when ours shows 0, in its own seconds; and when something fresh was heard.
        self._offset = None if time_s is None else time_s - now_s * speed
        self._seen_s = now_s
        self._last_s: float | None = None  # the time that came last

    @property
    def is_known(self) -> bool:
        """Whether anything is known of it."""
        return self._offset is not None

    def read_s(self, now_s: float) -> float | None:
        """Give what it shows now [s], if anything is known of it."""
        leaked = self._leaked(now_s)
        return None if leaked is None else leaked + now_s * self._speed

    def is_late(self, time_s: float, now_s: float) -> bool:
        """Hear a time that arrives now; say whether it was held up."""
        slack_s = LATE_S * max(1.0, self._speed)
        offset = time_s - now_s * self._speed
        known, last_s, self._last_s = self._leaked(now_s), self._last_s, time_s
        if known is None or (last_s is not None and time_s < last_s - slack_s):
            known = offset
        if known - offset > slack_s:
            return True
        self._offset, self._seen_s = max(known, offset), now_s
        return False

    def slacken(self, now_s: float) -> None:
        """Allow that it stood still while nothing fresh was heard. What comes next tells."""
        if self._offset is not None:
            self._offset -= (now_s - self._seen_s) * self._speed
            self._seen_s = now_s

    def _leaked(self, now_s: float) -> float | None:
        if self._offset is None:
            return None
        return self._offset - LEAK * self._speed * (now_s - self._seen_s)
