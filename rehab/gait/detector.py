"""What detectors of one and of both legs share: settings, the sample clock, the buffer."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from rehab.gait.contacts.force_plate import CONTACT_N, RELEASE_N
from rehab.gait.one_leg import KEEP_S, LONGEST_CHUNK_S, LegDetector
from rehab.gait.settings import DetectorSettings
from rehab.gait.signals.buffer import SampleBuffer
from rehab.gait.signals.clock import SampleClock
from rehab.gait.signals.filters import Floats
from rehab.gait.signals.frames import FrameClock, read_frames
from rehab.gait.stances.kinetics import CUTOFF_HZ
from rehab.gait.strides import Stride


class Detector:
    """Detects strides in chunks of samples of any length.

    A stride is complete at its terminal contact, or ``look_ahead_s`` later; its values do not
    depend on how the samples were cut into chunks, bit for bit. Memory does not grow. The detector
    goes on after any samples; strides that cannot be trusted carry reasons. Samples that come late
    are put back to when they were taken, and lost ones are found (``signals.clock``).

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
        self._rows = 0  # of the last table
        self._longest_chunk = int(LONGEST_CHUNK_S * rate_hz)
        self._legs = [
            LegDetector(buffer, settings, side)
            for buffer, side in zip(self._samples.legs, sides, strict=True)
        ]

    def finish(self) -> list[Stride]:
        """Return the strides that still wait for samples.

        Stances that the end of the samples cuts off are among them, invalid.
        """
        held = self._clock.finish()
        strides = [] if held is None else self._advance(held, None)
        return strides + self._complete_last()

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
        if frame is not None and not self._samples.end and not isinstance(self._clock, FrameClock):
            self._clock = FrameClock()
        layout, clock = self._layout, self._clock
        table = layout.read(names, channels)
        given = table.shape[1]
        row = layout.time_rows[len(table)]
        if len(table) != self._rows:  # other channels are sent than were before
            self._rows, held = len(table), clock.finish()
            if held is not None:
                table = np.concatenate((layout.widen(held), layout.widen(table)), axis=1)
                row = layout.time_rows[len(table)]
        if isinstance(clock, FrameClock):
            return self._advance(*clock.add(table, row, read_frames(frame, given)))
        return self._advance(*clock.add(table, row))

    def _advance(self, table: Floats, late_s: Floats | None) -> list[Stride]:
        samples, longest = self._samples, self._longest_chunk
        first, count = samples.end, table.shape[1]
        if count <= longest:
            samples.append(table, late_s)
            for leg in self._legs:
                if leg.pending or not leg.contacts.is_quiet(first, samples.end):
                    return self._detect(first, samples.end)
            return []
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
