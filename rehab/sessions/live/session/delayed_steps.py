"""Distinguishes steps that arrive in time from delayed ones."""

from __future__ import annotations

from robot.wire.remote_clock import RemoteClock


class SourceClock:
    """Relates the clock of one run of a source to ours; the session retains it over reconnections.

    A source's hello gives its clock and speed; what it then sends is as late as our clock has run
    on past the step's own time. Without a clock in hello the quickest step of the run so far stands
    for a fresh one. A source without a speed sends as fast as it can: nothing of it is late.

    Parameters
    ----------
    clock_pauses
        Whether the source's clock stands while its session is paused, as that of a recording does.
        A sensor's runs on.
    """

    def __init__(
        self,
        run: str,
        now_s: float,
        clock_s: float | None,
        speed: float | None,
        *,
        clock_pauses: bool = False,
    ) -> None:
        self.run = run
        self.clock_pauses = clock_pauses
        self._clock = None if speed is None else RemoteClock(speed, clock_s, now_s)

    @property
    def is_known(self) -> bool:
        """Whether anything is known of the source's clock."""
        return self._clock is not None and self._clock.is_known

    def resume(self) -> None:
        """Begin anew with the next step, if the clock stood while the session was paused.

        For how long it stood shows only that step: the source hears of pause and resumption late,
        and perhaps on another connection.
        """
        if self._clock is not None and self.clock_pauses:
            self._clock.forget()

    def is_late(self, time_s: float, now_s: float) -> bool:
        """Return whether a step of this source time, arriving now, is too late to be shown."""
        return self._clock is not None and self._clock.observe(time_s, now_s)
