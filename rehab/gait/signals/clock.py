"""When samples were taken, where their stamps say when they came.

A sensor samples evenly, and no sample can arrive before it was taken: the truth is the lower
envelope of stamp against sample number. A sample above it is *late* if the stamps come back to the
line, and after a *loss* if they do not. (docs/reference/gait.md#time-base)
"""

from __future__ import annotations

import math
from collections import deque

import numpy as np
from numpy.typing import NDArray

from rehab.gait.signals.filters import Floats, find_maximum
from rehab.gait.strides import GaitInputError

FIRST_SAMPLES = 64  # from which the period is known
LINE_SAMPLES = 256  # of the newest, through which the line is drawn
ANCHOR_SAMPLES = 32
LATE_PERIODS, LATE_STAMP_S = 0.5, 0.003  # beyond a period; jitter is a fifth of that (moore2013)
# After a loss the stamps go on at the sensors' rate; after a stall they come in a burst, of half
# a period a sample and less, until the line is reached.
BURST_PACE = 0.9
EVEN_S, EVEN_SAMPLES = 0.02, 3
UNDECIDED_S = 1.0
SLOWEST_S = 2.0  # between samples; what lies further apart is in milliseconds


class SampleClock:
    """Puts late samples back to when they were taken; the rest retain their times.

    Samples are held back from a gap on until it is known whether they are late. What comes out
    does not depend on how the samples are cut into chunks.
    """

    def __init__(self) -> None:
        self._period_s: float | None = None
        self._usual_s = math.nan  # at most between two samples, once the period is known
        self._newest: deque[Floats] = deque()  # times without a gap
        self._count = 0  # of them
        self._stamp_s = math.nan  # of the newest sample
        self._held: Floats | None = None

    @property
    def is_holding(self) -> bool:
        """Whether samples are held back."""
        return self._held is not None

    def follow(self, stamps: Floats) -> bool:
        """Return whether all samples come evenly, so that their times are their stamps [s].

        Those that do not are to be added.
        """
        if self._held is not None or self._period_s is None:
            return False
        if self._count_even(stamps) < len(stamps):
            return False
        self._extend(stamps.copy(), stamps.item(-1))
        return True

    def add(self, table: Floats, row: int = 0) -> tuple[Floats, Floats | None]:
        """Return the samples whose times are known now, and by how much each was late.

        Parameters
        ----------
        table
            Stamps [s] and any channels, shape (rows, n); the clock retains it, and changes it where
            samples are late.
        row
            Where the stamps are.

        Returns
        -------
        As many rows as were given, with times in place of stamps, and the stamps' lateness [s],
        shape (n,), or None where none is late.
        """
        if self._held is not None:
            table, self._held = np.concatenate((self._held, table), axis=1), None
        stamps = table[row]
        count = len(stamps)
        done = self._pass_even(stamps, count) if count else 0
        if done == count:
            return table, None
        late = None
        while done < count:
            if even := self._pass_even(stamps[done:], count - done):
                done += even
                continue
            settled = self._settle(stamps[done:])
            if settled is None:
                self._held, table = table[:, done:], table[:, :done]
                break
            if late is None:
                late = np.zeros(count)
            part = slice(done, done + len(settled))
            late[part] = np.maximum(stamps[part] - settled, 0)
            self._extend(settled, float(stamps[part.stop - 1]))
            stamps[part] = settled
            done = part.stop
            if self._period_s is None:
                self._begin_line(self._line[-1:])
        return table, None if late is None else late[:done]

    def finish(self) -> Floats | None:
        """Return the samples that are still held back, with the times that they have."""
        held, self._held = self._held, None
        return held

    def _pass_even(self, stamps: Floats, count: int) -> int:
        """Return how many samples come evenly, and follow them with the line; 0 for a gap."""
        if self._period_s is None:
            count = min(count, FIRST_SAMPLES - self._count)
            self._extend(stamps[:count], float(stamps[count - 1]))
            if self._count >= FIRST_SAMPLES:
                self._period_s = find_period(self._line)
                if self._period_s is None:
                    self._begin_line(np.empty(0))
                else:
                    self._usual_s = self._period_s + _find_tolerance(self._period_s)
            return count
        count = self._count_even(stamps)
        if count:
            self._extend(stamps[:count], stamps.item(count - 1))
        return count

    def _count_even(self, stamps: Floats) -> int:
        """Return how many samples come evenly, once the period is known; 0 for a gap."""
        if not stamps.item(0) - self._stamp_s <= self._usual_s:
            return 0
        steps_s = stamps[1:] - stamps[:-1]
        if not len(steps_s) or find_maximum(steps_s) <= self._usual_s:
            return len(stamps)
        return _first(~(steps_s <= self._usual_s)) + 1

    def _extend(self, times: Floats, stamp_s: float) -> None:
        self._stamp_s = stamp_s
        self._newest.append(times)
        self._count += len(times)
        while self._count - len(self._newest[0]) >= LINE_SAMPLES:
            self._count -= len(self._newest.popleft())

    @property
    def _line(self) -> Floats:
        """Times of the newest samples, without a gap, through which the line is drawn."""
        return np.concatenate([np.empty(0), *self._newest])[-LINE_SAMPLES:]

    def _begin_line(self, times: Floats) -> None:
        self._newest, self._count = deque([times]), len(times)

    def _settle(self, stamps: Floats) -> Floats | None:
        """Return the times of the samples from a gap on to where it is decided; None if it is not.

        The first sample is after the gap.
        """
        assert self._period_s is not None  # noqa: S101 (no gap is looked for before)
        recent = self._line
        period_s = find_period(recent) or self._period_s
        tolerance_s = _find_tolerance(period_s)
        anchor = recent[-ANCHOR_SAMPLES:]
        behind = np.arange(1 - len(anchor), 1) * period_s
        last_s = float(np.median(anchor - behind))
        line = last_s + period_s * np.arange(1, len(stamps) + 1)
        lateness = stamps - line
        steps = np.diff(stamps, prepend=self._stamp_s)
        even = max(EVEN_SAMPLES, math.ceil(EVEN_S / period_s))
        broken = _first(~(steps >= 0) | ~(lateness >= -tolerance_s))
        back = _first(lateness <= 0.5 * period_s)
        lost = _first_even(stamps, steps, even, period_s, tolerance_s)
        undecided = _first(stamps - stamps[0] > UNDECIDED_S)
        at = min(broken, back, lost, undecided)
        if at == len(stamps):
            return None
        if at == broken:  # the sensor's clock was set
            self._begin_line(np.empty(0))
            self._period_s = None
            return stamps[: at + 1]
        if at == back:
            back_s: Floats = line[: at + 1].astype(np.float64)
            return back_s
        level_s = float(lateness[max(0, at - even + 1) : at + 1].min())
        self._begin_line(np.empty(0))  # it goes on from here, higher by what was lost
        times: Floats = np.minimum(stamps[: at + 1], line[: at + 1] + level_s)
        return times


def find_period(times: Floats) -> float | None:
    """Return the mean of the usual steps between times [s], None where no step is usual."""
    steps = np.diff(times)
    steps = steps[steps > 0]
    if not len(steps):
        return None
    middle = float(np.sort(steps)[len(steps) // 2])  # an actual step, not a mean of two
    usual = steps[np.abs(steps - middle) < 0.5 * middle]
    return float(usual.mean()) if len(usual) > len(steps) / 2 else None


def estimate_rate(t_s: Floats) -> float:
    """Return the rate of samples [Hz] by their times, gaps excluded.

    Their mean, in which jitter cancels out: an error of the rate is one of A2.

    Raises
    ------
    GaitInputError
        With the cure, where the times have no usual rate.
    """
    if not (np.diff(t_s) > 0).any():
        raise GaitInputError("The times of the samples do not go on. Map another time column.")
    period_s = find_period(t_s)
    if period_s is None:
        raise GaitInputError("The times of the samples tell no rate. Give it with --rate.")
    if period_s > SLOWEST_S:
        raise GaitInputError(
            f"Samples lie {period_s:g} s apart by their own times: milliseconds? Send seconds, or "
            "map the time with a factor (--columns time=t*0.001 …)."
        )
    whole_hz = float(round(1 / period_s)) or 1.0
    return whole_hz if abs(1 / period_s / whole_hz - 1) < 0.001 else 1 / period_s


def _find_tolerance(period_s: float) -> float:
    return max(LATE_PERIODS * period_s, LATE_STAMP_S)


def _first(found: NDArray[np.bool_]) -> int:
    """Return the index of the first true value, the length without one."""
    at = int(found.argmax())
    return at if found[at] else len(found)


def _first_even(
    stamps: Floats, steps: Floats, even: int, period_s: float, tolerance_s: float
) -> int:
    """Return the first sample at which the stamps have gone on evenly for ``even`` samples."""
    if len(stamps) <= even:
        return len(stamps)
    pace = (stamps[even:] - stamps[:-even]) / even
    gaps = np.cumsum(steps > period_s + tolerance_s)
    at = _first((pace >= BURST_PACE * period_s) & (gaps[even:] == gaps[:-even]))
    return at + even if at < len(pace) else len(stamps)
