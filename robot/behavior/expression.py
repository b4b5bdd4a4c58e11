"""Shows and plays a gesture's score on a base, by the clock that its motion has."""

from __future__ import annotations

from collections import deque

from robot.bases import MobileBase
from robot.motion.lights_and_sounds import Color, Light, Note, Score


class Expression:
    """Plays one score at a time.

    Parameters
    ----------
    base
        The base with the lights and sounds, if it has any.

    Attributes
    ----------
    lights
        What the score shows now; None where it shows nothing.
    """

    def __init__(self, base: MobileBase) -> None:
        self._base = base
        self.lights: tuple[Color, Color] | None = None
        self._began_s = 0.0
        self._lights: deque[Light] = deque()
        self._notes: deque[Note] = deque()

    def start(self, score: Score, now_s: float) -> None:
        """Begin a score, in place of what is played.

        Parameters
        ----------
        score
            Its times count from now on.
        now_s
            The time [s].
        """
        self._began_s = now_s
        self._lights, self._notes = deque(score.lights), deque(score.notes)

    def stop(self) -> None:
        """Leave out the rest. The lights are the status's again."""
        self.lights = None
        self._lights.clear()
        self._notes.clear()

    def tick(self, now_s: float) -> None:
        """Show and play what is due; a base that hung plays the latest of it, not all at once."""
        light = note = None
        while self._lights and self._began_s + self._lights[0].at_s <= now_s:
            light = self._lights.popleft()
        while self._notes and self._began_s + self._notes[0].at_s <= now_s:
            note = self._notes.popleft()
        if light is not None:
            self.lights = light.first, light.second
            self._base.light(*self.lights)
        if note is not None:
            self._base.play(note)
