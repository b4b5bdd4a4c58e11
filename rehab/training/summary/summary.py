"""The figures of a session as plain data, for reports."""

from __future__ import annotations

from typing import Any

from rehab.training.fold import SessionFold
from rehab.training.fold.tallies import STRIDES, Block, Tally
from rehab.training.summary.metrics import compute_metrics


def summarize_tally(tally: Tally) -> dict[str, Any]:
    """Return the counts of some steps, their hit rate (ratio), and their means."""
    return {
        **{name: getattr(tally, name) for name in STRIDES},
        "hits": tally.hits,
        "close": tally.close,
        "hit_rate": tally.hit_rate,
        "mean": tally.mean_value,
        "mean_performance": tally.mean_performance,
    }


def summarize_session(fold: SessionFold) -> dict[str, Any]:
    """Return the figures of a session.

    ``strides`` and their kinds (``STRIDES``) count the trained leg in every phase; ``hits``,
    ``close``, ``hit_rate`` and ``score`` only feedback phases (docs/reference/scoring.md#totals).
    ``phases`` has one entry for all that are alike in name, kind, feedback, gain and valence (of
    feedback), with its single blocks: a phase in which the gain was changed has as many entries as
    it had gains.
    """
    whole, feedback = summarize_tally(fold.trained), summarize_tally(fold.feedback)
    return {
        **{name: whole[name] for name in STRIDES},
        "hits": feedback["hits"],
        "close": feedback["close"],
        "hit_rate": feedback["hit_rate"],
        "score": fold.score,
        "goal": fold.goal,
        "active_s": fold.active_s,
        "target_met": fold.plan.target.is_met(fold.feedback.hit_rate, fold.active_s),
        "metrics": compute_metrics(fold),
        "phases": summarize_phases(fold),
    }


def summarize_phases(fold: SessionFold) -> list[dict[str, Any]]:
    """Return the figures of phases, those alike together, in the plan's order."""
    entries: dict[tuple[Any, ...], tuple[dict[str, Any], Tally, list[dict[str, Any]]]] = {}
    for index, phase in enumerate(fold.plan.phases):
        for block, tally in _blocks_of(fold, index):
            head = {
                "name": phase.name,
                "kind": phase.kind,
                "feedback": phase.feedback,
                "gain": block.gain,
                "valence": block.valence,
            }
            _, total, blocks = entries.setdefault(tuple(head.values()), (head, Tally(), []))
            total.merge(tally)
            blocks.append({"phase": index, **summarize_tally(tally)})
    return [
        {**head, **summarize_tally(total), "blocks": blocks}
        for head, total, blocks in entries.values()
    ]


def _blocks_of(fold: SessionFold, index: int) -> list[tuple[Block, Tally]]:
    """Return a phase's blocks in the order in which they were walked, or one as it was planned."""
    walked = [(block, tally) for block, tally in fold.blocks.items() if block.phase == index]
    phase = fold.plan.phases[index]
    planned = Block(index, phase.gain, fold.plan.valence.slug if phase.feedback else "")
    return walked or [(planned, Tally())]
