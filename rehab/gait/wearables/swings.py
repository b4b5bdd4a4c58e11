"""Swings of a leg in the sagittal rate of a foot or shank."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

SWING_RAD_S = 0.5  # the weakest known swing, of a foot after a stroke, reaches 0.8 (stroke_imu)
SWING_RAD = math.radians(8)  # that it turns by at least; the weakest known one does by 12°
SWING_SHARE = 0.4  # of the median of the last swings' rates
SWINGS = 10
SWINGS_S = 20.0  # after which a swing says nothing of how a person walks now
SWING_MIN_S, SWING_MAX_S = 0.11, 1.5
NOISE_RAD_S = 0.3  # smaller changes of direction are noise
END_S = 0.11  # after which a leg that does not turn back has landed flat
GAP_S = 0.1


@dataclass(frozen=True, slots=True)
class Swing:
    """A swing, by the zero crossings of the rate at both of its ends [s]."""

    begin_s: float
    end_s: float


class SwingDetector:
    """Finds swings sample by sample.

    A swing is a rotation toes-up that is fast enough for this person, far enough and neither too
    short nor too long. It is known once the leg turns back, at most 0.11 s after its end.
    """

    def __init__(self) -> None:
        self._fastest: deque[tuple[float, float]] = deque(maxlen=SWINGS)  # when [s], how fast
        self._last = (math.nan, 0.0)
        self.restart()

    def restart(self) -> None:
        """Wait for a new swing, as after a gap."""
        self._begin_s = math.nan
        self._end_s = math.nan  # of the rotation toes-up, until it is certain
        self._flat_s = math.nan  # since when there is none but noise
        self._peak_rad_s = self._turned_rad = 0.0

    def add(self, time_s: float, rate_rad_s: float) -> Swing | None:
        """Add a sample and return the swing that it ends.

        Parameters
        ----------
        rate_rad_s
            About the axis to the walker's left: positive toes-down, negative in swing.
        """
        (last_s, last), self._last = self._last, (time_s, rate_rad_s)
        if not 0 < time_s - last_s <= GAP_S:
            self.restart()
            return None
        if math.isnan(self._begin_s):
            if last >= 0 > rate_rad_s:
                self._begin_s = find_crossing(last_s, last, time_s, rate_rad_s)
                self._turn(time_s - self._begin_s, 0.0, rate_rad_s)
            return None
        if rate_rad_s < 0:
            self._end_s = math.nan
            if rate_rad_s < -NOISE_RAD_S:
                self._flat_s = math.nan
            self._turn(time_s - last_s, min(last, 0.0), rate_rad_s)
        elif math.isnan(self._end_s):
            self._end_s = find_crossing(last_s, last, time_s, rate_rad_s)
            self._turn(self._end_s - last_s, last, 0.0)
            if math.isnan(self._flat_s):
                self._flat_s = self._end_s
        begin_s, flat_s = self._begin_s, self._flat_s
        if math.isnan(flat_s):
            if time_s - begin_s > SWING_MAX_S:
                self.restart()
            return None
        if rate_rad_s <= NOISE_RAD_S and time_s - flat_s <= END_S:
            return None
        end_s = self._end_s if rate_rad_s > NOISE_RAD_S else flat_s
        is_swing = (
            end_s - begin_s >= SWING_MIN_S
            and self._turned_rad >= SWING_RAD
            and self._peak_rad_s > self._find_threshold(time_s)
        )
        if is_swing:
            self._fastest.append((time_s, self._peak_rad_s))
        self.restart()
        return Swing(begin_s, end_s) if is_swing else None

    def _turn(self, step_s: float, before: float, after: float) -> None:
        self._turned_rad -= step_s * (before + after) / 2
        self._peak_rad_s = max(self._peak_rad_s, -after)

    def _find_threshold(self, now_s: float) -> float:
        """Return how fast a swing has to be [rad/s]: it follows the person."""
        usual = sorted(peak for when_s, peak in self._fastest if now_s - when_s <= SWINGS_S)
        return max(SWING_RAD_S, SWING_SHARE * usual[len(usual) // 2]) if usual else SWING_RAD_S


def find_crossing(last_s: float, last: float, now_s: float, now: float) -> float:
    """Return when a rate was zero between two samples [s]."""
    return last_s + (now_s - last_s) * (last / (last - now) if last != now else 1.0)
