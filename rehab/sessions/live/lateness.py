"""Tells a fresh step from one that was held up on its way."""

from __future__ import annotations

# DESIGN.md section 4: a step later than this is stored and counted, but never shown as live.
LATE_S = 5.0


class Lateness:
    """Relates the clock of one run of a source to ours; kept with the session over reconnections.

    A source's hello gives its clock and speed; what it then sends is as late as our clock has run
    on past the step's own time. Without a clock in hello the quickest step of the run so far stands
    for a fresh one. A source without a speed sends as fast as it can: nothing of it is late.
    """

    def __init__(self, run: str, now_s: float, clock_s: float | None, speed: float | None) -> None:
        self.run = run
        self._speed = speed
        # The source's clock when ours shows 0, in the source's seconds; and when that was seen.
        self._offset = None if clock_s is None or speed is None else clock_s - now_s * speed
        self._seen_s = now_s

    @property
    def is_known(self) -> bool:
        """Whether anything is known of the source's clock."""
        return self._offset is not None

    def slacken(self, now_s: float) -> None:
        """Allow that the source's clock stood still, with a session that now goes on, for as long
        as nothing of it was heard. The next steps tell.
        """
        if self._offset is not None and self._speed is not None:
            self._offset -= (now_s - self._seen_s) * self._speed
            self._seen_s = now_s

    def is_late(self, time_s: float, now_s: float) -> bool:
        """Say whether a step of this source time, arriving now, is too late to be shown."""
        if self._speed is None:
            return False
        offset = time_s - now_s * self._speed
        late_s = 0.0 if self._offset is None else self._offset - offset
        if late_s <= 0:
            self._offset = offset
        is_late = late_s > LATE_S * max(1.0, self._speed)
        if not is_late:
            self._seen_s = now_s
        return is_late
