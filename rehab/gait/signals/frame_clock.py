"""When samples were taken, by the frame numbers that their device counts.

What is missing from the count is lost, and what comes late is late by what its number says: nothing
is guessed, as it has to be from stamps alone (``signals.clock``). Numbers that cannot be a count of
the samples are ignored, and the reason is reported.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from rehab.gait.signals.clock import (
    FIRST_SAMPLES,
    LATE_PERIODS,
    LATE_STAMP_S,
    UNDECIDED_S,
    SampleClock,
)
from rehab.gait.signals.filters import Floats
from rehab.gait.strides import GaitInputError

BLOCK, BLOCKS = 64, 16  # samples, and how many of these the line through the stamps is drawn by
SPREAD = 3.0  # times that of stamps around the line a sample is late; clocks may tick every 16 ms
USUAL = 0.9  # of the first steps that count on
RESTARTS = 3  # of the count, within a minute
RESTARTS_S = 60.0
IGNORED = "The frame numbers are ignored: {}. Send the device's own count of samples, or none."


def find_frame_problem(t_s: Floats, frames: Floats | None) -> str:
    """Return why the frame numbers of a recording are ignored; empty where they are used.

    Parameters
    ----------
    t_s, frames
        Times [s], and the samples' numbers or None, shape (n,) each; NaN where one has none.
    """
    clock = FrameClock()
    if frames is not None:
        clock.add(np.array([t_s]), 0, frames)
    return clock.problem


def _find_pace(stamps: Floats, frames: Floats) -> float:
    """Return the time of a number: the slope of a line through the samples that do not stall."""
    half = len(stamps) // 2
    counted = frames[half:] - frames[:-half]
    if not (counted > 0).all():
        return math.nan
    pace_s = float(np.median((stamps[half:] - stamps[:-half]) / counted))
    off = stamps - pace_s * frames
    off = np.abs(off - np.median(off))
    usual = off <= SPREAD * np.median(off)
    return float(np.polynomial.Polynomial.fit(frames[usual], stamps[usual], 1).convert().coef[1])


@dataclass(frozen=True, slots=True)
class Newest:
    """The newest sample: its number in a count that never restarts, and when it was taken.

    ``shift`` is added to numbers as they come.
    """

    number: float = -math.inf
    stamp_s: float = -math.inf
    time_s: float = -math.inf
    shift: float = 0.0


def read_frames(frame: ArrayLike | None, count: int) -> Floats:
    """Return frame numbers as an array of shape (count,), NaN where there are none.

    Parameters
    ----------
    frame
        The numbers as they were sent, None for none.
    count
        How many samples they belong to.

    Raises
    ------
    GaitInputError
        For another number of them.
    """
    frames: Floats = (
        np.full(count, np.nan) if frame is None else np.atleast_1d(np.asarray(frame, np.float64))
    )
    if frames.shape != (count,):
        raise GaitInputError(
            f"There are {frames.size} frame numbers for {count} samples. Feed one of each."
        )
    return frames


class FrameClock:
    """Puts samples to when they were taken, by stamps and frame numbers.

    Samples that are late are held back until one is in time again. What comes out does not depend
    on how the samples are cut into chunks.

    Attributes
    ----------
    problem
        Why the numbers are ignored, with the cure; empty while they are used.
    """

    def __init__(self) -> None:
        self.problem = ""
        self._plain: SampleClock | None = None  # by stamps alone, once the numbers are ignored
        self._held: Floats | None = None
        self._numbers = np.empty(0)  # of the samples that are held back
        self._restarts: deque[float] = deque(maxlen=RESTARTS)
        self._start_over()

    @property
    def usual_s(self) -> float:
        """The most time between two samples of which none is lost [s]; infinite if not known."""
        return 1.5 * self._step * self._period_s or math.inf

    @property
    def is_holding(self) -> bool:
        """Whether samples are held back."""
        return self._held is not None if self._plain is None else self._plain.is_holding

    def add(self, table: Floats, row: int, frames: Floats) -> tuple[Floats, Floats | None]:
        """Return the samples whose times are known now, and by how much each was late.

        Parameters
        ----------
        table, row
            As in ``SampleClock.add``.
        frames
            The samples' numbers, shape (n,); NaN where one has none.

        Returns
        -------
        As ``SampleClock.add``; a sample that came before is left out.
        """
        if self._plain is not None:
            return self._plain.add(table, row)
        if self._held is not None:
            table, self._held = np.concatenate((self._held, table), axis=1), None
        frames, self._numbers = np.concatenate((self._numbers, frames)), np.empty(0)
        frames[~np.isfinite(frames)] = np.nan
        if not self._period_s and len(frames) < FIRST_SAMPLES:
            self._held, self._numbers = table, frames
            return table[:, :0], None
        if not self._period_s and not self._begin(
            table[row, :FIRST_SAMPLES], frames[:FIRST_SAMPLES]
        ):
            self._plain = SampleClock()
            return self._plain.add(table, row)
        tolerance_s = self._tolerance_s
        kept, times, done = self._follow(table[row].tolist(), frames.tolist())
        taken = table[:, kept]
        late = taken[row] - times
        late[late <= tolerance_s] = 0
        taken[row] = times
        rest, numbers = table[:, done:], frames[done:]
        if self.problem:
            self._plain = SampleClock()
            rest, rest_late = self._plain.add(rest, row)
        elif not self._period_s:  # the device's clock was set
            rest, rest_late = self.add(rest, row, numbers)
        else:
            self._held, self._numbers = (rest if len(numbers) else None), numbers
            return taken, late if late.any() else None
        late = np.concatenate((late, np.zeros(rest.shape[1]) if rest_late is None else rest_late))
        return np.concatenate((taken, rest), axis=1), late if late.any() else None

    def finish(self) -> Floats | None:
        """Return the samples that are still held back, with the times that they have.

        They may be added again without their numbers, which the clock retains.
        """
        if self._plain is not None:
            return self._plain.finish()
        held, self._held = self._held, None
        return held

    def _start_over(self) -> None:
        self._period_s = 0.0  # of a number; 0 while it is not known
        self._tolerance_s = 0.0
        self._step = 1.0  # of the numbers from sample to sample
        self._base = (0.0, 0.0)  # a number and its time
        self._block: list[tuple[float, float]] = []  # numbers and stamps of samples in time
        self._blocks: deque[tuple[float, float]] = deque(maxlen=BLOCKS)
        self._newest = Newest()

    def _begin(self, stamps: Floats, frames: Floats) -> bool:
        """Find the line of the first samples; return whether there is one."""
        steps = np.diff(frames)
        usual = float(np.sort(steps)[len(steps) // 2])
        period_s = _find_pace(stamps, frames)
        if not np.isfinite(frames).all():
            self._ignore("some are missing")
        elif (frames % 1 != 0).any():
            self._ignore("they are not whole")
        elif usual <= 0:
            self._ignore("they stay as they are, or run backwards")
        elif not ((steps > 0) & (steps % usual == 0)).mean() >= USUAL:
            self._ignore("they do not count on from sample to sample")
        elif not period_s > 0:
            self._ignore("the stamps beside them do not go on")
        else:
            self._step, self._period_s = usual, period_s
            behind = stamps - period_s * (frames - frames[0])
            first_s = float(np.median(behind))
            self._base = float(frames[0]), first_s
            spread_s = float(np.median(np.abs(behind - first_s)))
            self._tolerance_s = max(
                LATE_PERIODS * usual * period_s, LATE_STAMP_S, SPREAD * spread_s
            )
        return not self.problem

    def _follow(self, stamps: list[float], frames: list[float]) -> tuple[list[int], Floats, int]:
        """Return which samples are known, their times, and from which one on they are not."""
        kept: list[int] = []
        times: list[float] = []
        late, first, before = 0, 0, self._newest  # of the newest samples; and what was before them
        for place, (stamp_s, frame) in enumerate(zip(stamps, frames, strict=True)):
            newest = self._newest
            if stamp_s < newest.stamp_s and (
                frame + newest.shift > newest.number or stamp_s < newest.stamp_s - UNDECIDED_S
            ):
                self._start_over()  # the device's clock was set
                return kept, np.array(times), place
            found = self._read(frame, stamp_s)
            if found is None:  # it came before
                continue
            if not late:
                first, before = place, newest
            self._newest = found
            kept.append(place)
            times.append(found.time_s)
            if stamp_s <= found.time_s + self._tolerance_s:
                late = 0
                self._extend(found.number, stamp_s)
            else:
                late += 1
                if stamp_s - stamps[first] > UNDECIDED_S:
                    self._ignore("they go on where samples are lost")
            if self.problem:
                stamps = stamps[: place + 1]
                break
        if not late:
            return kept, np.array(times), len(stamps)
        self._newest = before
        return kept[:-late], np.array(times[:-late]), first

    def _read(self, frame: float, stamp_s: float) -> Newest | None:
        """Return a sample's number and time, None if it came before."""
        last, step_s = self._newest, self._step * self._period_s
        number, shift = frame + last.shift, last.shift
        if number <= last.number and stamp_s <= last.stamp_s:
            return None
        time_s = self._find_time(number)
        if not math.isfinite(last.number):
            return Newest(number, stamp_s, time_s)
        is_missing = not math.isfinite(number) or frame % 1 != 0
        if is_missing or number <= last.number or stamp_s < time_s - self._tolerance_s:
            # The count began anew, or ran ahead: it goes on by the stamps.
            passed = max(1, round((stamp_s - self._find_time(last.number)) / step_s))
            number = last.number + passed * self._step
            time_s = self._find_time(number)
            if not is_missing:
                shift = number - frame
                self._note_restart(stamp_s)
        if frame % 1 > 0:
            self._ignore("they are not whole")
        return Newest(number, stamp_s, max(time_s, last.time_s + step_s / 10), shift)

    def _find_time(self, number: float) -> float:
        return self._base[1] + self._period_s * (number - self._base[0])

    def _note_restart(self, stamp_s: float) -> None:
        """Note when the count began anew, and ignore it if it does so again and again."""
        if stamp_s not in self._restarts:
            self._restarts.append(stamp_s)
        if len(self._restarts) == RESTARTS and stamp_s - self._restarts[0] < RESTARTS_S:
            self._ignore(f"they began anew {RESTARTS} times within a minute")

    def _extend(self, number: float, stamp_s: float) -> None:
        """Draw the line anew with each block of samples."""
        self._block.append((number, stamp_s))
        if len(self._block) < BLOCK:
            return
        at, taken_s = np.mean(self._block, axis=0).tolist()
        self._block = []
        self._blocks.append((at, taken_s))
        self._base = at, taken_s
        first = self._blocks[0]
        if len(self._blocks) > 1:
            self._period_s = (taken_s - first[1]) / (at - first[0])

    def _ignore(self, why: str) -> None:
        self.problem = IGNORED.format(why)
