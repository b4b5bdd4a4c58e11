"""Goals: what a step should reach, how often, for how long."""

from __future__ import annotations

import math
from dataclasses import dataclass

from rehab.training.measures import InvalidSetting, Measure, check_baseline_percent

# The lab's goal is the mean of the 54-55 usable baseline strides of a session
# (docs/reference/gait.md#protocol).
MIN_BASELINE_STRIDES = 50
# Of a trial, which shows how a goal comes about and trains nobody.
TRIAL_BASELINE_STRIDES = 5


@dataclass(frozen=True, slots=True)
class GoalRule:
    """Where a session's goal comes from: exactly one of a value and a percentage of the baseline.

    Attributes
    ----------
    value
        The goal, in the measure's unit.
    percent_of_baseline
        50 to 200 % of the mean baseline value.
    asks
        Whether the baseline goes on until the PT, who sees its mean, SD and number of strides,
        accepts the goal by going to the next phase.
    baseline_strides
        Valid strides that the baseline's mean needs.

    Raises
    ------
    InvalidSetting
        Where both or none are given, or the percentage is out of bounds.
    """

    value: float | None = None
    percent_of_baseline: float | None = None
    asks: bool = False
    baseline_strides: int = MIN_BASELINE_STRIDES

    def __post_init__(self) -> None:
        if (self.value is None) == (self.percent_of_baseline is None):
            raise InvalidSetting("Give a goal either as a value or as percent of baseline.")
        if self.percent_of_baseline is not None:
            check_baseline_percent(self.percent_of_baseline)

    @property
    def needs_baseline(self) -> bool:
        """Whether the goal is unknown until the baseline has been walked."""
        return self.value is None

    def resolve(self, measure: Measure, baseline_mean: float | None) -> float | None:
        """Return the goal in the measure's unit, None while the baseline is unknown.

        Parameters
        ----------
        measure
            What is trained.
        baseline_mean
            Mean of the valid baseline values, in its unit; None while unknown.

        Raises
        ------
        InvalidSetting
            For a goal outside the measure's bounds.
        """
        if self.percent_of_baseline is None:
            return None if self.value is None else measure.check_goal(self.value)
        if baseline_mean is None:
            return None
        return measure.check_goal(baseline_mean * self.percent_of_baseline / 100)


@dataclass(frozen=True, slots=True)
class Target:
    """The target of a whole session, set by the PT: "60 % of the steps, over ten minutes".

    Attributes
    ----------
    hit_rate
        Share of hits wanted, above 0 and up to 1; None for any.
    duration_s
        Active walking time wanted [s]; None for any.

    Raises
    ------
    InvalidSetting
        For values out of bounds.
    """

    hit_rate: float | None = None
    duration_s: float | None = None

    def __post_init__(self) -> None:
        if self.hit_rate is not None and not 0 < self.hit_rate <= 1:
            raise InvalidSetting(
                "The target hit rate is more than 0 and up to 100 % of steps (0.6 for 60 %)."
            )
        if self.duration_s is not None and not (
            math.isfinite(self.duration_s) and self.duration_s > 0
        ):
            raise InvalidSetting("The planned duration must be more than 0 seconds.")

    def is_met(self, hit_rate: float | None, active_s: float) -> bool | None:
        """Return whether the target is met; None where there is none.

        Parameters
        ----------
        hit_rate
            Of the session's feedback phases (ratio); None while unknown.
        active_s
            Walked time [s].
        """
        if self.hit_rate is None and self.duration_s is None:
            return None
        rate_met = self.hit_rate is None or (hit_rate is not None and hit_rate >= self.hit_rate)
        return rate_met and (self.duration_s is None or active_s >= self.duration_s)
