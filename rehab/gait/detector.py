"""What detectors of one and of both legs share: settings, the sample clock, the buffer."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import chain
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from rehab.gait.contacts.chunk_wait import ChunkWait
from rehab.gait.one_leg import KEEP_S, LONGEST_CHUNK_S, LegDetector
from rehab.gait.settings import DetectorSettings
from rehab.gait.signals.buffer import SampleBuffer
from rehab.gait.signals.clock import SampleClock
from rehab.gait.signals.filters import Floats
from rehab.gait.signals.frame_clock import FrameClock, read_frames
from rehab.gait.signals.samples import CHANNEL_NAMES, FORCE, LegSamples
from rehab.gait.strides import Stride

LONGEST_WAIT_S = 0.3  # of samples for others


class Detector:
    """Detects strides in chunks of samples of any length.

    A stride is complete at its terminal contact, or ``look_ahead_s`` later; its values do not
    depend on how the samples were cut into chunks, bit for bit. Memory does not grow. The detector
    goes on after any samples; strides that cannot be trusted carry reasons. Samples that come late
    are put back to when they were taken, and lost ones are found (``signals.clock``).

    Small chunks wait for others while no step can have ended in them, so that no valid stride waits
    (``contacts.chunk_wait``).

    Parameters
    ----------
    rate_hz, mass_kg, settings
        As in ``DetectorSettings``.
    sides
        The legs' names in each stride, in the order in which their channels are fed.

    Raises
    ------
    GaitInputError
        For settings that nothing can be measured with.
    """

    def __init__(
        self,
        rate_hz: float,
        mass_kg: float,
        *,
        sides: Sequence[str | None],
        **settings: Any,
    ) -> None:
        checked = DetectorSettings(rate_hz=rate_hz, mass_kg=mass_kg, **settings)
        self._is_overground = checked.is_overground
        self._sides = sides
        # Names of the channels, for messages.
        marks = [f"{side} " for side in sides] if len(sides) > 1 else [""]
        self._names = ("t_s", *(mark + name for mark in marks for name in CHANNEL_NAMES))
        self._clock: SampleClock | FrameClock = SampleClock()
        self._samples = SampleBuffer(int(KEEP_S * rate_hz), legs=len(sides))
        self._layout = self._samples.layout
        self._longest_chunk = int(LONGEST_CHUNK_S * rate_hz)
        self._rows = 0  # of the samples that wait
        self._numbers: list[Floats] = []  # and their frame numbers, where these are used
        self._longest_wait = int(LONGEST_WAIT_S * rate_hz)
        self._most_waiting = 0  # how many samples may wait
        # Both feet's forces, and for which of these samples may wait.
        self._feet: list[tuple[Floats, float, float, ChunkWait]] = []
        self._legs = [
            LegDetector(buffer, checked, side)
            for buffer, side in zip(self._samples.legs, sides, strict=True)
        ]

    def feed_legs(
        self,
        t_s: ArrayLike,
        legs: Mapping[str, LegSamples],
        *,
        frame: ArrayLike | None = None,
    ) -> list[Stride]:
        """Add the next samples of each leg that is measured; return the strides they complete.

        Parameters
        ----------
        t_s, frame
            As in ``StrideDetector.feed``.
        legs
            The channels of each leg by its side.

        Raises
        ------
        GaitInputError
            For channels of different lengths.
        """
        return self._feed(
            (t_s, *chain.from_iterable(legs[side or ""] for side in self._sides)), frame
        )

    def finish(self) -> list[Stride]:
        """Return the strides that still wait for samples.

        Stances that the end of the samples cuts off are among them, invalid.
        """
        return self._settle() + self._complete_last()

    @property
    def frame_problem(self) -> str:
        """Why frame numbers are ignored, with the cure; empty where they are used, or not fed."""
        return self._clock.problem if isinstance(self._clock, FrameClock) else ""

    def _feed(self, channels: Sequence[Any], frame: ArrayLike | None = None) -> list[Stride]:
        """Add samples: their times, then the channels of each leg."""
        strides: list[Stride] = []
        count = self._write(channels) if frame is None else 0
        if not count:
            strides, count = self._read(channels, frame)
            if not count:
                return strides
        samples = self._samples
        newest = samples.filled - 1
        waiting = samples.waiting
        if waiting <= self._most_waiting:
            for force, least_n, most_n, wait in self._feet:
                goes_on = least_n <= force.item(newest) <= most_n
                if not (goes_on or wait.lasts(waiting, force[newest + 1 - count : newest + 1])):
                    break
            else:
                return strides
        return strides + self._look()

    def _write(self, channels: Sequence[Any]) -> int:
        """Let samples wait and return how many, 0 for those that have to be read."""
        usual = self._layout.pick(channels)
        if usual is None or len(usual) != self._rows or isinstance(self._clock, FrameClock):
            return 0
        try:
            count = len(channels[0])
            if count > self._longest_chunk:
                return 0
            self._samples.write(self._rows, usual, count)
        except (TypeError, ValueError):  # of different lengths, as a rule
            return 0
        return count

    def _read(self, channels: Sequence[Any], frame: ArrayLike | None) -> tuple[list[Stride], int]:
        """Read any samples; return strides that end, and how many samples wait now."""
        table = self._layout.read(self._names, channels)
        count = table.shape[1]
        numbers = None if frame is None else read_frames(frame, count)
        if not count:
            return [], 0
        strides: list[Stride] = []
        if numbers is not None and not isinstance(self._clock, FrameClock):
            strides = self._begin_to_count(numbers)
        if len(table) != self._rows:  # other channels are sent than were before
            ended, table = self._change_rows(table)
            strides += ended
        is_long = table.shape[1] > self._longest_chunk
        if is_long:
            strides += self._look()
        if isinstance(self._clock, FrameClock):
            self._numbers.append(read_frames(None, count) if numbers is None else numbers)
        if is_long:
            return strides + self._place(table), 0
        self._samples.write(self._rows, table, table.shape[1])
        return strides, count

    def _change_rows(self, table: Floats) -> tuple[list[Stride], Floats]:
        """Return the strides of the samples that wait, and a table with the rows that are used now.

        Samples that the clock holds back go before it, with NaN where they have no values.
        """
        strides, held = self._look(), self._clock.finish()
        self._most_waiting = 0
        if held is not None:
            widen = self._layout.widen
            table = np.concatenate((widen(held), widen(table)), axis=1)
        self._rows = len(table)
        return strides, table

    def _begin_to_count(self, numbers: Floats) -> list[Stride]:
        """Use frame numbers from the next sample on; return the strides until then.

        In the middle of a walk, the first chunk with a number for each sample begins their use.
        """
        is_first = not (self._samples.filled or self._clock.is_holding)
        if not is_first and not np.isfinite(numbers).all():
            return []
        strides = self._settle()
        self._clock, self._most_waiting = FrameClock(), 0
        return strides

    def _settle(self) -> list[Stride]:
        """Return the strides of all samples that wait or are held back."""
        strides, held = self._look(), self._clock.finish()
        return strides if held is None else strides + self._advance(held, None)

    def _look(self) -> list[Stride]:
        """Return the strides that end in the samples that wait."""
        samples, clock, start = self._samples, self._clock, self._samples.end
        if not samples.waiting:
            return []
        is_even = (
            isinstance(clock, SampleClock)
            and samples.waiting <= self._longest_chunk
            and clock.follow(samples.waiting_times())
        )
        if not is_even:
            return self._place(samples.take(self._rows))
        samples.accept()
        strides = self._detect(start, samples.end)
        self._find_wait()
        return strides

    def _place(self, table: Floats) -> list[Stride]:
        """Return the strides that end in samples, once these are put to when they were taken."""
        row, clock = self._layout.time_rows[len(table)], self._clock
        if isinstance(clock, FrameClock):
            numbers, self._numbers = np.concatenate(self._numbers), []
            strides = self._advance(*clock.add(table, row, numbers))
        else:
            strides = self._advance(*clock.add(table, row))
        self._find_wait()
        return strides

    def _find_wait(self) -> None:
        """Find how many samples may wait, and for which force under each foot."""
        is_busy = self._clock.is_holding
        self._feet = []
        for leg in self._legs:
            is_busy = is_busy or bool(leg.pending)
            wait = leg.contacts.find_wait(self._samples.end)
            force = leg.buffer.rows[FORCE]
            self._feet.append((force, wait.least_n, wait.most_n, wait))
        self._most_waiting = 0 if is_busy else self._longest_wait

    def _advance(self, table: Floats, late_s: Floats | None) -> list[Stride]:
        samples, longest = self._samples, self._longest_chunk
        first, count = samples.end, table.shape[1]
        if count <= longest:
            samples.append(table, late_s)
            return self._detect(first, samples.end) if count else []
        strides: list[Stride] = []
        for done in range(0, count, longest):
            part = slice(done, done + longest)
            samples.append(table[:, part], None if late_s is None else late_s[part])
            strides += self._detect(first + done, samples.end)
        return strides

    def _detect(self, start: int, stop: int) -> list[Stride]:
        """Return the strides that the buffered samples ``start:stop`` complete."""
        raise NotImplementedError

    def _complete_last(self) -> list[Stride]:
        """Return the strides that wait for samples which will not come."""
        raise NotImplementedError
