"""Strides as they are measured: they cannot be asked for."""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Callable
from dataclasses import replace

from rehab.sources.client.playback import KEPT_MAX
from rehab.sources.client.step_queue import add_own_reason
from rehab.training.clocks import RemoteClock
from rehab.training.phases import make_phase
from rehab.training.steps import InvalidReason, Measurement, Side


class LiveFeed:
    """Takes strides from a source that measures, and hands them to ``SourceClient``.

    Strides of a session that runs are kept, whether or not the server can be reached. Those that
    are walked while it is paused are kept with that reason; those before it starts, and without a
    session, belong to none and are excluded.

    Attributes
    ----------
    phase
        The session's, as far as is known.
    trained_side
        The leg that the session trains, None before there was a session.
    excluded
        How many strides belonged to no session.
    on_change
        Called when there is something to send, or nothing more will come.
    """

    speed = 1.0

    def __init__(self, monotonic: Callable[[], float] = time.monotonic) -> None:
        self.phase = make_phase("training")
        self.trained_side: Side | None = None
        self.excluded = 0
        self.on_change: Callable[[], None] = lambda: None
        self._monotonic = monotonic
        self._waiting: deque[Measurement] = deque()
        self._is_open = False  # there is a session
        self._has_walked = False  # it has begun
        self._runs = False
        self._is_finished = False
        self._clock = RemoteClock()

    @property
    def clock_s(self) -> float | None:
        """What the source's clock shows now [s]; None before the first stride.

        From the stride with the shortest delay, so that a delayed one is known to be late.
        """
        return self._clock.read_s(self._monotonic())

    @property
    def is_running(self) -> bool:
        """Whether the session runs, as far as is known."""
        return self._runs

    @property
    def is_over(self) -> bool:
        """Whether the last stride has been handed over."""
        return self._is_finished and not self._waiting

    def start_session(self, trained_side: Side, walked: int = 0) -> None:
        """Join a session."""
        self.end_session()
        self.trained_side = trained_side
        self._is_open = True

    def end_session(self) -> None:
        """Leave the session."""
        self._waiting.clear()
        self._is_open = self._has_walked = self._runs = False

    def resume(self) -> None:
        """Note that the session runs."""
        self._has_walked = self._runs = True

    def pause(self) -> None:
        """Note that the session is paused, or has not begun."""
        self._runs = False

    def put(self, stride: Measurement) -> None:
        """Add a stride that was measured just now."""
        self._clock.observe(stride.time_s, self._monotonic())
        if not (self._is_open and self._has_walked) or len(self._waiting) >= KEPT_MAX:
            self.excluded += 1
            return
        if not self._runs:
            stride = replace(stride, reasons=add_own_reason(stride.reasons, InvalidReason.PAUSED))
        self._waiting.append(stride)
        self.on_change()

    def finish(self) -> None:
        """Note that no more strides will come."""
        self._is_finished = True
        self.on_change()

    def poll(self, unacknowledged: int) -> Measurement | float:
        """Return the next stride to send, or infinity while there is none."""
        if not self._waiting or unacknowledged >= KEPT_MAX:
            return math.inf
        return self._waiting.popleft()
