"""Strides of sources that measure: they come when they are walked."""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Callable
from dataclasses import replace

from rehab.sources.client.playback import UNSENT_MAX
from rehab.sources.client.step_queue import add_own_reason
from rehab.training.measures import A2
from rehab.training.phases import make_phase
from rehab.training.steps import InvalidReason, Measurement, Side
from robot.wire.remote_clock import RemoteClock


class LiveFeed:
    """Keeps the strides of a source that measures, until ``SourceClient`` sends them.

    Strides of a running session are kept, whether or not the server can be reached; those that are
    walked while it is paused get that reason; those before it starts, and without a session, are
    excluded.

    Attributes
    ----------
    phase, goal, valence, measure
        The session's phase, goal, feedback type and measure, as far as they are known.
    trained_side
        The leg that the session trains, None before there was a session.
    excluded
        How many strides belonged to no session.
    resumed
        How many times a person has let the session go on after a pause.
    refused
        How many were not kept because as many waited as can be kept.
    on_change
        Called when there is something to send, or nothing more will come.
    """

    speed = 1.0
    clock_pauses = False  # a sensor's runs on while the session is paused

    def __init__(self, monotonic: Callable[[], float] = time.monotonic) -> None:
        self.phase = make_phase("training")
        self.goal: float | None = None
        self.valence = "positive"
        self.measure = A2.slug
        self.trained_side: Side | None = None
        self.excluded = self.refused = self.resumed = 0
        self.on_change: Callable[[], None] = lambda: None
        self._monotonic = monotonic
        self._waiting: deque[Measurement] = deque()
        self._is_open = False  # there is a session
        self._has_started = False  # the session has
        self._is_running = False
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
        return self._is_running

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
        self._is_open = self._has_started = self._is_running = False

    def resume(self) -> None:
        """Note that the session runs."""
        self.resumed += self._has_started and not self._is_running
        self._has_started = self._is_running = True

    def pause(self) -> None:
        """Note that the session is paused, or has not begun."""
        self._is_running = False

    def put(self, stride: Measurement) -> None:
        """Add a stride that was measured just now."""
        self._clock.observe(stride.time_s, self._monotonic())
        if not (self._is_open and self._has_started):
            self.excluded += 1
            return
        if len(self._waiting) >= UNSENT_MAX:
            self.refused += 1
            return
        if not self._is_running:
            stride = replace(stride, reasons=add_own_reason(stride.reasons, InvalidReason.PAUSED))
        self._waiting.append(stride)
        self.on_change()

    def finish(self) -> None:
        """Note that no more strides will come."""
        self._is_finished = True
        self.on_change()

    def poll(self, unacknowledged: int) -> Measurement | float:
        """Return the next stride to send, or infinity while there is none."""
        if not self._waiting or unacknowledged >= UNSENT_MAX:
            return math.inf
        return self._waiting.popleft()
