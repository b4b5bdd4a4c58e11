"""Channels that come at different rates, resampled at the times of the force."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from rehab.gait.recordings.column_mapping import find_required

Floats = NDArray[np.float64]
Channel = tuple[str, str]  # side, and one of rehab.gait.recordings.column_mapping.ALL_CHANNELS
Samples = tuple[Floats, dict[Channel, Floats]]  # times, and as many values of each channel

FRAME: Channel = ("", "frame")  # the device's count of samples, of no leg
HOLD_S = 0.05  # the longest gap that is interpolated (docs/reference/gait.md#time-base)
WAIT_S = 0.3  # by our clock, for a channel that has fallen silent
KEEP_S = 60.0  # how long samples wait for those of other channels


class Alignment:
    """Aligns channels, so that every one has a value at every time.

    Rows that hold whole legs pass unchanged. As soon as some do not, channels are interpolated
    linearly at the times of the first force: a time is complete once all channels have come past
    it, or with NaN for those that have been silent for ``WAIT_S``. Where a channel has no samples
    within ``HOLD_S`` of each other, it is NaN. A clock that is set back starts over.
    """

    def __init__(self) -> None:
        self._tracks: dict[Channel, tuple[Floats, Floats]] = {}
        self._heard_s: dict[Channel, float] = {}
        self._grid: Channel | None = None
        self._collected_s = -np.inf

    def add(
        self,
        t_s: Floats,
        values: Mapping[Channel, Floats],
        there: Floats | None,
        delays_s: Sequence[float],
        now_s: float,
    ) -> list[Samples]:
        """Add rows and return the samples that are complete by now.

        Parameters
        ----------
        t_s
            Times [s], shape (n,).
        values
            Of each channel, shape (n,).
        there
            Whether each cell was sent at all, shape (n, channels), in the order of ``values``; None
            for all.
        delays_s
            By how much each channel is late, in the order of ``values``: it is put back [s].
        now_s
            Our clock [s].
        """
        is_passed = not self._tracks and (there is None or bool(there.all()))
        if is_passed and len(set(delays_s)) == 1 and _is_whole(tuple(values)):
            return [(t_s - delays_s[0] if delays_s[0] else t_s, dict(values))]
        if there is None:
            there = np.ones((len(t_s), len(values)))
        complete: list[Samples] = []
        for delay_s in dict.fromkeys(delays_s):
            own = [place for place, one in enumerate(delays_s) if one == delay_s]
            part = {c: v for p, (c, v) in enumerate(values.items()) if p in own}
            complete += self._add(t_s - delay_s if delay_s else t_s, part, there[:, own], now_s)
        return complete

    def _add(
        self, t_s: Floats, values: Mapping[Channel, Floats], there: Floats, now_s: float
    ) -> list[Samples]:
        if not self._tracks and there.all() and _is_whole(tuple(values)):
            return [(t_s, dict(values))]
        for place, (channel, column) in enumerate(values.items()):
            sent = there[:, place].astype(bool)
            if sent.any():
                self._append(channel, t_s[sent], column[sent])
                self._heard_s[channel] = now_s
        for side in {side for side, _ in self._tracks.keys() - {FRAME}}:
            for name in find_required([name for own, name in self._tracks if own == side]):
                self._tracks.setdefault((side, name), (np.empty(0), np.empty(0)))
                self._heard_s.setdefault((side, name), now_s)
        return self._collect(now_s)

    def _append(self, channel: Channel, t_s: Floats, column: Floats) -> None:
        times, known = self._tracks.get(channel, (np.empty(0), np.empty(0)))
        last_s = times[-1] if len(times) else -np.inf
        is_new = t_s != last_s  # a datagram that came twice
        t_s, column = t_s[is_new], column[is_new]
        if not len(t_s):
            return
        backwards = np.flatnonzero(np.diff(t_s) <= 0)
        if len(backwards) or not t_s[0] > last_s:
            begin = int(backwards[-1]) + 1 if len(backwards) else 0
            t_s, column = t_s[begin:], column[begin:]
            self._tracks = {one: (np.empty(0), np.empty(0)) for one in self._tracks}
            times, known = np.empty(0), np.empty(0)
            self._collected_s = -np.inf
        self._tracks[channel] = np.concatenate((times, t_s)), np.concatenate((known, column))
        if channel[1] == "force" and self._grid is None:
            self._grid = channel

    def _collect(self, now_s: float) -> list[Samples]:
        if self._grid is None:
            self._drop_before(-np.inf)
            return []
        grid, force = self._tracks[self._grid]
        if not len(grid):
            return []
        ends = {
            channel: times[-1] if len(times) else -np.inf
            for channel, (times, _) in self._tracks.items()
        }
        awaited = [end for one, end in ends.items() if now_s - self._heard_s[one] <= WAIT_S]
        ready_s = min(awaited, default=ends[self._grid])
        due = (grid > self._collected_s) & (grid <= ready_s)
        if not due.any():
            return []
        at_s = grid[due]
        values = {
            channel: force[due] if channel == self._grid else _interpolate(at_s, *track)
            for channel, track in self._tracks.items()
        }
        self._collected_s = float(at_s[-1])
        self._drop_before(self._collected_s)
        return [(at_s, values)]

    def _drop_before(self, time_s: float) -> None:
        """Drop the samples before the last one at or before that time."""
        for channel, (times, known) in self._tracks.items():
            begin = max(0, int(np.searchsorted(times, time_s, "right")) - 1)
            if len(times):
                begin = max(begin, int(np.searchsorted(times, times[-1] - KEEP_S)))
            self._tracks[channel] = times[begin:], known[begin:]


def _interpolate(at_s: Floats, times: Floats, known: Floats) -> Floats:
    """Return a channel's values at these times, NaN where there is nothing near on both sides."""
    if not len(times):
        return np.full(len(at_s), np.nan)
    after = np.searchsorted(times, at_s)
    inside = after < len(times)
    after = np.minimum(after, len(times) - 1)
    exact = times[after] == at_s
    before = np.maximum(after - 1, 0)
    near = (times[before] <= at_s) & (times[after] - times[before] <= HOLD_S)
    found = np.where(inside & (near | exact), np.interp(at_s, times, known), np.nan)
    return np.asarray(np.where(exact & inside, known[after], found))


@lru_cache(maxsize=64)
def _is_whole(channels: tuple[Channel, ...]) -> bool:
    sides = {side for side, _ in set(channels) - {FRAME}}
    legs = {side: [name for own, name in channels if own == side] for side in sides}
    return all(set(names) >= set(find_required(names)) for names in legs.values())
