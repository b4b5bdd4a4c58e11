"""What the patient of one session has been told of the steps, by its feedback schedule."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field

from rehab.training.schedules import Schedule, Untold
from rehab.training.steps import ScoredStep

# Strides of which it is known whether the patient was told of them: as many as a page begins with.
KEPT_TOLD = 60


@dataclass(slots=True)
class Telling:
    """What was told, and what was not yet.

    Attributes
    ----------
    schedule
        After which steps the patient is told.
    untold
        What the patient does not know yet.
    answer
        What the last step told; None where it told nothing.
    told
        The latest steps that were told; unused where all are.
    """

    schedule: Schedule
    untold: Untold = field(default_factory=Untold)
    answer: Untold | None = None
    told: deque[int] = field(default_factory=lambda: deque(maxlen=KEPT_TOLD))

    def add(self, step: ScoredStep, judged: int) -> None:
        """Keep whether the schedule tells the patient of a step, and of which ones with it.

        ``judged``: how many steps were judged so far, this one included.
        """
        if step.performance is None or step.hit is None or step.shown is None:
            return
        points = step.points or 0
        self.untold.add(step.performance, step.shown, step.hit, step.close, points)
        if self.schedule.tells(judged, step.performance):
            self.answer, self.untold = self.untold, Untold()
            if not self.schedule.tells_all:
                self.told.append(step.number)
