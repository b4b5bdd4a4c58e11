"""Contacts of a foot with the floor, from a gyroscope on foot or shank.

While a leg swings, foot and shank rotate toes-up; both contacts lie where that rotation begins and
ends (Catalfamo 2010, Jasiewicz 2006; docs/reference/gait.md#gyroscopes). After a stroke a foot
sensor finds more of them than one on the shank.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import ArrayLike

from rehab.gait.settings import check_rate
from rehab.gait.signals.samples import read_chunk
from rehab.gait.strides import GaitInputError

SWING_RAD_S = 1.75  # 100 °/s; walking turns a foot by 300 °/s, a shuffle while turning around by 90
SWING_SHARE = 0.4  # of the median of the last swings
SWINGS = 10
SWING_MIN_S, SWING_MAX_S = 0.15, 1.5
NOISE_RAD_S = 0.3  # smaller changes of direction are noise
SHANK_PEAK_S = 0.15  # after the end of its forward swing the shank turns back fastest
SHANK_PUSH_S = 0.3  # before its forward swing
GAP_S = 0.1


class ContactKind(Enum):
    """Which end of a stance a contact is."""

    INITIAL = "initial"
    TERMINAL = "terminal"


@dataclass(frozen=True, slots=True)
class GyroscopeContact:
    """A contact and its time [s]."""

    kind: ContactKind
    time_s: float


class GyroscopeDetector:
    """Detects the contacts of one leg in chunks of any length, with the same result for all.

    Foot: contacts are the zero crossings around the swing. Shank: they are its fastest backward
    rotation before and after the swing. A terminal contact is returned once the swing exceeds its
    threshold, about 50 ms later, an initial contact as soon as the sensor rotates back
    (docs/reference/gait.md#gyroscopes).

    Parameters
    ----------
    rate_hz
        Nominal rate of the samples, 50-5000 Hz.
    segment
        "foot" or "shank".

    Raises
    ------
    GaitInputError
        For other rates and segments.
    """

    def __init__(self, rate_hz: float, *, segment: str = "foot") -> None:
        check_rate(rate_hz)
        if segment not in ("foot", "shank"):
            raise GaitInputError(f"A gyroscope on the {segment} is not known. Use foot or shank.")
        self._is_foot = segment == "foot"
        self._peaks: deque[float] = deque(maxlen=SWINGS)
        self._backward: deque[tuple[float, float]] = deque(maxlen=math.ceil(SHANK_PUSH_S * rate_hz))
        self._last: tuple[float, float] | None = None
        self._reset()

    def feed(self, t_s: ArrayLike, rate_rad_s: ArrayLike) -> list[GyroscopeContact]:
        """Add the next samples and return the contacts that they confirm.

        Parameters
        ----------
        t_s
            Times [s], shape (n,).
        rate_rad_s
            Angular velocity [rad/s] about the axis to the walker's left, shape (n,): positive where
            the toes go down, negative in swing. NaN where missing.

        Raises
        ------
        GaitInputError
            For arrays of different lengths.
        """
        time, rate = read_chunk(("t_s", "rate_rad_s"), (t_s, rate_rad_s))
        found: list[GyroscopeContact] = []
        for sample in zip(np.asarray(time).tolist(), np.asarray(rate).tolist(), strict=True):
            self._process_sample(sample[0], sample[1], found)
        return found

    def _reset(self) -> None:
        """Wait for a new swing, as after a gap."""
        self._swing_begin_s: float | None = None  # when the swing began
        self._terminal_s: float | None = None
        self._fastest = 0.0
        self._rotation_end_s: float | None = None  # when the rotation last ended
        self._backward_peak = (-math.inf, 0.0)  # of the shank after its swing
        self._is_confirmed = False
        self._backward.clear()

    def _process_sample(self, time: float, rate: float, found: list[GyroscopeContact]) -> None:
        if not (math.isfinite(time) and math.isfinite(rate)):
            return
        last, self._last = self._last, (time, rate)
        if last is None or not 0 < time - last[0] <= GAP_S:
            self._reset()
            return
        if self._swing_begin_s is None:
            if last[1] >= 0 > rate:
                self._swing_begin_s = _interpolate_crossing(last, (time, rate))
                self._fastest, self._is_confirmed, self._rotation_end_s = 0.0, False, None
                self._terminal_s = self._swing_begin_s if self._is_foot else self._find_push()
            self._backward.append((rate, time))
            return
        if self._rotation_end_s is None or rate < 0:
            self._fastest = min(self._fastest, rate)
        if rate < 0:
            self._rotation_end_s = None
        elif self._rotation_end_s is None:
            self._rotation_end_s, self._backward_peak = (
                _interpolate_crossing(last, (time, rate)),
                (-math.inf, 0.0),
            )
        self._backward_peak = max(self._backward_peak, (rate, time))
        if not self._is_confirmed and -self._fastest > self._find_threshold():
            self._is_confirmed = True
            if self._terminal_s is not None:
                found.append(GyroscopeContact(ContactKind.TERMINAL, self._terminal_s))
        if self._rotation_end_s is not None:
            self._finish(time, rate, found)
        elif time - self._swing_begin_s > SWING_MAX_S:
            self._reset()

    def _finish(self, time: float, rate: float, found: list[GyroscopeContact]) -> None:
        """Check whether the swing is over, and was one."""
        end_s, swing_s = self._rotation_end_s or 0.0, self._swing_begin_s or 0.0
        if self._is_foot or not self._is_confirmed:
            is_over = rate > NOISE_RAD_S or time - end_s > SWING_MIN_S
            contact_s = end_s
        else:
            is_over = rate < self._backward_peak[0] - NOISE_RAD_S or time - end_s > SHANK_PEAK_S
            contact_s = self._backward_peak[1]
        if not is_over:
            return
        if self._is_confirmed and end_s - swing_s >= SWING_MIN_S:
            self._peaks.append(-self._fastest)
            found.append(GyroscopeContact(ContactKind.INITIAL, contact_s))
        self._reset()
        self._backward.append((rate, time))

    def _find_threshold(self) -> float:
        usual = sorted(self._peaks)[len(self._peaks) // 2] if self._peaks else 0.0
        return max(SWING_RAD_S, SWING_SHARE * usual)

    def _find_push(self) -> float | None:
        """Return when the shank rotated back fastest before its swing [s]."""
        return max(self._backward)[1] if self._backward else None


def _interpolate_crossing(before: tuple[float, float], after: tuple[float, float]) -> float:
    """Return when the rate was zero between two samples (time, rate) [s]."""
    share = before[1] / (before[1] - after[1]) if before[1] != after[1] else 1.0
    return before[0] + share * (after[0] - before[0])
