"""Walks strides in time, or as fast as they are taken; knows no sockets and never waits itself."""

from __future__ import annotations

import math
import time
from collections.abc import Callable

from rehab.sources.client.clock import SourceClock
from rehab.sources.client.outbox import WINDOW
from rehab.training.phases import Phase, make_phase
from rehab.training.steps import Measurement, Side

# Gives the next stride, walked in that phase; None at the end.
Walk = Callable[[Phase], Measurement | None]

# Nobody begins the next stride before this much of it has passed
# (docs/reference/gait.md#plausible-strides): there is time to hear of a new phase.
STRIDE_MIN_S = 0.5
# Out of reach of the server somebody may walk on for hours (a day of it takes 80,000 strides).
KEPT_MAX = 80_000


class Player:
    """Says which stride is due, and how long nothing is.

    ``open_walk`` begins a walk, given a session's trained leg. ``speed`` is 1 for true cadence,
    None for as fast as the server acknowledges; then at most ``ahead`` strides are unacknowledged.
    Told to stand still, it does, and so does its clock. ``phase`` is the one that the next stride
    is walked in. With ``resumes`` a walk goes on behind the strides that its session has already.
    """

    def __init__(
        self,
        open_walk: Callable[[Side], Walk],
        speed: float | None = 1.0,
        ahead: int = WINDOW,
        monotonic: Callable[[], float] = time.monotonic,
        *,
        resumes: bool = False,
    ) -> None:
        self._resumes = resumes
        self.phase = make_phase("training")
        self._open_walk = open_walk
        self._clock = SourceClock(speed, monotonic)
        self._ahead = ahead
        self._walk: Walk | None = None
        self._stride: Measurement | None = None  # begun, not yet due
        self._last_s: float | None = None  # when the last one was, on the source's clock
        self._may_walk = False

    @property
    def speed(self) -> float | None:
        """How fast its clock runs; None for as fast as possible."""
        return self._clock.speed

    @property
    def clock_s(self) -> float | None:
        """What its clock shows [s]; None while it stands, and where strides wait for no clock."""
        return self._clock.now_s if self._clock.is_running and self.speed is not None else None

    @property
    def is_over(self) -> bool:
        """Whether the last stride has been given."""
        return self._walk is None and self._stride is None

    def begin(self, trained_side: Side, walked: int = 0) -> None:
        """Take another walk, once told to. ``walked`` strides are in its session already."""
        self.stand()
        self._walk = self._open_walk(trained_side)
        for _ in range(walked if self._resumes else 0):
            self._walk(self.phase)
        self._stride = self._last_s = None

    def end(self) -> None:
        """Walk no more."""
        self.stand()
        self._walk = self._stride = None

    def walk(self) -> None:
        """Walk, or walk on."""
        self._may_walk = True
        if self._stride is not None or self._last_s is not None:
            self._clock.run()

    def stand(self) -> None:
        """Stand still."""
        self._may_walk = False
        self._clock.stand()

    def poll(self, unacknowledged: int) -> Measurement | float:
        """Give the stride that is due, or how long none will be [s], infinity for "who knows".

        ``unacknowledged`` strides are with the caller.
        """
        limit = self._ahead if self.speed is None else KEPT_MAX
        if not self._may_walk or unacknowledged >= limit:
            return math.inf
        if self._stride is None and self._walk is not None:
            # The last stride may have ended the phase. What the server knows of that comes no later
            # than its ack; the next stride is not begun without, unless it takes too long.
            if unacknowledged and self._last_s is not None:
                wait_s = self._clock.wait_s(self._last_s + STRIDE_MIN_S)
                if wait_s > 0:
                    return wait_s
            self._begin_stride(self._walk)
        stride = self._stride
        if stride is None:
            return math.inf
        wait_s = self._clock.wait_s(stride.time_s)
        if wait_s > 0:
            return wait_s
        self._stride, self._last_s = None, stride.time_s
        return stride

    def _begin_stride(self, walk: Walk) -> None:
        self._stride = walk(self.phase)
        if self._stride is None:
            self._walk = None
        elif self._last_s is None:
            # The first one is due at once, whatever its clock shows.
            self._clock.set(self._stride.time_s)
            self._clock.run()
