"""A session in figures, as plain data for reports."""

from __future__ import annotations

from typing import Any

from rehab.training.fold import Block, SessionFold
from rehab.training.metrics import measure_session
from rehab.training.tallies import Tally


def describe_tally(tally: Tally) -> dict[str, Any]:
    """Give the counts and means of some steps."""
    return {
        "strides": tally.strides,
        "valid": tally.valid,
        "invalid": tally.invalid,
        "missing": tally.missing,
        "hits": tally.hits,
        "hit_rate": tally.hit_rate,
        "mean": tally.mean_value,
        "mean_performance": tally.mean_performance,
    }


def describe_session(fold: SessionFold) -> dict[str, Any]:
    """Give the figures of a session.

    ``strides``, ``valid``, ``invalid`` and ``missing`` count the trained leg in every phase;
    ``hits``, ``hit_rate`` and ``score`` only feedback phases (docs/reference/scoring.md#totals).
    ``phases`` has one entry for all that are alike in name, kind, feedback, gain and valence (of
    feedback), with its single blocks: a phase in which the gain was changed has as many entries as
    it had gains.
    """
    whole, feedback = describe_tally(fold.trained), describe_tally(fold.feedback)
    return {
        **{name: whole[name] for name in ("strides", "valid", "invalid", "missing")},
        "hits": feedback["hits"],
        "hit_rate": feedback["hit_rate"],
        "score": fold.score,
        "goal": fold.goal,
        "active_s": fold.active_s,
        "target_met": fold.plan.target.is_met(fold.feedback.hit_rate, fold.active_s),
        "metrics": measure_session(fold),
        "phases": describe_phases(fold),
    }


def describe_phases(fold: SessionFold) -> list[dict[str, Any]]:
    """Give the figures of phases, those alike together, in the plan's order."""
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
            blocks.append({"phase": index, **describe_tally(tally)})
    return [
        {**head, **describe_tally(total), "blocks": blocks}
        for head, total, blocks in entries.values()
    ]


def _blocks_of(fold: SessionFold, index: int) -> list[tuple[Block, Tally]]:
    """Give a phase's blocks in the order in which they were walked, or one as it was planned."""
    walked = [(block, tally) for block, tally in fold.blocks.items() if block.phase == index]
    phase = fold.plan.phases[index]
    planned = Block(index, phase.gain, fold.plan.valence.slug if phase.feedback else "")
    return walked or [(planned, Tally())]
