"""The heart rate above which a session pauses."""

from __future__ import annotations

from rehab.training.steps import HEART_RATE, ScoredStep

LIMIT_RANGE = (60, 220)  # of what a plan may set [1/min]


def is_above_limit(step: ScoredStep, limit: int | None) -> bool:
    """Return whether a step's heart rate lies above a plan's limit [1/min], if it has both."""
    rate = step.extra.get(HEART_RATE)
    return limit is not None and rate is not None and rate > limit
