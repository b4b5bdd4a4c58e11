"""Why a gesture is refused, in words that pages translate."""

from __future__ import annotations


def gettext_noop(text: str) -> str:
    """Return the text, marked for translation by the server; a robot translates nothing."""
    return text


NOT_FINITE = gettext_noop("{part} {number} has a number that is not finite.")


class Marked(str):
    """A word within a message, translated separately."""

    __slots__ = ()


class BadGesture(ValueError):
    """A gesture that no base may perform; the message names the cure.

    The message is ``template`` with ``values`` filled in, so that pages can translate it.
    """

    def __init__(self, template: str, /, **values: object) -> None:
        super().__init__(template.format(**values) if values else template)
        self.template, self.values = template, values


class BadWaypoint(BadGesture):
    """A gesture with a bad waypoint: ``number`` says which, from 1."""

    def __init__(self, number: int, template: str, /, **values: object) -> None:
        super().__init__(template, part=Marked("Goal"), number=number, **values)
        self.number = number

    def for_step(self, number: int) -> BadGesture:
        """Return the error for the step that the waypoint belongs to."""
        return BadGesture(self.template, **self.values | {"part": Marked("Step"), "number": number})
