"""How the goal of one session follows the patient: suggested to the PT, or by the staircase."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field

from rehab.training.goal_adaptation import (
    DEFAULT_HIT_RATE,
    SUGGESTION_STRIDES,
    Staircase,
    suggest_goal,
)
from rehab.training.plans import SessionPlan
from rehab.training.steps import ScoredStep


@dataclass(slots=True)
class GoalFollowing:
    """The goal's rules, with the strides that they look back on.

    Attributes
    ----------
    plan
        The session's, with its measure, its target and how goals adapt.
    latest
        Their values.
    staircase
        The rule that moves the goal by itself, with the block that is under way.
    moved
        Whether the last step moved the goal.
    """

    plan: SessionPlan
    latest: deque[float] = field(default_factory=lambda: deque(maxlen=SUGGESTION_STRIDES))
    staircase: Staircase = field(default_factory=Staircase)
    moved: bool = False

    @property
    def wanted_hit_rate(self) -> float:
        """The share of hits that goals aim at (ratio)."""
        wanted = self.plan.target.hit_rate
        return DEFAULT_HIT_RATE if wanted is None else wanted

    def suggest(self, gain: float) -> float | None:
        """Return the goal that the latest strides would have reached as often as is wanted."""
        shown = [gain * value for value in self.latest]
        return suggest_goal(self.plan.measure, shown, self.wanted_hit_rate)

    def move(self, step: ScoredStep) -> float | None:
        """Return the goal from the next step on, if the staircase moves it after this one."""
        if step.goal is None or step.hit is None:
            return None
        goal = self.staircase.add(
            self.plan.adaptation,
            self.plan.measure,
            self.wanted_hit_rate,
            goal=step.goal,
            gain=step.gain,
            hit=step.hit,
        )
        self.moved = goal is not None
        return goal
