"""The heart rate above which a session pauses, and near which it spares the patient."""

from __future__ import annotations

from rehab.training.steps import HEART_RATE, ScoredStep

LIMIT_RANGE = (60, 220)  # of what a plan may set [1/min]
# Shares of the limit from which on a session spares the patient, and below which it does no more:
# then no harder goal is suggested, and the robot is gentle (our choice).
SPARE_FROM, SPARE_UNTIL = 0.9, 0.85


def is_above_limit(step: ScoredStep, limit: int | None) -> bool:
    """Return whether a step's heart rate lies above a plan's limit [1/min], if it has both."""
    rate = step.extra.get(HEART_RATE)
    return limit is not None and rate is not None and rate > limit


def is_near_limit(step: ScoredStep, limit: int | None, before: bool) -> bool:
    """Return whether a step's heart rate is so near to a plan's limit that the patient is spared.

    Parameters
    ----------
    step, limit
        The step; the limit [1/min], None without one.
    before
        Whether it was near before this step.
    """
    share = SPARE_UNTIL if before else SPARE_FROM
    rate = step.extra.get(HEART_RATE)
    return limit is not None and rate is not None and rate >= share * limit
