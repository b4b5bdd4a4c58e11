"""Metrics of a session: the figures that reports and leaderboards are made of."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from rehab.training.fold import SessionFold
from robot.marking import gettext_noop

# Below this share of the baseline a gain is within a walker's own noise (CV 6.5-12 %,
# standard error of a 50-stride mean 1-2 %: docs/reference/gait.md#phases), and a share of it is
# meaningless.
MIN_TRAINED_GAIN = 0.03
# A change relative to (nearly) zero is meaningless: below this share of the largest value.
MIN_BASELINE_SHARE = 1e-6


@dataclass(frozen=True, slots=True)
class Metric:
    """A figure of a session.

    Attributes
    ----------
    slug, label, unit
        Its name in programs, its name for people (translated by pages), its unit, "" for ratios.
    compute
        Returns the figure of a session, None where it has none.
    higher_is_better
        Whether leaderboards rank larger figures first.
    """

    slug: str
    label: str
    unit: str
    compute: Callable[[SessionFold], float | None]
    higher_is_better: bool = True


def _best_streak(fold: SessionFold) -> float | None:
    return fold.feedback.best_streak if fold.feedback.judged else None


def _points_per_100_steps(fold: SessionFold) -> float | None:
    """Score for each 100 judged steps: sessions of different length compare."""
    if fold.score is None or not fold.feedback.judged:
        return None
    return 100 * fold.score / fold.feedback.judged


def _relative_change(fold: SessionFold, mean: float | None) -> float | None:
    """Return (mean − baseline) / baseline, positive for the better direction."""
    measure = fold.plan.measure
    baseline = fold.baseline_mean
    if mean is None or baseline is None or baseline <= MIN_BASELINE_SHARE * measure.value_max:
        return None
    change = (mean - baseline) / baseline
    return change if measure.higher_is_better else -change


def _improvement_over_baseline(fold: SessionFold) -> float | None:
    """Mean value in feedback phases against the baseline mean, in percent of the latter."""
    change = _relative_change(fold, fold.feedback.mean_value)
    return None if change is None else 100 * change


def _retention_in_washout(fold: SessionFold) -> float | None:
    """Share of the training gain that remains in the washout, in percent.

    (washout − baseline) / (training − baseline) of the mean values; may leave 0-100 %. None where
    training gained less than MIN_TRAINED_GAIN of the baseline.
    """
    trained = _relative_change(fold, fold.feedback.mean_value)
    kept = _relative_change(fold, fold.tally_of("washout").mean_value)
    if trained is None or kept is None or trained < MIN_TRAINED_GAIN:
        return None
    return 100 * kept / trained


def _attended(fold: SessionFold) -> float | None:
    """1 for a session with a valid stride, else None: sums count sessions."""
    return 1.0 if fold.trained.valid else None


def _target_met(fold: SessionFold) -> float | None:
    """1 where the PT's target for the session was met, else 0; None without a target."""
    met = fold.plan.target.is_met(fold.feedback.hit_rate, fold.active_s)
    return None if met is None or not fold.trained.valid else float(met)


METRICS: dict[str, Metric] = {
    metric.slug: metric
    for metric in (
        Metric("score", gettext_noop("Score"), "points", lambda fold: fold.score),
        Metric("hit_rate", gettext_noop("Hit rate"), "", lambda fold: fold.feedback.hit_rate),
        Metric(
            "mean_performance",
            gettext_noop("Mean performance"),
            "",
            lambda fold: fold.feedback.mean_performance,
        ),
        Metric("best_streak", gettext_noop("Best streak"), "steps", _best_streak),
        Metric(
            "points_per_100_steps",
            gettext_noop("Points per 100 steps"),
            "points",
            _points_per_100_steps,
        ),
        Metric(
            "improvement_over_baseline",
            gettext_noop("Improvement over baseline"),
            "%",
            _improvement_over_baseline,
        ),
        Metric(
            "retention_in_washout", gettext_noop("Retention in washout"), "%", _retention_in_washout
        ),
        # Judged steps of feedback phases, from which hit rate and score follow.
        Metric(
            "steps",
            gettext_noop("Steps"),
            "steps",
            lambda fold: float(fold.feedback.judged) or None,
        ),
        Metric(
            "active_minutes",
            gettext_noop("Active minutes"),
            "min",
            lambda fold: fold.active_s / 60 or None,
        ),
        Metric("attended", gettext_noop("Sessions attended"), "sessions", _attended),
        Metric("target_met", gettext_noop("Target met"), "days", _target_met),
    )
}


def compute_metrics(fold: SessionFold) -> dict[str, float]:
    """Return every metric that the session has, by slug."""
    figures = {slug: metric.compute(fold) for slug, metric in METRICS.items()}
    return {slug: figure for slug, figure in figures.items() if figure is not None}
