"""The last seconds of samples, in memory that never grows."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from rehab.gait.filters import Floats
from rehab.gait.strides import GaitInputError

TIME, FORCE, MOMENT, ANGLE, FORWARD, POSITION = range(6)
NAMES = ("t_s", "force_n", "moment_nm", "angle_rad", "forward_n", "position_m")


def read_chunk(*channels: ArrayLike | None) -> list[Floats | None]:
    """Give the channels as float arrays of one length; a single number is one sample.

    Raises GaitInputError for channels of different lengths or with more than one dimension.
    """
    chunk = [None if values is None else np.asarray(values, np.float64) for values in channels]
    shapes = [array.shape for array in chunk if array is not None]
    if shapes.count(shapes[0]) == len(shapes) and len(shapes[0]) == 1:
        return chunk
    named = {name: a for name, a in zip(NAMES, chunk, strict=False) if a is not None}
    if not any(shapes):
        return [None if array is None else array.reshape(1) for array in chunk]
    for name, array in named.items():
        if array.ndim != 1:
            raise GaitInputError(
                f"{name} has {array.ndim} dimensions. Feed one leg's samples as a flat array."
            )
    lengths = ", ".join(f"{name} {len(array)}" for name, array in named.items())
    raise GaitInputError(
        f"The channels have different numbers of samples: {lengths}. Feed as many of each; put NaN "
        "where a channel has none."
    )


class SampleBuffer:
    """The newest samples of six channels. Indices count samples since the start.

    Parameters
    ----------
    keep
        How many samples are certain to be there still; no more than these may be appended at once.
    """

    def __init__(self, keep: int) -> None:
        self.keep = keep
        self.end = 0
        self._first = 0
        self._table = np.full((len(NAMES), 3 * keep), np.nan)
        self._rows = list(self._table)
        self._sent = [True, True, True, True, False, False]  # what is not, stays NaN

    def append(self, chunk: Sequence[Floats | None], start: int, stop: int) -> None:
        """Take samples ``start:stop`` of each channel of a chunk."""
        begin = self.end - self._first
        end = begin + stop - start
        if end > self._table.shape[1]:
            self._table[:, : self.keep] = self._table[:, begin - self.keep : begin]
            self._first = self.end - self.keep
            begin, end = self.keep, self.keep + stop - start
        for row, values in enumerate(chunk):
            if values is not None:
                self._rows[row][begin:end] = values[start:stop]
                self._sent[row] = True
            elif self._sent[row]:
                self._rows[row][begin:end] = np.nan
        self.end += stop - start

    def view(self, start: int, stop: int) -> Floats:
        """Give samples ``start:stop`` of all channels, shape (6, samples), without copying."""
        return self._table[:, start - self._first : stop - self._first]

    def channel(self, row: int, start: int, stop: int) -> Floats:
        """Give samples ``start:stop`` of one channel, without copying."""
        return self._rows[row][start - self._first : stop - self._first]
