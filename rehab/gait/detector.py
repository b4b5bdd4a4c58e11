"""What detectors of one and of both legs share: settings, the sample clock, the buffer."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from rehab.gait.contacts.force_plate import CONTACT_N, RELEASE_N
from rehab.gait.contacts.patience import Patience
from rehab.gait.one_leg import KEEP_S, LONGEST_CHUNK_S, LegDetector
from rehab.gait.settings import DetectorSettings
from rehab.gait.signals.buffer import SampleBuffer
from rehab.gait.signals.clock import SampleClock
from rehab.gait.signals.filters import Floats
from rehab.gait.signals.frames import FrameClock, read_frames
from rehab.gait.stances.kinetics import CUTOFF_HZ
from rehab.gait.strides import Stride

LONGEST_WAIT_S = 0.3  # of samples for others


class Detector:
    """Detects strides in chunks of samples of any length.

    A stride is complete at its terminal contact, or ``look_ahead_s`` later; its values do not
    depend on how the samples were cut into chunks, bit for bit. Memory does not grow. The detector
    goes on after any samples; strides that cannot be trusted carry reasons. Samples that come late
    are put back to when they were taken, and lost ones are found (``signals.clock``).

    Small chunks wait for others while no step can have ended in them, so that no valid stride waits
    (``contacts.patience``).

    Parameters
    ----------
    rate_hz
        Nominal rate of the samples, 50-5000 Hz. Times are measured by the samples' own times.
    mass_kg
        Body mass of the walker, 10-300 kg.
    look_ahead_s
        How long to wait after terminal contact, 0-0.2 s. 50 ms reduce the error of A2 from 1.0 to
        0.14 % (moore2013; the plain zero-phase filter has 1.8 and 0.5 %:
        docs/reference/gait.md#filters).
    cutoff_hz
        Cut-off of the zero-phase low-pass on moment and angle.
    contact_n, release_n
        Force above the plate's zero at which a contact is certain, and at which both of its ends
        are timed [N].
    is_velocity
        Whether ankle velocities [rad/s] are fed instead of angles (gyroscopes).
    is_overground
        Whether people walk over the plates, a step or two at a time, and not on a treadmill: then
        a stride needs no neighbors, and a foot has to bear its plate whole.
    sides
        The legs' names in each stride.

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
        look_ahead_s: float = 0.0,
        cutoff_hz: float = CUTOFF_HZ,
        contact_n: float = CONTACT_N,
        release_n: float = RELEASE_N,
        is_velocity: bool = False,
        is_overground: bool = False,
        sides: Sequence[str | None],
    ) -> None:
        settings = DetectorSettings(
            rate_hz=rate_hz,
            mass_kg=mass_kg,
            look_ahead_s=look_ahead_s,
            cutoff_hz=cutoff_hz,
            contact_n=contact_n,
            release_n=release_n,
            is_velocity=is_velocity,
            is_overground=is_overground,
        )
        self._is_overground = is_overground
        self._clock: SampleClock | FrameClock = SampleClock()
        self._samples = SampleBuffer(int(KEEP_S * rate_hz), legs=len(sides))
        self._layout = self._samples.layout
        self._longest_chunk = int(LONGEST_CHUNK_S * rate_hz)
        self._waiting: list[Floats] = []  # tables of the same rows that are not looked at yet
        self._numbers: list[Floats] = []  # and their frame numbers, where these are used
        self._count = self._rows = 0  # samples that wait, and rows of the newest table
        self._longest_wait = int(LONGEST_WAIT_S * rate_hz)
        self._patience = 0  # how many samples may wait
        # Rows of both feet's forces, and for which forces samples may wait.
        self._feet: list[tuple[int, float, float, Patience]] = []
        self._legs = [
            LegDetector(buffer, settings, side)
            for buffer, side in zip(self._samples.legs, sides, strict=True)
        ]

    def finish(self) -> list[Stride]:
        """Return the strides that still wait for samples.

        Stances that the end of the samples cuts off are among them, invalid.
        """
        return self._settle() + self._complete_last()

    @property
    def frame_problem(self) -> str:
        """Why frame numbers are ignored, with the cure; empty where they are used, or not fed."""
        return self._clock.problem if isinstance(self._clock, FrameClock) else ""

    def _feed(
        self,
        names: Sequence[str],
        channels: Sequence[ArrayLike | None],
        frame: ArrayLike | None = None,
    ) -> list[Stride]:
        """Add samples of the named channels, the first of which is the time."""
        table = self._layout.read(names, channels)
        rows, count = table.shape
        numbers = None if frame is None else read_frames(frame, count)
        if not count:
            return []
        strides: list[Stride] = []
        if rows != self._rows:  # other channels are sent than were before
            strides, table = self._change_rows(table)
        if numbers is not None and not isinstance(self._clock, FrameClock):
            strides += self._begin_to_count(numbers)
        if isinstance(self._clock, FrameClock):
            self._numbers.append(read_frames(None, count) if numbers is None else numbers)
        self._waiting.append(table)
        self._count += count
        if self._count <= self._patience:
            for row, least_n, most_n, patience in self._feet:
                goes_on = least_n <= table.item(row, -1) <= most_n
                if not (goes_on or patience.lasts(self._count, table[row])):
                    break
            else:
                return strides
        return strides + self._look()

    def _change_rows(self, table: Floats) -> tuple[list[Stride], Floats]:
        """Look at what waits, and return its strides and a table with the rows that are used now.

        Samples that the clock holds back go before it, with NaN where they have no values.
        """
        strides, held = self._look(), self._clock.finish()
        self._patience = 0
        if held is not None:
            self._waiting, table = [self._layout.widen(held)], self._layout.widen(table)
        self._rows = len(table)
        return strides, table

    def _begin_to_count(self, numbers: Floats) -> list[Stride]:
        """Use frame numbers from the next sample on; return the strides until then.

        In the middle of a walk they begin with a chunk that has all of them.
        """
        is_first = not (self._samples.end or self._waiting or self._clock.is_holding)
        if not is_first and not np.isfinite(numbers).all():
            return []
        strides = self._settle()
        self._clock, self._patience = FrameClock(), 0
        return strides

    def _settle(self) -> list[Stride]:
        """Return the strides of all samples that wait or are held back."""
        strides, held = self._look(), self._clock.finish()
        return strides if held is None else strides + self._advance(held, None)

    def _look(self) -> list[Stride]:
        """Return the strides that end in the samples that wait."""
        tables, self._waiting, self._count = self._waiting, [], 0
        if not tables:
            return []
        table = tables[0] if len(tables) == 1 else np.concatenate(tables, axis=1)
        row, clock = self._layout.time_rows[len(table)], self._clock
        if isinstance(clock, FrameClock):
            numbers, self._numbers = np.concatenate(self._numbers), []
            strides = self._advance(*clock.add(table, row, numbers))
        else:
            strides = self._advance(*clock.add(table, row))
        self._find_patience()
        return strides

    def _find_patience(self) -> None:
        """Find how many samples may wait, and for which force under each foot."""
        is_busy = self._clock.is_holding or any(leg.pending for leg in self._legs)
        self._patience = 0 if is_busy else self._longest_wait
        rows = self._layout.force_rows[self._rows]
        self._feet = []
        for row, leg in zip(rows, self._legs, strict=True):
            patience = leg.contacts.find_patience(self._samples.end)
            self._feet.append((row, patience.least_n, patience.most_n, patience))

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
