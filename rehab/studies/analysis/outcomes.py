"""Outcomes of one session, of two that follow each other, and of each phase.

Changes are against the participant's *first* baseline, so that what one visit carries to the next
is measured, and not taken for a new baseline. What was kept is a difference, never a share of what
was gained: a share exists only for those who gained, and would condition on the response.

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
from rehab.training.summary.metrics import METRICS
from robot.marking import gettext_noop

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


@dataclass(frozen=True, slots=True)
class Outcome:
    """A figure that a study may register.

    Attributes
    ----------
    slug, label, unit
        For programs, for people (translated by pages), and of the figure; "" for ratios.
    meaning
        How it is computed, as the registered document and the codebook define it.
    compute
        Returns it of a session with what came before; None where there is none.
    """

    slug: str
    label: str
    unit: str
    meaning: str
    compute: Callable[[Walk, History], float | None]


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


def _early(walk: Walk, history: History) -> float | None:
    return change(walk, walk.values(walk.with_feedback)[:ENDS], history.baseline)


def _training(walk: Walk, history: History) -> float | None:
    return change(walk, walk.values(walk.with_feedback), history.baseline)


def _late(walk: Walk, history: History) -> float | None:
    return change(walk, walk.values(walk.with_feedback)[-ENDS:], history.baseline)


def _catch(walk: Walk, history: History) -> float | None:
    return change(walk, walk.values(walk.in_kind("catch")), history.baseline)


def _washout(walk: Walk, history: History) -> float | None:
    return change(walk, walk.values(walk.in_kind("washout")), history.baseline)


def _after_effect(walk: Walk, history: History) -> float | None:
    return change(walk, walk.values(walk.in_kind("washout"))[:FIRST_AFTER], history.baseline)


def _washout_loss(walk: Walk, history: History) -> float | None:
    """Return the washout's change less that of the last strides with feedback."""
    return _less(_washout(walk, history), _late(walk, history))


def _carried(walk: Walk, history: History) -> float | None:
    """Return the change of this session's baseline; none in the first session."""
    if history.before is None or walk.baseline is None:
        return None
    return change(walk, np.array([walk.baseline]), history.baseline)


def _follow_up(walk: Walk, history: History) -> float | None:
    """Return the change of a session without any feedback, after one that had it."""
    if history.before is None or any(phase.feedback for phase in walk.phases):
        return None
    return change(walk, walk.values(np.ones(len(walk.value), bool)), history.baseline)


def _less(one: float | None, other: float | None) -> float | None:
    return None if one is None or other is None else one - other


def _to_success(walk: Walk, _history: History | None = None) -> float | None:
    """Return after how many judged strides the first window with enough hits was complete.

    All that were walked where none was: leaving those out would compare the successful alone.
    """
    hits = walk.hit[walk.with_feedback & np.isfinite(walk.performance)]
    if len(hits) < WINDOW:
        return None
    shares = np.convolve(hits, np.ones(WINDOW), "valid")
    found = np.flatnonzero(shares >= SUCCESS * WINDOW)
    return float(found[0] + WINDOW if len(found) else len(hits))


def _of_goal(walk: Walk, _history: History) -> float | None:
    """Return the mean of the real values in percent of the goal, whatever the display's gain."""
    where = walk.with_feedback & np.isfinite(walk.performance)
    return float((100 * walk.value[where] / walk.goal[where]).mean()) if where.any() else None


def _cv(walk: Walk, _history: History) -> float | None:
    return variation(walk.values(walk.with_feedback))


def variation(values: Floats) -> float | None:
    """Return the sample SD in percent of the mean; None of fewer than two values."""
    if len(values) < 2 or not values.mean() > 0:
        return None
    return float(100 * values.std(ddof=1) / values.mean())


def _steadiness(walk: Walk, _history: History) -> float | None:
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


def _lag_1(walk: Walk, _history: History) -> float | None:
    return memory(walk.values(walk.with_feedback))


def _error(walk: Walk, _history: History) -> float | None:
    performance = walk.performance[walk.with_feedback & np.isfinite(walk.performance)]
    return float(100 * np.abs(performance - 1).mean()) if len(performance) else None


def _invalid(walk: Walk, _history: History) -> float | None:
    return float(100 * (~walk.valid).mean()) if len(walk.valid) else None


def _visit_loss(walk: Walk, history: History) -> float | None:
    """Return the change that this session begins with less that which the last one ended with."""
    last = None if history.before is None else _late(history.before, history)
    return _less(_early(walk, history), last)


def _savings(walk: Walk, history: History) -> float | None:
    """Return how many strides earlier success came than in the session before."""
    last = None if history.before is None else _to_success(history.before)
    return _less(last, _to_success(walk))


FIRST = "in percent of the participant's first baseline"
# What the strides themselves show; with what every session stores of itself, all of `OUTCOMES`.
OF_STRIDES: dict[str, Outcome] = {
    outcome.slug: outcome
    for outcome in (
        Outcome(
            "training_change",
            gettext_noop("Change in training"),
            "%",
            f"Mean of all valid strides with feedback less the baseline, {FIRST}.",
            _training,
        ),
        Outcome(
            "early_change",
            gettext_noop("Early change (first 50 strides)"),
            "%",
            f"Mean of the first {ENDS} valid strides with feedback less the baseline, {FIRST}.",
            _early,
        ),
        Outcome(
            "late_change",
            gettext_noop("Late change (last 50 strides)"),
            "%",
            f"Mean of the last {ENDS} valid strides with feedback less the baseline, {FIRST}.",
            _late,
        ),
        Outcome(
            "catch_change",
            gettext_noop("Change in catch blocks"),
            "%",
            f"Mean of the valid strides of catch phases less the baseline, {FIRST}.",
            _catch,
        ),
        Outcome(
            "washout_change",
            gettext_noop("Change in washout"),
            "%",
            f"Mean of the valid strides of washout phases less the baseline, {FIRST}.",
            _washout,
        ),
        Outcome(
            "washout_loss",
            gettext_noop("From late training to washout"),
            "%",
            f"Change in washout less late change, {FIRST}; negative where some was lost.",
            _washout_loss,
        ),
        Outcome(
            "after_effect",
            gettext_noop("After-effect (first 20 strides)"),
            "%",
            f"Mean of the first {FIRST_AFTER} valid strides of washout less the baseline, {FIRST}.",
            _after_effect,
        ),
        Outcome(
            "baseline_change",
            gettext_noop("Change of the baseline since the first visit"),
            "%",
            f"Mean of this visit's baseline less the first one, {FIRST}; none at the first visit.",
            _carried,
        ),
        Outcome(
            "follow_up_change",
            gettext_noop("Change at the follow-up"),
            "%",
            f"Mean of all valid strides of the follow-up less the baseline, {FIRST}.",
            _follow_up,
        ),
        Outcome(
            "between_visits",
            gettext_noop("From the last visit’s end to this one’s beginning"),
            "%",
            f"Early change less the late change of the visit before, {FIRST}.",
            _visit_loss,
        ),
        Outcome(
            "strides_to_success",
            gettext_noop("Strides until 80 % are hits"),
            "steps",
            f"Judged strides until {WINDOW} in a row had {SUCCESS:.0%} hits; all where none had.",
            _to_success,
        ),
        Outcome(
            "savings",
            gettext_noop("Strides saved since the last visit"),
            "steps",
            "Strides until 80 % are hits at the visit before, less those at this one.",
            _savings,
        ),
        Outcome(
            "percent_of_goal",
            gettext_noop("Real value of the goal"),
            "%",
            "Mean of value / goal of the judged strides, whatever the display's gain.",
            _of_goal,
        ),
        Outcome(
            "absolute_error",
            gettext_noop("Distance from the goal"),
            "%",
            "Mean of |shown / goal - 1| of the judged strides.",
            _error,
        ),
        Outcome(
            "variation",
            gettext_noop("Variation (CV)"),
            "%",
            "Sample standard deviation of the strides with feedback, in percent of their mean.",
            _cv,
        ),
        Outcome(
            "steadiness",
            gettext_noop("Variation about the trend"),
            "%",
            "Standard deviation of the strides with feedback about their straight line, in percent "
            "of the visit's baseline.",
            _steadiness,
        ),
        Outcome(
            "lag_1",
            gettext_noop("Memory from stride to stride (lag 1)"),
            "",
            "Lag-1 autocorrelation of the strides with feedback.",
            _lag_1,
        ),
        Outcome(
            "invalid_strides",
            gettext_noop("Invalid strides"),
            "%",
            "Share of the trained leg's strides that are not valid.",
            _invalid,
        ),
    )
}
# Of the session's metrics: what counts days or sessions compares nothing, and a share of what was
# gained exists only for those who gained.
NOT_COMPARED = {"retention_in_washout"}
OF_SESSIONS = {
    metric.slug: metric
    for metric in METRICS.values()
    if metric.unit not in {"days", "sessions"} and metric.slug not in NOT_COMPARED
}
# How each of them is computed, with the visit's own baseline.
MEANINGS = {
    "score": "Points of the session; none where the feedback type has no points.",
    "hit_rate": "Hits / judged strides with feedback.",
    "mean_performance": "Mean of shown / goal of the judged strides with feedback.",
    "best_streak": "Most hits in a row.",
    "points_per_100_steps": "100 x score / judged strides.",
    "improvement_over_baseline": "Mean of the valid strides with feedback less the mean of the "
    "visit's own baseline, in percent of the latter.",
    "steps": "Judged strides with feedback.",
    "active_minutes": "Time that was walked.",
}
# Slug to label and unit of all that may be registered.
OUTCOMES: dict[str, tuple[str, str]] = {
    slug: (one.label, one.unit) for slug, one in (OF_SESSIONS | OF_STRIDES).items()
}


def define_outcomes() -> list[dict[str, str]]:
    """Return name, unit and meaning of every outcome that may be registered."""
    meanings = MEANINGS | {one.slug: one.meaning for one in OF_STRIDES.values()}
    return [
        {"outcome": slug, "label": label, "unit": unit, "meaning": meanings[slug]}
        for slug, (label, unit) in OUTCOMES.items()
    ]


def compute_outcomes(walk: Walk, history: History, metrics: dict[str, float]) -> dict[str, float]:
    """Return every outcome that a session has, by slug.

    Parameters
    ----------
    walk, history
        The session, and what came before it.
    metrics
        The figures that the session stores, by slug, in the units of `METRICS`.
    """
    figures = {slug: value for slug, value in metrics.items() if slug in OUTCOMES}
    for slug, outcome in OF_STRIDES.items():
        value = outcome.compute(walk, history)
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
        "change_percent": change(walk, values, walk.baseline),
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
