"""Why a gesture is refused, in words that pages translate."""

from __future__ import annotations

from robot.marking import Marked, TranslatableError, gettext_noop

NOT_FINITE = gettext_noop("{part} {number} has a number that is not finite.")


class BadGesture(TranslatableError):
    """A gesture that no base may perform; the message names the cure."""


class BadWaypoint(BadGesture):
    """A gesture with a bad waypoint: ``number`` says which, from 1."""

    def __init__(self, number: int, template: str, /, **values: object) -> None:
        super().__init__(template, part=Marked("Goal"), number=number, **values)
        self.number = number

    def for_step(self, number: int) -> BadGesture:
        """Return the error for the step that the waypoint belongs to."""
        return BadGesture(self.template, **self.values | {"part": Marked("Step"), "number": number})
