"""The clock that a played source runs by."""

from __future__ import annotations

from collections.abc import Callable


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
