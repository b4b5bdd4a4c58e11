"""Checkpoints of a fold: its state as plain data, so that only the rest of a log is folded."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, replace
from enum import Enum
from typing import Any

from rehab.training.changes import PauseReason, State
from rehab.training.controls import CONTROLS
from rehab.training.feedback_bands import bands_from_json, bands_to_json
from rehab.training.fold import SessionFold
from rehab.training.fold.tallies import Block, Tally
from rehab.training.goal_adaptation import Staircase
from rehab.training.plans import SessionPlan
from rehab.training.schedules import FeedbackSummary
from rehab.training.steps import Side

# Rises with every change of the fold that an older checkpoint would not fit; such a one is ignored.
CHECKPOINT_VERSION = 7
# What is plain data already.
PLAIN = (
    *("last_number", "last_time_s", "active_s", "goal", "was_walking"),
    *("phase_index", "phase_strides", "phase_s", "gain", "obstacle", "completed"),
    *("rest_s", "is_strained"),
)


def fold_to_json(fold: SessionFold) -> dict[str, Any]:
    """Return the state of a fold as JSON has it."""
    following, delivery = fold.following, fold.delivery
    planned = {one.slug: one for one in (fold.plan.valence, *fold.plan.alternatives)}
    return {
        "version": CHECKPOINT_VERSION,
        **{name: getattr(fold, name) for name in PLAIN},
        "state": fold.state.value,
        "pause_reason": None if fold.pause_reason is None else fold.pause_reason.value,
        "valence": fold.valence.slug,
        "next_valence": fold.valences.next_slug,
        "language": fold.valences.language,
        "last_times_s": {side.value: time_s for side, time_s in fold.last_times_s.items()},
        "switches": fold.valences.switches,
        "settings": {
            str(kind): value.value if isinstance(value, Enum) else value
            for kind, value in fold.settings.items()
        },
        "staircase": asdict(following.staircase),
        "latest": list(following.latest),
        "adapted": following.moved,
        "pending": asdict(delivery.pending),
        "answer": None if delivery.answer is None else asdict(delivery.answer),
        "answer_count": delivery.answer_count,
        "reported": list(delivery.reported),
        "trained": asdict(fold.trained),
        "feedback": asdict(fold.feedback),
        "phases": [asdict(tally) for tally in fold.phases],
        "blocks": [[*block, asdict(tally)] for block, tally in fold.blocks.items()],
        "bands": {
            slug: bands_to_json(valence.bands)
            for slug, valence in fold.valences.known.items()
            if valence.bands != planned[slug].bands
        },
    }


def fold_from_json(plan: SessionPlan, data: Mapping[str, Any]) -> SessionFold | None:
    """Return the fold that a checkpoint describes; None where another version wrote it.

    Parameters
    ----------
    plan
        The session's plan, with which the checkpoint was made.
    data
        What ``fold_to_json`` returned.
    """
    if data.get("version") != CHECKPOINT_VERSION:
        return None
    fold = SessionFold(plan)
    for name in PLAIN:
        setattr(fold, name, data[name])
    reason = data["pause_reason"]
    fold.state, fold.pause_reason = State(data["state"]), reason and PauseReason(reason)
    fold.phase = plan.phases[fold.phase_index]
    fold.last_times_s = {Side(side): time_s for side, time_s in data["last_times_s"].items()}
    fold.valences.switches = [(after, slug) for after, slug in data["switches"]]
    for kind, value in data["settings"].items():
        initial = CONTROLS[kind].initial
        if initial is not None:
            fold.settings[kind] = type(initial(plan))(value)
    following, delivery = fold.following, fold.delivery
    following.staircase, following.moved = Staircase(**data["staircase"]), data["adapted"]
    following.latest.extend(data["latest"])
    delivery.pending = FeedbackSummary(**data["pending"])
    delivery.answer = None if data["answer"] is None else FeedbackSummary(**data["answer"])
    delivery.answer_count = data["answer_count"]
    delivery.reported.extend(data["reported"])
    fold.trained, fold.feedback = Tally(**data["trained"]), Tally(**data["feedback"])
    fold.phases = tuple(Tally(**tally) for tally in data["phases"])
    fold.blocks = {
        Block(phase, gain, valence): Tally(**tally)
        for phase, gain, valence, tally in data["blocks"]
    }
    fold.valences.language = data.get("language", plan.language)
    known = fold.valences.known
    for slug, bands in data["bands"].items():
        known[slug] = replace(known[slug], bands=bands_from_json(bands))
    fold.valences.current, fold.valences.next_slug = known[data["valence"]], data["next_valence"]
    return fold
