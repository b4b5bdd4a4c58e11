"""The channels of a leg, and chunks of them as they are fed."""

from __future__ import annotations

from collections.abc import Sequence
from operator import itemgetter
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from rehab.gait.signals.filters import Floats
from rehab.gait.strides import GaitInputError

# Rows of a leg's table of samples.
TIME, FORCE, MOMENT, ANGLE, FORWARD, POSITION, FOOT_UP, HIP, HIP_UP, KNEE = range(10)
CHANNEL_NAMES = (
    *("force_n", "moment_nm", "angle_rad", "forward_n", "position_m"),
    *("foot_up_m", "hip_forward_m", "hip_up_m", "knee_angle_rad"),
)


class LegSamples(NamedTuple):
    """One leg's channels of a chunk, shape (n,) each, as ``StrideDetector.feed`` takes them."""

    force_n: ArrayLike
    moment_nm: ArrayLike
    angle_rad: ArrayLike
    forward_n: ArrayLike | None = None
    position_m: ArrayLike | None = None
    foot_up_m: ArrayLike | None = None
    hip_forward_m: ArrayLike | None = None
    hip_up_m: ArrayLike | None = None
    knee_angle_rad: ArrayLike | None = None


class ChannelLayout:
    """Where each channel of one or two legs lies in a table of samples, shape (rows, samples).

    Time lies between two legs, so that each has its rows side by side; rows that are seldom
    sent lie outside. A narrow table is one without them.

    Parameters
    ----------
    legs
        How many, one or two.
    """

    def __init__(self, legs: int) -> None:
        one = range(1, 1 + len(CHANNEL_NAMES))
        # Of what is fed, a time and then each leg's channels, in the order of the rows.
        self.order = (0, *one) if legs == 1 else (*reversed(one), 0, *(len(one) + n for n in one))
        self._narrow = tuple(
            n for n in self.order if n == 0 or (n - 1) % len(CHANNEL_NAMES) < ANGLE
        )
        self._seldom = tuple(n for n in self.order if n not in self._narrow)
        self._pick = itemgetter(*self._narrow)
        first = self.order.index(self._narrow[0])
        self.rows = {
            len(self.order): slice(0, len(self.order)),
            len(self._narrow): slice(first, first + len(self._narrow)),
        }
        self.time_rows = {rows: rows // 2 if legs == 2 else 0 for rows in self.rows}

    def pick(self, channels: Sequence[ArrayLike | None]) -> tuple[ArrayLike | None, ...] | None:
        """Return the channels of a narrow table in the order of its rows; None if more are sent."""
        for place in self._seldom:
            if channels[place] is not None:
                return None
        picked: tuple[ArrayLike | None, ...] = self._pick(channels)
        return picked

    def read(self, names: Sequence[str], channels: Sequence[ArrayLike | None]) -> Floats:
        """Return a chunk's channels as a table; a single number is one sample.

        Parameters
        ----------
        names
            What each channel is called in messages.
        channels
            A time, then each leg's channels, shape (n,) or numbers; None for one that is not sent.

        Returns
        -------
        A new array, narrow where nothing is sent that is seldom; else NaN where nothing is.

        Raises
        ------
        GaitInputError
            For channels of different lengths or with more than one dimension.
        """
        usual = self.pick(channels)
        if usual is not None:
            try:
                table: Floats = np.array(usual, np.float64)
            except (TypeError, ValueError):  # of different lengths, as a rule
                pass
            else:
                if table.ndim == 2:
                    return table
        chunk = read_chunk(names, channels)
        length = next(len(values) for values in chunk if values is not None)
        return np.array(
            [
                np.full(length, np.nan) if values is None else values
                for values in (chunk[place] for place in self.order)
            ]
        )

    def widen(self, table: Floats) -> Floats:
        """Return a table with all rows, NaN where it had none."""
        wide = np.full((len(self.order), table.shape[1]), np.nan)
        wide[self.rows[len(table)]] = table
        return wide


def read_chunk(names: Sequence[str], channels: Sequence[ArrayLike | None]) -> list[Floats | None]:
    """Return the channels as float arrays of one length; a single number is one sample.

    Parameters
    ----------
    names
        What each channel is called in messages.
    channels
        Arrays of shape (n,) or numbers; None for a channel that is not sent.

    Raises
    ------
    GaitInputError
        For channels of different lengths or with more than one dimension.
    """
    chunk = [None if values is None else np.asarray(values, np.float64) for values in channels]
    first = chunk[0]
    if first is not None and first.ndim == 1:
        shape = first.shape
        for array in chunk:
            if array is not None and array.shape != shape:
                break
        else:
            return chunk
    shapes = {array.shape for array in chunk if array is not None}
    if len(shapes) == 1 and len(*shapes) == 1:
        return chunk
    if shapes == {()}:
        return [None if array is None else array.reshape(1) for array in chunk]
    named = {name: a for name, a in zip(names, chunk, strict=True) if a is not None}
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
