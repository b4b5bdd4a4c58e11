"""Outcomes of one session, of two that follow each other, and of each phase.

The list is that of the literature on feedback of push-off (docs/reference/gait.md#outcomes), as far
as strides show it; what further channels are sent (forces, moments, step lengths) is compared with
the baseline under the channel's name.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from rehab.studies.analysis.walks import Flags, Floats, Walk
from rehab.training.summary.metrics import METRICS, MIN_TRAINED_GAIN
from robot.marking import gettext_noop

# A mean of so many strides has a standard error of 1-2 % (docs/reference/gait.md#phases).
ENDS = 50
FIRST_AFTER = 20  # strides in which an after-effect is at its largest
# A participant succeeds from where so many strides in a row have this share of hits.
WINDOW, SUCCESS = 20, 0.8


@dataclass(frozen=True, slots=True)
class Outcome:
    """A figure that a study may register.

    Attributes
    ----------
    slug, label, unit
        For programs, for people (translated by pages), and of the figure; "" for ratios.
    compute
        Returns it of a session, and of the participant's session before it if there was one; None
        where there is none.
    """

    slug: str
    label: str
    unit: str
    compute: Callable[[Walk, Walk | None], float | None]


def change(walk: Walk, values: Floats) -> float | None:
    """Return how much better a mean is than the baseline, in percent of the latter.

    Parameters
    ----------
    walk
        Whose baseline and direction count.
    values
        Shape (n,), in the measure's unit. None is returned without values or without a baseline.
    """
    if walk.baseline is None or not len(values):
        return None
    percent = 100 * (float(values.mean()) / walk.baseline - 1)
    return percent if walk.higher_is_better else -percent


def _early(walk: Walk, _before: Walk | None = None) -> float | None:
    return change(walk, walk.values(walk.with_feedback)[:ENDS])


def _late(walk: Walk, _before: Walk | None = None) -> float | None:
    return change(walk, walk.values(walk.with_feedback)[-ENDS:])


def _catch(walk: Walk, _before: Walk | None) -> float | None:
    return change(walk, walk.values(walk.in_kind("catch")))


def _washout(walk: Walk, _before: Walk | None) -> float | None:
    return change(walk, walk.values(walk.in_kind("washout")))


def _after_effect(walk: Walk, _before: Walk | None) -> float | None:
    return change(walk, walk.values(walk.in_kind("washout"))[:FIRST_AFTER])


def _to_success(walk: Walk, _before: Walk | None = None) -> float | None:
    """Return after how many judged strides the first window with enough hits was complete."""
    hits = walk.hit[walk.with_feedback & np.isfinite(walk.performance)]
    if len(hits) < WINDOW:
        return None
    shares = np.convolve(hits, np.ones(WINDOW), "valid")
    found = np.flatnonzero(shares >= SUCCESS * WINDOW)
    return float(found[0] + WINDOW) if len(found) else None


def _of_goal(walk: Walk, _before: Walk | None = None) -> float | None:
    """Return the mean of the real values in percent of the goal, whatever the display's gain."""
    where = walk.with_feedback & np.isfinite(walk.performance)
    return float((100 * walk.value[where] / walk.goal[where]).mean()) if where.any() else None


def _cv(walk: Walk, _before: Walk | None = None) -> float | None:
    return variation(walk.values(walk.with_feedback))


def variation(values: Floats) -> float | None:
    """Return the sample SD in percent of the mean; None of fewer than two values."""
    if len(values) < 2 or not values.mean() > 0:
        return None
    return float(100 * values.std(ddof=1) / values.mean())


def _steadiness(walk: Walk, _before: Walk | None) -> float | None:
    values = walk.values(walk.with_feedback)
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


def _lag_1(walk: Walk, _before: Walk | None) -> float | None:
    return memory(walk.values(walk.with_feedback))


def _error(walk: Walk, _before: Walk | None) -> float | None:
    performance = walk.performance[walk.with_feedback & np.isfinite(walk.performance)]
    return float(100 * np.abs(performance - 1).mean()) if len(performance) else None


def _invalid(walk: Walk, _before: Walk | None) -> float | None:
    return float(100 * (~walk.valid).mean()) if len(walk.valid) else None


def _retained(walk: Walk, before: Walk | None) -> float | None:
    """Return how much of what the last session ended with this one begins with, in percent."""
    last = None if before is None else _late(before)
    first = _early(walk)
    if last is None or first is None or last < 100 * MIN_TRAINED_GAIN:
        return None
    return 100 * first / last


def _savings(walk: Walk, before: Walk | None) -> float | None:
    """Return how many strides earlier success came than in the session before."""
    last, now = None if before is None else _to_success(before), _to_success(walk)
    return None if last is None or now is None else last - now


# What the strides themselves show; with what every session stores of itself, all of `OUTCOMES`.
OF_STRIDES: dict[str, Outcome] = {
    outcome.slug: outcome
    for outcome in (
        Outcome("early_change", gettext_noop("Early change (first 50 strides)"), "%", _early),
        Outcome("late_change", gettext_noop("Late change (last 50 strides)"), "%", _late),
        Outcome("catch_change", gettext_noop("Change in catch blocks"), "%", _catch),
        Outcome("washout_change", gettext_noop("Change in washout"), "%", _washout),
        Outcome(
            "after_effect", gettext_noop("After-effect (first 20 strides)"), "%", _after_effect
        ),
        Outcome(
            "strides_to_success", gettext_noop("Strides until 80 % are hits"), "steps", _to_success
        ),
        Outcome("percent_of_goal", gettext_noop("Real value of the goal"), "%", _of_goal),
        Outcome("absolute_error", gettext_noop("Distance from the goal"), "%", _error),
        Outcome("variation", gettext_noop("Variation (CV)"), "%", _cv),
        Outcome("steadiness", gettext_noop("Variation about the trend"), "%", _steadiness),
        Outcome("lag_1", gettext_noop("Memory from stride to stride (lag 1)"), "", _lag_1),
        Outcome("kept_between_visits", gettext_noop("Kept since the last visit"), "%", _retained),
        Outcome("savings", gettext_noop("Strides saved since the last visit"), "steps", _savings),
        Outcome("invalid_strides", gettext_noop("Invalid strides"), "%", _invalid),
    )
}
# Slug to label and unit of all that may be registered. What counts days or sessions compares
# nothing.
OUTCOMES: dict[str, tuple[str, str]] = {
    **{
        metric.slug: (metric.label, metric.unit)
        for metric in METRICS.values()
        if metric.unit not in {"days", "sessions"}
    },
    **{outcome.slug: (outcome.label, outcome.unit) for outcome in OF_STRIDES.values()},
}


def compute_outcomes(
    walk: Walk, before: Walk | None, metrics: dict[str, float]
) -> dict[str, float]:
    """Return every outcome that a session has, by slug.

    Parameters
    ----------
    walk, before
        The session, and the participant's session before it.
    metrics
        The figures that the session stores, by slug, in the units of `METRICS`.
    """
    figures = {slug: value for slug, value in metrics.items() if slug in OUTCOMES}
    for slug, outcome in OF_STRIDES.items():
        value = outcome.compute(walk, before)
        if value is not None:
            figures[slug] = value
    return figures


def channel_changes(walk: Walk) -> dict[str, float]:
    """Return by how much each further channel's mean with feedback left that of the baseline [%].

    Unlike a change of the measure it has a sign of its own: which direction is better is unknown.
    """
    changes = {}
    known = walk.valid
    for name, values in walk.extra.items():
        there = known & np.isfinite(values)
        base = values[there & walk.in_kind("baseline")]
        trained = values[there & walk.with_feedback]
        if len(base) and len(trained) and abs(mean := float(base.mean())) > 0:
            changes[name] = 100 * (float(trained.mean()) - mean) / abs(mean)
    return changes


def describe_phases(walk: Walk) -> list[dict[str, Any]]:
    """Return the figures of each phase that was walked, in the plan's order.

    Counts; hit rate (ratio); mean, quartiles and real mean in percent of baseline and goal; CV,
    SD about the trend [%], lag-1 autocorrelation.
    """
    return [
        {
            "phase": index,
            "kind": phase.kind,
            "name": phase.name,
            "feedback": phase.feedback,
            **_describe(walk, where),
        }
        for index, phase in enumerate(walk.phases)
        if (where := walk.phase == index).any()
    ]


def _describe(walk: Walk, where: Flags) -> dict[str, Any]:
    values = walk.values(where)
    judged = where & np.isfinite(walk.performance)
    shown = 100 * walk.performance[judged]
    low, middle, high = np.percentile(shown, [25, 50, 75]) if len(shown) else (None, None, None)
    return {
        "strides": int(where.sum()),
        "valid": len(values),
        "judged": int(judged.sum()),
        "hit_rate": float(walk.hit[judged].mean()) if len(shown) else None,
        "change_percent": change(walk, values),
        "shown_percent_of_goal": float(shown.mean()) if len(shown) else None,
        "shown_quartile_1": low,
        "shown_median": middle,
        "shown_quartile_3": high,
        "real_percent_of_goal": (
            float((100 * walk.value[judged] / walk.goal[judged]).mean()) if len(shown) else None
        ),
        "cv_percent": variation(values),
        "sd_about_trend_percent": (
            None if walk.baseline is None else detrended(values / walk.baseline)
        ),
        "lag_1": memory(values),
    }
