"""Another machine's clock, estimated only from the times that arrive from it.

Each time arrives with some delay; the one with the shortest delay is the best estimate.
"""

from __future__ import annotations

# A step later than this is stored and counted, but never shown as live
# (docs/reference/scoring.md#late-steps).
LATE_STEP_S = 5.0
# How much slower than ours a clock may run. A ceramic resonator, the worst that times a sensor, is
# off by ±0.5 % when it is made and ±0.2 % by temperature (Murata, CERALOCK catalog P16E), a quartz
# by less than ±0.01 %; ours is a quartz. So drift alone makes no time late, and the estimate falls
# behind by at most 0.6 s for each minute without a fresh time.
DRIFT_MAX = 0.01


class RemoteClock:
    """Estimates a remote clock from the times that arrive, and distinguishes fresh from late ones.

    The time that arrived with the shortest delay so far stands for a fresh one. The estimate decays
    by ``DRIFT_MAX``, so that a clock that runs slow is followed; a delay that grows no faster
    looks the same. A time more than ``LATE_STEP_S`` before the last one was read from a clock
    that was set back, by a device that restarted or by its network time: the estimate begins anew.

    Parameters
    ----------
    speed
        Seconds of that clock in one of ours.
    time_s, now_s
        What it shows while ours shows ``now_s`` [s], where the device has sent it; else None.
    """

    def __init__(self, speed: float = 1.0, time_s: float | None = None, now_s: float = 0.0) -> None:
        self._speed = speed
        # That clock when ours shows 0, in its own seconds; and when the last fresh time arrived.
        self._offset = None if time_s is None else time_s - now_s * speed
        self._seen_s = now_s
        self._last_s: float | None = None  # the time that came last

    @property
    def is_known(self) -> bool:
        """Whether there is an estimate."""
        return self._offset is not None

    def read_s(self, now_s: float) -> float | None:
        """Return what it shows now [s], None without an estimate."""
        decayed = self._decayed_offset(now_s)
        return None if decayed is None else decayed + now_s * self._speed

    def observe(self, time_s: float, now_s: float) -> bool:
        """Update the estimate with a time that arrives now, and return whether that time is late.

        Parameters
        ----------
        time_s
            The time on the remote clock [s].
        now_s
            Ours [s].
        """
        slack_s = LATE_STEP_S * max(1.0, self._speed)
        offset = time_s - now_s * self._speed
        known, last_s, self._last_s = self._decayed_offset(now_s), self._last_s, time_s
        if known is None or (last_s is not None and time_s < last_s - slack_s):
            known = offset
        if known - offset > slack_s:
            return True
        self._offset, self._seen_s = max(known, offset), now_s
        return False

    def forget(self) -> None:
        """Begin the estimate anew with the next time that arrives."""
        self._offset = None

    def _decayed_offset(self, now_s: float) -> float | None:
        if self._offset is None:
            return None
        return self._offset - DRIFT_MAX * self._speed * (now_s - self._seen_s)
