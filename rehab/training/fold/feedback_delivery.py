"""Which steps the patient of one session got feedback on, by its feedback schedule."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field

from rehab.training.schedules import FeedbackSummary, Schedule
from rehab.training.steps import ScoredStep

# Latest strides of which it is known whether they got feedback: as many as a page begins with.
REPORTED_MAX = 60


@dataclass(slots=True)
class FeedbackDelivery:
    """The feedback that was given, and the steps that still wait for it.

    Attributes
    ----------
    schedule
        After which steps the patient gets feedback.
    pending
        Judged steps since the last answer.
    answer
        The feedback that the last step brought; None where it brought none.
    answer_count
        How many answers there were.
    reported
        Numbers of the latest steps with feedback; unused where all have it.
    """

    schedule: Schedule
    pending: FeedbackSummary = field(default_factory=FeedbackSummary)
    answer: FeedbackSummary | None = None
    answer_count: int = 0
    reported: deque[int] = field(default_factory=lambda: deque(maxlen=REPORTED_MAX))

    def add(self, step: ScoredStep, judged: int) -> None:
        """Count a step, and give feedback where the schedule asks for it.

        Parameters
        ----------
        step
            The step; one without a verdict is not counted.
        judged
            How many steps of feedback phases were judged so far, this one included.
        """
        if step.performance is None or step.hit is None or step.shown is None:
            return
        points = step.points or 0
        self.pending.add(step.performance, step.shown, step.hit, step.close, points)
        if self.schedule.answers(judged, step.performance):
            self.answer, self.pending = self.pending, FeedbackSummary()
            self.answer_count += 1
            if not self.schedule.answers_all:
                self.reported.append(step.number)
