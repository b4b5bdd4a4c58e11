"""Why a gesture is refused, in words that pages translate."""

from __future__ import annotations


def gettext_noop(text: str) -> str:
    """Mark a label: pages say it in their language; the robot's computer knows but one."""
    return text


NOT_FINITE = gettext_noop("{part} {number} has a number that is not finite.")


class Marked(str):
    """A word that has a translation, as it stands in a sentence."""

    __slots__ = ()


class BadGesture(ValueError):
    """A gesture that a base could not perform; the message says what would be one.

    It is ``template`` with ``values`` in its places: whoever shows it says it in another language.
    """

    def __init__(self, template: str, /, **values: object) -> None:
        super().__init__(template.format(**values) if values else template)
        self.template, self.values = template, values


class BadWaypoint(BadGesture):
    """A gesture of which one waypoint is at fault: ``number`` says which."""

    def __init__(self, number: int, template: str, /, **values: object) -> None:
        super().__init__(template, part=Marked("Goal"), number=number, **values)
        self.number = number

    def of_step(self, number: int) -> BadGesture:
        """Say it of the step that the waypoint belongs to."""
        return BadGesture(self.template, **self.values | {"part": Marked("Step"), "number": number})
