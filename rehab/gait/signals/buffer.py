"""The last seconds of samples, in constant memory."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from rehab.gait.signals.filters import Floats, find_maximum, find_minimum
from rehab.gait.signals.samples import TIME, ChannelLayout

USUAL_MOST_S = 0.25  # between two samples


class SampleBuffer:
    """The newest samples of one or two legs. Indices count samples since the start.

    Parameters
    ----------
    keep
        How many of the newest samples are certain to be there; no more may be appended at once.
    legs
        How many legs, one or two; ``legs`` of the buffer then are the views of each.
    """

    def __init__(self, keep: int, legs: int = 1) -> None:
        self.keep = keep
        self.end = 0
        self.first = 0  # the oldest sample that is still there
        self.filled = 0  # how many samples are there, with those that wait
        self.layout = ChannelLayout(legs)
        self._room, self._wide = 3 * keep, len(self.layout.order)
        table = np.full((self._wide, self._room), np.nan)
        middle = self.layout.time_rows[self._wide]
        tables = [table] if legs == 1 else [table[middle::-1], table[middle:]]
        self.legs = [LegBuffer(self, leg) for leg in tables]
        self._table = table
        self._parts = {rows: table[place] for rows, place in self.layout.rows.items()}
        self._has_seldom = False  # rows that were never sent stay NaN
        self._late = np.zeros(self._room)
        self._late_end = 0  # behind the newest sample that was late
        self._time: Floats = table[middle]
        self._judged = 0  # the times of samples before this one are looked at
        self._even_from = 0  # from this one on they go on, by USUAL_MOST_S at most

    @property
    def waiting(self) -> int:
        """How many samples were written that are not accepted yet."""
        return self.filled - (self.end - self.first)

    def write(self, rows: int, channels: Floats | Sequence[ArrayLike | None], count: int) -> None:
        """Write samples behind the newest ones, where they wait to be accepted or taken.

        Parameters
        ----------
        rows, channels
            The rows of a table as ``ChannelLayout.read`` returns it, shape (rows, count).
        count
            How many samples, up to ``keep``.

        Raises
        ------
        TypeError, ValueError
            For channels of another shape; none waits then.
        """
        if self.filled + count > self._room:
            self._make_room()
        begin = self.filled
        end = begin + count
        if rows == self._wide:
            self._has_seldom = True
        elif self._has_seldom:
            self._table[:, begin:end] = np.nan
        self._parts[rows][:, begin:end] = channels
        self.filled = end

    def waiting_times(self) -> Floats:
        """Return the times of the samples that wait, shape (n,), without copying."""
        return self._time[self.end - self.first : self.filled]

    def accept(self) -> None:
        """Append the samples that wait, none of which came late."""
        self.end = self.first + self.filled

    def take(self, rows: int) -> Floats:
        """Return the samples that wait, shape (rows, n), and let none wait any more."""
        begin = self.end - self.first
        table: Floats = self._parts[rows][:, begin : self.filled].copy()
        self.filled = begin
        return table

    def append(self, table: Floats, late_s: Floats | None = None) -> None:
        """Append samples, while no others wait to be accepted.

        Parameters
        ----------
        table
            Samples as ``ChannelLayout.read`` returns them, shape (rows, n), n up to ``keep``.
        late_s
            By how much each came late [s], shape (n,); None where none did.
        """
        rows, count = table.shape
        self.write(rows, table, count)
        self.accept()
        if late_s is not None:
            self._late[self.filled - count : self.filled] = late_s
            self._late_end = self.end

    def _make_room(self) -> None:
        """Move the samples still needed, and those that wait, to the front of the table."""
        end, waiting = self.end - self.first, self.waiting
        self._table[:, : self.keep + waiting] = self._table[:, end - self.keep : self.filled]
        self._late[: self.keep] = self._late[end - self.keep : end]
        self._late[self.keep :] = 0
        self.first = self.end - self.keep
        self.filled = self.keep + waiting

    def goes_on(self, start: int, stop: int, most_s: float = math.inf) -> bool:
        """Return whether time rises from each sample of ``start:stop`` to the next.

        Parameters
        ----------
        start, stop
            Indices of the first sample and of the one behind the last, which are still buffered.
        most_s
            By how much it may rise at most [s], ``USUAL_MOST_S`` (0.25) or more.
        """
        if stop > self._judged:
            if not self._steps_are(max(self._judged - 1, self.first), stop, USUAL_MOST_S):
                self._even_from = stop
            self._judged = stop
        return start >= self._even_from or self._steps_are(start, stop, most_s)

    def _steps_are(self, start: int, stop: int, most_s: float) -> bool:
        times = self._time[start - self.first : stop - self.first]
        steps_s = times[1:] - times[:-1]
        return not len(steps_s) or (find_minimum(steps_s) > 0 and find_maximum(steps_s) <= most_s)

    def find_lateness(self, start: int, stop: int) -> Floats | None:
        """Return by how much samples ``start:stop`` came late [s], None where none did."""
        if start >= self._late_end:
            return None
        late_s: Floats = self._late[start - self.first : stop - self.first]
        return late_s if late_s.any() else None


class LegBuffer:
    """One leg's channels in a ``SampleBuffer``."""

    def __init__(self, samples: SampleBuffer, table: Floats) -> None:
        self.samples = samples
        self._table: Floats = table
        self.rows: list[Floats] = list(table)  # of all samples, with those that wait

    def view(self, start: int, stop: int) -> Floats:
        """Return samples ``start:stop`` of all channels, shape (rows, samples), not copied."""
        first = self.samples.first
        part: Floats = self._table[:, start - first : stop - first]
        return part

    def channel(self, row: int, start: int, stop: int) -> Floats:
        """Return samples ``start:stop`` of one channel, without copying.

        Parameters
        ----------
        row
            The channel's row, such as ``FORCE``.
        start, stop
            Indices of the first sample and of the one behind the last, which are still buffered.
        """
        first = self.samples.first
        return self.rows[row][start - first : stop - first]

    def find_crossing(self, row: int, index: int, level: float) -> float:
        """Return when a channel crossed a level [s], by linear interpolation between two samples.

        Parameters
        ----------
        row
            The channel's row, such as ``FORCE``.
        index
            The first sample after the crossing.
        level
            In the channel's unit.

        Returns
        -------
        float
            The time of sample ``index`` itself where it is the first of all, or the one before is
            NaN or on the same side of the level.
        """
        if index == 0:
            return self.channel(TIME, 0, 1).item()
        t0, t1 = self.channel(TIME, index - 1, index + 1).tolist()
        v0, v1 = self.channel(row, index - 1, index + 1).tolist()
        share = (level - v0) / (v1 - v0) if v1 != v0 else 1.0
        crossed: float = t0 + share * (t1 - t0) if 0 <= share <= 1 else t1  # t1 beside NaN
        return crossed
