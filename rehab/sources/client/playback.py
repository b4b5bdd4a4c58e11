"""Plays strides in time, or as fast as they are acknowledged; knows no sockets and never waits."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from typing import NamedTuple

from rehab.training.measures import A2
from rehab.training.phases import Phase, make_phase
from rehab.training.steps import Measurement, Side
from robot.wire.limits import MAX_STEPS


class Display(NamedTuple):
    """What a stride is walked with: phase, goal (None if unknown), feedback type, measure."""

    phase: Phase
    goal: float | None
    valence: str
    measure: str = A2.slug


# Returns the next stride, walked with that; None at the end.
NextStride = Callable[[Display], Measurement | None]

# No stride is shorter (docs/reference/gait.md#plausible-strides): there is time for the server to
# announce a new phase.
STRIDE_MIN_S = 0.5
# Without a connection a person may walk for hours (a whole day takes 80,000 strides).
UNSENT_MAX = 80_000


class PlaybackClock:
    """Source time [s] that runs ``speed`` times as fast as ours and can be paused.

    With ``speed`` None strides come as fast as they are sent: nothing is waited for, and the clock
    shows what it was last set to.
    """

    def __init__(self, speed: float | None, monotonic: Callable[[], float]) -> None:
        self.speed = speed
        self._monotonic = monotonic
        self._time_s = 0.0  # what it showed when it was last set, started or stopped
        self._since_s: float | None = None  # our clock then; None while it is paused

    @property
    def is_running(self) -> bool:
        """Whether it runs."""
        return self._since_s is not None

    @property
    def now_s(self) -> float:
        """What it shows [s]."""
        if self._since_s is None or self.speed is None:
            return self._time_s
        return self._time_s + (self._monotonic() - self._since_s) * self.speed

    def set(self, time_s: float) -> None:
        """Set the time it shows, whether it runs or not."""
        self._time_s = time_s
        if self._since_s is not None:
            self._since_s = self._monotonic()

    def start(self) -> None:
        """Start it, or go on."""
        if self._since_s is None:
            self._since_s = self._monotonic()

    def pause(self) -> None:
        """Pause it at what it shows."""
        self._time_s, self._since_s = self.now_s, None

    def wait_s(self, time_s: float) -> float:
        """Return how long a running clock takes to show that time, in our seconds."""
        return 0.0 if self.speed is None else max(0.0, (time_s - self.now_s) / self.speed)


class StridePlayback:
    """Decides which stride is due, or how long none will be.

    Parameters
    ----------
    open_walk
        Returns the strides of a session that trains a leg.
    speed
        1 for true cadence; None for as fast as the server acknowledges.
    max_unacknowledged
        How many strides may be unacknowledged before the next is played, where ``speed`` is None.
    monotonic
        Our clock [s].
    resumes
        Whether to skip the strides that the session has already.

    Attributes
    ----------
    phase, goal, valence, measure
        What the next stride is walked with: ``Display``.
    """

    clock_pauses = True  # with the session

    def __init__(
        self,
        open_walk: Callable[[Side], NextStride],
        speed: float | None = 1.0,
        max_unacknowledged: int = MAX_STEPS,
        monotonic: Callable[[], float] = time.monotonic,
        *,
        resumes: bool = False,
    ) -> None:
        self._resumes = resumes
        self.phase = make_phase("training")
        self.goal: float | None = None
        self.valence = "positive"
        self.measure = A2.slug
        self._open_walk = open_walk
        self._clock = PlaybackClock(speed, monotonic)
        self._max_unacknowledged = max_unacknowledged
        self._walk: NextStride | None = None
        self._stride: Measurement | None = None  # begun, not yet due
        self._last_s: float | None = None  # when the last one was, on the source's clock
        self._may_walk = False

    @property
    def _display(self) -> Display:
        return Display(self.phase, self.goal, self.valence, self.measure)

    @property
    def speed(self) -> float | None:
        """How fast its clock runs; None for as fast as possible."""
        return self._clock.speed

    @property
    def clock_s(self) -> float | None:
        """What its clock shows [s]; None while paused, and where strides wait for no clock."""
        return self._clock.now_s if self._clock.is_running and self.speed is not None else None

    @property
    def is_over(self) -> bool:
        """Whether the last stride has been played."""
        return self._walk is None and self._stride is None

    def start_session(self, trained_side: Side, walked: int = 0) -> None:
        """Begin another walk, paused. ``walked`` strides are in its session already."""
        self.pause()
        self._walk = self._open_walk(trained_side)
        for _ in range(walked if self._resumes else 0):
            self._walk(self._display)
        self._stride = self._last_s = None

    def end_session(self) -> None:
        """End the walk."""
        self.pause()
        self._walk = self._stride = None

    def resume(self) -> None:
        """Start to play, or go on."""
        self._may_walk = True
        if self._stride is not None or self._last_s is not None:
            self._clock.start()

    def pause(self) -> None:
        """Pause, with the clock."""
        self._may_walk = False
        self._clock.pause()

    def poll(self, unacknowledged: int) -> Measurement | float:
        """Return the stride that is due, or how long none will be [s], infinity if unknown.

        ``unacknowledged`` strides are with the caller.
        """
        limit = self._max_unacknowledged if self.speed is None else UNSENT_MAX
        if not self._may_walk or unacknowledged >= limit:
            return math.inf
        if self._stride is None and self._walk is not None:
            # The last stride may have ended the phase, which the server announces no later than its
            # ack: the next stride is not begun before that, unless it takes too long.
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

    def _begin_stride(self, walk: NextStride) -> None:
        self._stride = walk(self._display)
        if self._stride is None:
            self._walk = None
        elif self._last_s is None:
            # The first one is due at once, whatever its clock shows.
            self._clock.set(self._stride.time_s)
            self._clock.start()
