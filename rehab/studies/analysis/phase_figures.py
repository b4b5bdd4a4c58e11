"""Figures of each phase of a walk, and of its further channels."""

from __future__ import annotations

from typing import Any

import numpy as np

from rehab.studies.analysis.mixed_model import Flags
from rehab.studies.analysis.walk_figures import change, detrended, memory, variation
from rehab.studies.analysis.walks import Walk


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
