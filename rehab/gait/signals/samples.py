"""The channels of a leg, and chunks of them as they are fed."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from rehab.gait.signals.filters import Floats
from rehab.gait.strides import GaitInputError

# Rows of a leg's table of samples.
TIME, FORCE, MOMENT, ANGLE, FORWARD, POSITION = range(6)
CHANNEL_NAMES = ("force_n", "moment_nm", "angle_rad", "forward_n", "position_m")


class LegSamples(NamedTuple):
    """One leg's channels of a chunk, shape (n,) each, as ``StrideDetector.feed`` takes them."""

    force_n: ArrayLike
    moment_nm: ArrayLike
    angle_rad: ArrayLike
    forward_n: ArrayLike | None = None
    position_m: ArrayLike | None = None


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


def split_chunk(chunk: list[Floats | None], longest: int) -> list[tuple[list[Floats | None], int]]:
    """Return a chunk in pieces of at most ``longest`` samples, each with its number of samples.

    The first channel must be there.
    """
    length = 0 if chunk[0] is None else len(chunk[0])
    if length <= longest:
        return [(chunk, length)]
    parts = [slice(start, start + longest) for start in range(0, length, longest)]
    return [
        (
            [None if values is None else values[part] for values in chunk],
            min(longest, length - part.start),
        )
        for part in parts
    ]
