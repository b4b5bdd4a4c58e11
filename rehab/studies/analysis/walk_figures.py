"""Figures of one walk, and of what came before it, of which outcomes are made.

Changes are against the participant's *first* baseline, so that what one visit carries to the next
is measured, and not taken for a new baseline. What was kept is a difference, never a share of what
was gained: a share exists only for those who gained, and would condition on the response.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from rehab.studies.analysis.mixed_model import Floats
from rehab.studies.analysis.walks import Walk

# A mean of so many strides has a standard error of 1-2 % (docs/reference/gait.md#phases).
ENDS = 50
FIRST_AFTER = 20  # strides in which an after-effect is at its largest
# A participant succeeds from where so many strides in a row have this share of hits.
WINDOW, SUCCESS = 20, 0.8


@dataclass(frozen=True, slots=True)
class History:
    """What came before a session.

    Attributes
    ----------
    before
        The participant's session before it; None of the first one.
    baseline
        Of the participant's first session, in the measure's unit; None where it had too few valid
        strides. The first session's own.
    """

    before: Walk | None
    baseline: float | None


def change(walk: Walk, values: Floats, baseline: float | None) -> float | None:
    """Return how much better a mean is than a baseline, in percent of the latter.

    Parameters
    ----------
    walk
        Whose direction counts.
    values, baseline
        Shape (n,), in the measure's unit, as the baseline. None is returned without either.
    """
    if baseline is None or not len(values):
        return None
    percent = 100 * (float(values.mean()) / baseline - 1)
    return percent if walk.higher_is_better else -percent


def change_of(choose: Callable[[Walk], Floats]) -> Callable[[Walk, History], float | None]:
    """Return what computes the change of the values that ``choose`` returns of a walk."""
    return lambda walk, history: change(walk, choose(walk), history.baseline)


training = change_of(lambda walk: walk.trained)
early = change_of(lambda walk: walk.trained[:ENDS])
late = change_of(lambda walk: walk.trained[-ENDS:])
catch = change_of(lambda walk: walk.values(walk.in_kind("catch")))
washout = change_of(lambda walk: walk.values(walk.in_kind("washout")))
after_effect = change_of(lambda walk: walk.values(walk.in_kind("washout"))[:FIRST_AFTER])


def washout_loss(walk: Walk, history: History) -> float | None:
    """Return the washout's change less that of the last strides with feedback."""
    return _less(washout(walk, history), late(walk, history))


def carried(walk: Walk, history: History) -> float | None:
    """Return the change of this session's baseline; none in the first session."""
    if history.before is None or walk.baseline is None:
        return None
    return change(walk, np.array([walk.baseline]), history.baseline)


def follow_up(walk: Walk, history: History) -> float | None:
    """Return the change of a session without any feedback, after one that had it."""
    if history.before is None or any(phase.feedback for phase in walk.phases):
        return None
    return change(walk, walk.values(np.ones(len(walk.value), bool)), history.baseline)


def _less(one: float | None, other: float | None) -> float | None:
    return None if one is None or other is None else one - other


def to_success(walk: Walk, _history: History | None = None) -> float | None:
    """Return after how many judged strides the first window with enough hits was complete.

    All that were walked where none was: leaving those out would compare the successful alone.
    """
    hits = walk.hit[walk.with_feedback & np.isfinite(walk.performance)]
    if len(hits) < WINDOW:
        return None
    shares = np.convolve(hits, np.ones(WINDOW), "valid")
    found = np.flatnonzero(shares >= SUCCESS * WINDOW)
    return float(found[0] + WINDOW if len(found) else len(hits))


def of_goal(walk: Walk, _history: History) -> float | None:
    """Return the mean of the real values in percent of the goal, whatever the display's gain."""
    where = walk.with_feedback & np.isfinite(walk.performance)
    return float((100 * walk.value[where] / walk.goal[where]).mean()) if where.any() else None


def cv(walk: Walk, _history: History) -> float | None:
    """Return the variation of the strides with feedback."""
    return variation(walk.trained)


def variation(values: Floats) -> float | None:
    """Return the sample SD in percent of the mean; None of fewer than two values."""
    if len(values) < 2 or not values.mean() > 0:
        return None
    return float(100 * values.std(ddof=1) / values.mean())


def steadiness(walk: Walk, _history: History) -> float | None:
    """Return the SD of the strides with feedback about their line, in percent of the baseline."""
    values = walk.trained
    return None if walk.baseline is None else detrended(values / walk.baseline)


def detrended(values: Floats) -> float | None:
    """Return the SD about the straight line through the values, times 100; None of fewer than 3."""
    if len(values) < 3:
        return None
    t = np.arange(len(values)) - (len(values) - 1) / 2
    centered = values - values.mean()
    residual = centered - t * ((t * centered).sum() / (t * t).sum())
    return float(100 * np.sqrt((residual * residual).sum() / (len(values) - 2)))


def memory(values: Floats) -> float | None:
    """Return the lag-1 autocorrelation; None of fewer than three values, or of equal ones."""
    centered = values - values.mean() if len(values) > 2 else values[:0]
    power = float((centered * centered).sum())
    return float((centered[1:] * centered[:-1]).sum() / power) if power > 0 else None


def lag_1(walk: Walk, _history: History) -> float | None:
    """Return the lag-1 autocorrelation of the strides with feedback."""
    return memory(walk.trained)


def error(walk: Walk, _history: History) -> float | None:
    """Return the mean distance from the goal, in percent."""
    performance = walk.performance[walk.with_feedback & np.isfinite(walk.performance)]
    return float(100 * np.abs(performance - 1).mean()) if len(performance) else None


def invalid(walk: Walk, _history: History) -> float | None:
    """Return the share of invalid strides, in percent."""
    return float(100 * (~walk.valid).mean()) if len(walk.valid) else None


def visit_loss(walk: Walk, history: History) -> float | None:
    """Return the change that this session begins with less that which the last one ended with."""
    last = None if history.before is None else late(history.before, history)
    return _less(early(walk, history), last)


def savings(walk: Walk, history: History) -> float | None:
    """Return how many strides earlier success came than in the session before."""
    last = None if history.before is None else to_success(history.before)
    return _less(last, to_success(walk))
