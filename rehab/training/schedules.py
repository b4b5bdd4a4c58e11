"""Feedback schedules: after which steps the patient gets feedback.

A schedule changes what is shown, never what is scored: each valid step is judged, paid and counted.
The PT sees everything, and the robot has rules of its own (``cueing``).
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

from rehab.training.measures import InvalidSetting
from robot.marking import gettext_noop

INTERVAL_MAX = 100


class ScheduleKind(StrEnum):
    """When the patient's page answers."""

    EVERY = gettext_noop("every")  # after each n-th step
    BANDWIDTH = gettext_noop("bandwidth")  # where the performance leaves a band about the goal
    FADED = gettext_noop("faded")  # after each step at first, then ever more rarely
    SUMMARY = gettext_noop("summary")  # after n steps, about all of them


@dataclass(frozen=True, slots=True)
class Schedule:
    """A feedback schedule, over the judged steps of phases with feedback.

    The words are those of motor learning: reduced frequency, bandwidth, faded, and summary
    knowledge of results (Winstein & Schmidt 1990, J Exp Psychol Learn Mem Cogn 16:677-691; Sherwood
    1988, Percept Mot Skills 66:535-542; Schmidt et al. 1989, J Exp Psychol Learn Mem Cogn
    15:352-359).

    Attributes
    ----------
    kind
        When the page answers.
    interval
        ``every`` and ``summary``: n. ``faded``: the longest interval that it comes to.
    band
        ``bandwidth``: half of the band about the goal without an answer (ratio).
    stage
        ``faded``: steps after which the interval grows by one.

    Raises
    ------
    InvalidSetting
        For values out of bounds.
    """

    kind: ScheduleKind = ScheduleKind.EVERY
    interval: int = 1
    band: float = 0.1
    stage: int = 50

    def __post_init__(self) -> None:
        if not 1 <= self.interval <= INTERVAL_MAX:
            raise InvalidSetting(
                "Feedback comes after 1 to {most} steps (1 for each).", most=INTERVAL_MAX
            )
        if self.kind is ScheduleKind.SUMMARY and self.interval < 2:
            raise InvalidSetting("A summary is about at least 2 steps.")
        if not 0 < self.band <= 0.5:
            raise InvalidSetting("A band without feedback is more than 0 and up to 50 % wide.")
        if not 1 <= self.stage <= 1000:
            raise InvalidSetting("Feedback becomes rarer after 1 to 1000 steps each time.")

    @property
    def answers_all(self) -> bool:
        """Whether each step is answered."""
        return self.kind is ScheduleKind.EVERY and self.interval == 1

    @property
    def essential(self) -> Schedule:
        """The schedule without what its kind does not use: those that do the same are equal."""
        if self.kind is ScheduleKind.BANDWIDTH:
            return Schedule(self.kind, band=self.band)
        if self.kind is ScheduleKind.FADED:
            return Schedule(self.kind, self.interval, stage=self.stage)
        return Schedule(self.kind, self.interval)

    def answers(self, count: int, performance: float) -> bool:
        """Return whether the page answers a step.

        Parameters
        ----------
        count
            Judged steps of phases with feedback so far, this one included.
        performance
            Of this step (ratio).
        """
        match self.kind:
            case ScheduleKind.EVERY | ScheduleKind.SUMMARY:
                return count % self.interval == 0
            case ScheduleKind.BANDWIDTH:
                return abs(performance - 1) > self.band
            case ScheduleKind.FADED:
                stage, place = divmod(count - 1, self.stage)
                return place % min(stage + 1, self.interval) == 0


def check_schedule_kind(kind: object) -> ScheduleKind:
    """Return the schedule of that name. Raises InvalidSetting, naming the known ones."""
    try:
        return ScheduleKind(kind)  # type: ignore[arg-type]  # any object may be looked up
    except ValueError:
        raise InvalidSetting(
            "A feedback schedule is one of: {known}.", known=", ".join(ScheduleKind)
        ) from None


@dataclass(slots=True)
class FeedbackSummary:
    """What one answer sums up: the judged steps since the answer before it.

    Attributes
    ----------
    steps, hits, performance_sum, shown_sum, close, points
        Of them; ``hits`` has none that was close, ``points`` are what each
        earned by the feedback type of its time.
    """

    steps: int = 0
    hits: int = 0
    performance_sum: float = 0.0
    shown_sum: float = 0.0
    close: int = 0
    points: int = 0

    def add(
        self, performance: float, shown: float, hit: bool, close: bool = False, points: int = 0
    ) -> None:
        """Count one more judged step.

        Parameters
        ----------
        performance, shown
            Its performance (ratio), and the value shown, in the measure's unit.
        hit, close
            Its verdict; a close step counts as close, not as a hit.
        points
            What it earned.
        """
        self.steps += 1
        self.hits += hit and not close
        self.close += close
        self.points += points
        self.performance_sum += performance
        self.shown_sum += shown

    @property
    def mean_performance(self) -> float:
        """Mean performance of the steps (ratio); 0 of none."""
        return self.performance_sum / self.steps if self.steps else 0.0

    @property
    def mean_shown(self) -> float:
        """Mean of what was shown, in the measure's unit; 0 of none."""
        return self.shown_sum / self.steps if self.steps else 0.0
