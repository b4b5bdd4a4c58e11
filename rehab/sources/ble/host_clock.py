"""A sensor's clock on ours: how far it is ahead, and how well that is known."""

from __future__ import annotations

import math

DRIFT = 50e-6  # between two quartz clocks at most
SLEW = 1e-3  # seconds a second: faster, strides would be longer or shorter than they are
STEP_S = 0.5  # from which it is another clock, as after a restart


class HostClock:
    """Puts a sensor's times on our clock.

    An exchange bounds the error: the sensor read its clock between our question and its answer
    (NTP's offset, RFC 5905, 8). Where a sensor cannot be asked, the samples that arrived soonest
    say the offset, late by an unknown delay.
    """

    def __init__(self) -> None:
        self._offset_s = math.nan  # ours less the sensor's
        self._best = (math.nan, math.inf, 0.0)  # offset, its error, when
        self._soonest = (math.inf, 0.0)
        self._moved_s = 0.0

    def exchange(self, asked_s: float, sensor_s: float, answered_s: float) -> None:
        """Take an answer: our times of question and answer, the sensor's between them."""
        error_s = (answered_s - asked_s) / 2
        if error_s <= self.error_s(answered_s):
            self._best = ((asked_s + answered_s) / 2 - sensor_s, error_s, answered_s)

    def error_s(self, now_s: float) -> float:
        """Return the largest error of times that are put on our clock [s]; infinite: unknown."""
        offset_s, error_s, at_s = self._best
        if math.isinf(error_s):
            return math.inf
        away_s = 0.0 if math.isnan(self._offset_s) else abs(offset_s - self._offset_s)
        return error_s + DRIFT * (now_s - at_s) + away_s

    def place(self, sensor_s: float, now_s: float) -> float:
        """Return a sample's time on our clock; it arrived now."""
        late_s = now_s - sensor_s
        soonest_s, at_s = self._soonest
        if late_s <= soonest_s + DRIFT * (now_s - at_s) or late_s > soonest_s + STEP_S:
            self._soonest = (late_s, now_s)
        wanted_s = self._best[0] if math.isfinite(self._best[1]) else self._soonest[0]
        if math.isnan(self._offset_s) or abs(wanted_s - self._offset_s) > STEP_S:
            self._offset_s = wanted_s
        most_s = SLEW * max(0.0, now_s - self._moved_s)
        self._offset_s += min(max(wanted_s - self._offset_s, -most_s), most_s)
        self._moved_s = now_s
        return sensor_s + self._offset_s
