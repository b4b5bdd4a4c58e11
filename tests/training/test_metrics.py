"""Metrics against figures worked out by hand."""

from __future__ import annotations

import math

import pytest

from rehab.training.fold import SessionFold
from rehab.training.goals import Target
from rehab.training.phases import make_phase
from rehab.training.summary.metrics import METRICS, compute_metrics
from tests.training.sessions import SWAY, make_plan, start, walk


def walk_session(baseline, trained, washout, repeat=50, **settings) -> SessionFold:
    """Walk a session of three phases; the baseline's values are walked so many times."""
    baseline = baseline * repeat
    kinds = {"baseline": baseline, "training": trained, "washout": washout}
    phases = [make_phase(kind, strides=len(values)) for kind, values in kinds.items() if values]
    fold = start(make_plan(*phases, **settings))
    walk(fold, [*baseline, *trained, *washout])
    return fold


@pytest.mark.parametrize("slug", METRICS)
def test_every_metric_has_a_name_and_no_figure_for_an_empty_session(slug: str) -> None:
    metric = METRICS[slug]
    assert metric.slug == slug
    assert metric.label
    assert metric.compute(SessionFold(make_plan(valence="explicit"))) is None


def test_a_session_worked_out_by_hand() -> None:
    fold = walk_session([3.9, 4.1], [4.4, 3.6, 5.2, None, 4.8], [4.2])
    assert compute_metrics(fold) == {
        "score": 2,  # + − + gap +
        "hit_rate": 0.75,
        "mean_performance": pytest.approx((1.1 + 0.9 + 1.3 + 1.2) / 4),
        "best_streak": 2,
        "points_per_100_steps": 50.0,
        "improvement_over_baseline": pytest.approx(12.5),  # 4.5 against 4.0
        "retention_in_washout": pytest.approx(40.0),  # 0.2 of 0.5
        "steps": 4,
        "active_minutes": pytest.approx(fold.active_s / 60),
        "attended": 1,
    }


def test_where_lower_is_better_improvement_is_what_was_lost() -> None:
    fold = walk_session([20.0], [15.0], [18.0], measure=SWAY, goal=16.0)
    figures = compute_metrics(fold)
    assert figures["improvement_over_baseline"] == pytest.approx(25.0)
    assert figures["retention_in_washout"] == pytest.approx(40.0)
    assert figures["mean_performance"] == pytest.approx(16 / 15)


def test_a_washout_may_keep_more_than_all_or_less_than_nothing() -> None:
    for washout, kept in ((5.5, 150.0), (3.0, -100.0)):
        fold = walk_session([4.0], [5.0], [washout])
        assert compute_metrics(fold)["retention_in_washout"] == pytest.approx(kept)


def test_the_gain_alters_performance_but_not_improvement() -> None:
    fold = start(
        make_plan(make_phase("baseline", strides=50), make_phase("training", gain=0.5), goal=4.0)
    )
    walk(fold, [4.0] * 50 + [6.0])
    figures = compute_metrics(fold)
    assert (figures["mean_performance"], figures["improvement_over_baseline"]) == (0.75, 50.0)


@pytest.mark.parametrize(
    ("session", "absent"),
    [
        (walk_session([4.0], [5.0], [], valence="explicit"), {"score", "points_per_100_steps"}),
        (walk_session([], [5.0], [4.5]), {"improvement_over_baseline"}),
        (walk_session([4.0], [5.0], [4.5], repeat=49), {"improvement_over_baseline"}),
        (walk_session([1e-6], [5.0], [4.5]), {"improvement_over_baseline"}),  # next to nothing
        (walk_session([4.0], [4.1], [4.1]), {"retention_in_washout"}),  # too small a gain to share
        (walk_session([4.0], [3.0], [4.1]), {"retention_in_washout"}),
        (walk_session([4.0], [5.0], []), {"retention_in_washout"}),
        (walk_session([0.0], [5.0], [4.0]), {"improvement_over_baseline"}),
        (walk_session([5e-324], [20.0], [4.0]), {"improvement_over_baseline"}),
        (
            walk_session([4.0], [None, math.nan], [4.0]),
            {"hit_rate", "mean_performance", "best_streak", "points_per_100_steps"},
        ),
    ],
)
def test_a_figure_that_would_mean_nothing_is_absent(session: SessionFold, absent: set[str]) -> None:
    assert not absent & compute_metrics(session).keys()


def test_no_hit_is_a_streak_of_none_not_an_absent_figure() -> None:
    figures = compute_metrics(walk_session([], [3.0], []))
    assert (figures["best_streak"], figures["hit_rate"], figures["score"]) == (0, 0.0, -1)


def test_a_target_is_met_missed_or_was_never_set() -> None:
    wished = Target(hit_rate=0.6)
    met, missed = (
        compute_metrics(walk_session([], values, [], target=wished))["target_met"]
        for values in ([5.0, 5.0, 3.0], [5.0, 3.0])
    )
    assert (met, missed) == (1.0, 0.0)
    assert "target_met" not in compute_metrics(walk_session([], [5.0], []))


def test_nothing_valid_was_not_attended() -> None:
    assert "attended" not in compute_metrics(walk_session([], [None, None], []))


def test_sessions_of_different_length_compare_by_points_per_100_steps() -> None:
    short, long = (compute_metrics(walk_session([], [5.0, 3.0, 5.0] * n, [])) for n in (1, 40))
    assert short["points_per_100_steps"] == pytest.approx(long["points_per_100_steps"])
