"""Pauses between attempts to connect."""

from __future__ import annotations

from collections.abc import Callable


class BackOff:
    """The pauses [s] between attempts: each twice as long as the one before, up to a longest.

    ``jitter`` returns numbers in [0, 1) and shortens a pause by up to half, so that a thousand
    clients of a server that restarts do not come back at once.
    """

    def __init__(self, first_s: float, longest_s: float, jitter: Callable[[], float]) -> None:
        self._first_s = self._pause_s = first_s
        self._longest_s = longest_s
        self._jitter = jitter

    def next_s(self) -> float:
        """Return the pause before the next attempt [s]."""
        pause_s = self._pause_s
        self._pause_s = min(2 * pause_s, self._longest_s)
        return pause_s * (1 - self._jitter() / 2)

    def reset(self) -> None:
        """Start again with the shortest pause."""
        self._pause_s = self._first_s
