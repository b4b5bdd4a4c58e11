"""The last seconds of samples, in constant memory."""

from __future__ import annotations

import numpy as np

from rehab.gait.signals.filters import Floats
from rehab.gait.signals.samples import TIME, ChannelLayout


class SampleBuffer:
    """The newest samples of one or two legs. Indices count samples since the start.

    Parameters
    ----------
    keep
        How many of the newest samples are certain to be kept; no more may be appended at once.
    legs
        How many legs, one or two; ``legs`` of the buffer then are the views of each.
    """

    def __init__(self, keep: int, legs: int = 1) -> None:
        self.keep = keep
        self.end = 0
        self.first = 0  # the oldest sample that is still there
        self.layout = ChannelLayout(legs)
        wide = len(self.layout.order)
        table = np.full((wide, 3 * keep), np.nan)
        middle = self.layout.time_rows[wide]
        tables = [table] if legs == 1 else [table[middle::-1], table[middle:]]
        self.legs = [LegBuffer(self, leg) for leg in tables]
        self._table = table
        self._parts = {rows: table[place] for rows, place in self.layout.rows.items()}
        self._has_seldom = False  # rows that were never sent stay NaN
        self._late = np.zeros(3 * keep)
        self._late_end = 0  # behind the newest sample that was late

    def append(self, table: Floats, late_s: Floats | None = None) -> None:
        """Append samples as ``ChannelLayout.read`` returns them, shape (rows, samples).

        ``late_s`` is by how much each came late, None where none did.
        """
        rows, count = table.shape
        begin = self.end - self.first
        end = begin + count
        if end > self._table.shape[1]:
            self._table[:, : self.keep] = self._table[:, begin - self.keep : begin]
            self._late[: self.keep] = self._late[begin - self.keep : begin]
            self._late[self.keep :] = 0
            self.first = self.end - self.keep
            begin, end = self.keep, self.keep + count
        if rows == len(self._table):
            self._has_seldom = True
        elif self._has_seldom:
            self._table[:, begin:end] = np.nan
        self._parts[rows][:, begin:end] = table
        self.end += count
        if late_s is not None:
            self._late[begin:end] = late_s
            self._late_end = self.end

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
        self._rows: list[Floats] = list(table)

    def view(self, start: int, stop: int) -> Floats:
        """Return samples ``start:stop`` of all channels, shape (6, samples), without copying."""
        first = self.samples.first
        part: Floats = self._table[:, start - first : stop - first]
        return part

    def channel(self, row: int, start: int, stop: int) -> Floats:
        """Return samples ``start:stop`` of one channel, shape (samples,), without copying."""
        first = self.samples.first
        return self._rows[row][start - first : stop - first]

    def find_crossing(self, row: int, index: int, level: float) -> float:
        """Return when a channel crossed a level between samples ``index - 1`` and ``index`` [s]."""
        if index == 0:
            return self.channel(TIME, 0, 1).item()
        t0, t1 = self.channel(TIME, index - 1, index + 1).tolist()
        v0, v1 = self.channel(row, index - 1, index + 1).tolist()
        share = (level - v0) / (v1 - v0) if v1 != v0 else 1.0
        crossed: float = t0 + share * (t1 - t0) if 0 <= share <= 1 else t1  # t1 beside NaN
        return crossed
