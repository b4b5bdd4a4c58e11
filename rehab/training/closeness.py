"""Close steps: the value is too uncertain to say on which side of the goal it lies."""

from __future__ import annotations

from dataclasses import dataclass

from rehab.training.measures import InvalidSetting
from robot.marking import gettext_noop

CLOSE_WORDS = gettext_noop("About at the goal.")
# Standard deviations from the middle of a 95 % interval to its ends, of normal errors.
COVERAGE = 1.96


@dataclass(frozen=True, slots=True)
class CloseSteps:
    """Which steps are shown as close: they neither earn nor cost points with any feedback type.

    A value comes with its standard deviation, and so with an interval that holds the true one 19
    times of 20. Where more than a set part of the interval lies on the other side of the goal, a
    verdict would often be wrong.

    Attributes
    ----------
    part
        That part of the interval (ratio): at 0 each step whose interval holds the goal is close, at
        0.5 none. None where no step is shown as close.
    words
        What the patient reads of one.

    Raises
    ------
    InvalidSetting
        For a part that is less than 0, or 0.5 and more.
    """

    part: float | None = None
    words: str = CLOSE_WORDS

    def __post_init__(self) -> None:
        if self.part is not None and not 0 <= self.part < 0.5:
            raise InvalidSetting(
                "A step is close from 0 to 49 % of its interval beyond the goal; leave it empty "
                "for none."
            )

    def includes(self, shown: float, sd: float | None, goal: float) -> bool:
        """Return whether a step is close.

        Parameters
        ----------
        shown, sd, goal
            What the patient sees, its standard deviation and the goal, in the measure's unit; None
            for a value that comes without a standard deviation.
        """
        if self.part is None or sd is None or not sd > 0:
            return False
        beyond = 0.5 - abs(shown - goal) / (2 * COVERAGE * sd)
        return beyond > self.part
