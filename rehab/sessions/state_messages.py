"""Parts of messages about a session: state, phase, types, its robot's cue, marks."""

from __future__ import annotations

from typing import Any

from django.utils.translation import gettext, override

from rehab.training.changes import ChangeKind, ChangeValue, PauseReason, State
from rehab.training.controls import CONTROLS
from rehab.training.fold import SessionFold
from rehab.training.fold.tallies import Tally
from rehab.training.phases import find_phase_kind
from rehab.training.plans import ROBOT_LEVELS
from rehab.training.valences import VALENCES
from robot.wire.cue_limits import VARIED

Message = dict[str, Any]

# The pool that a robot performs from at a change of the session's state.
MOMENTS: dict[str, str] = {ChangeKind.START: "greeting", ChangeKind.FINISH: "farewell"}


def describe_walked(walked: SessionFold) -> Message:
    """Return how far the session and its phase have come."""
    return {
        "active_s": round(walked.active_s, 2),
        "phase_s": round(walked.phase_s, 2),
        "phase_strides": walked.phase_strides,
    }


def describe_rates(tally: Tally) -> Message:
    """Return the share of hits, and what it is counted from."""
    return {
        "hit_rate": tally.hit_rate,
        "hits": tally.hits,
        "judged": tally.judged,
        "close": tally.close,
    }


def describe_phase(fold: SessionFold, index: int) -> Message:
    """Return a phase as pages show it, with the feedback type that is in force there."""
    plan, valence = fold.plan, fold.valence
    phase = plan.phases[index]
    calm_words = ""
    if not phase.feedback:
        with override(fold.valences.language):
            calm_words = gettext(find_phase_kind(phase.kind).calm_words)
    return {
        "index": index,
        "count": len(plan.phases),
        "kind": phase.kind,
        "name": phase.name,
        "feedback": phase.feedback,
        "calm_words": calm_words,
        "theme": valence.slug if phase.feedback else "calm",
        "strides": phase.strides,
        "seconds": phase.seconds,
    }


def describe_now(fold: SessionFold) -> Message:
    """Return the phase that the next step falls in, and how its points stand."""
    return {
        "phase": describe_phase(fold, fold.phase_index),
        "has_points": fold.valence.has_points,
        "longest": fold.valence.longest_words(),
        "score": fold.score,
        **describe_walked(fold),
    }


def describe_source_phase(fold: SessionFold) -> Message:
    """Return the phase and its feedback type as a simulated patient needs to know them."""
    phase = fold.phase
    return {
        "kind": phase.kind,
        "name": phase.name,
        "feedback": phase.feedback,
        "gain": phase.gain,
        "valence": fold.valence.slug,
    }


def describe_types(fold: SessionFold) -> Message:
    """Return which feedback type is in force and which comes next, and which it may be."""
    return {
        "began": fold.plan.valence.slug,
        "changed_to": list(fold.valences.changed_to),
        "valence": fold.valence.slug,
        "next_valence": fold.valences.next_slug,
        "types": [{"slug": one.slug, "label": one.label} for one in fold.valences.known.values()],
    }


def describe_cue(fold: SessionFold) -> Message:
    """Return the robot's order for this session, as of now."""
    cue, timing = fold.valence.cue, fold.plan.cue_timing
    named = {cue.above, cue.below}
    spares = fold.is_strained and not fold.plan.locked  # a study's arm decides how its robot acts
    return {
        "above": cue.above,
        "below": cue.below,
        "threshold": fold.activation_threshold,
        "rule": timing.rule.value,
        "window_s": timing.window_s,
        "count": timing.count,
        "rest_s": timing.rest_s,
        "intensity": min(fold.robot_intensity, ROBOT_LEVELS["gentle"] if spares else 1.0),
        "only_informs": not fold.valence.has_points,
        "idles": has_free_robot(fold),
        "seed": fold.plan.seed or None,
        "gestures": [one for one in fold.plan.gestures if one.get("name") in named],
    }


def has_free_robot(fold: SessionFold) -> bool:
    """Return whether the robot may also greet, rest, take leave and idle, as of now.

    Only where it chooses its answers itself, in a phase whose steps it answers, and never with a
    type that only informs: elsewhere any motion could distract.
    """
    phase, cue = fold.phase, fold.valence.cue
    varies = VARIED in (cue.above, cue.below)
    answers = phase.feedback and phase.robot and fold.valence.has_points
    return varies and answers and fold.robot_intensity > 0


def describe_robot_state(fold: SessionFold, kind: str) -> Message:
    """Return the state that a robot obeys, and what it performs at this change of it, if anything.

    ``kind``: of the change. A person starts and finishes a session, and its plan has rests; other
    pauses may be in need, and order nothing.
    """
    rests = kind == ChangeKind.PAUSE and fold.pause_reason is PauseReason.REST
    pool = "rest" if rests else MOMENTS.get(kind)
    gesture = pool if has_free_robot(fold) else None
    return {"type": "state", "state": fold.state.value, "gesture": gesture}


def describe_state(fold: SessionFold) -> Message:
    """Return where the session stands, who paused it, and how long a planned rest should be."""
    paused = fold.state is State.PAUSED and fold.pause_reason is not None
    return {
        "state": fold.state.value,
        "pause_reason": fold.pause_reason.value if paused and fold.pause_reason else "",
        "rest_s": fold.rest_s,
    }


def describe_coaching(fold: SessionFold) -> Message:
    """Return what helps a PT to set a goal: one from the latest strides, or from the baseline.

    ``suggested_goal`` is rounded as buttons round goals; ``baseline`` is there while it is walked.
    """
    goal = fold.suggested_goal
    return {
        "wanted_hit_rate": fold.following.wanted_hit_rate,
        "suggested_goal": None if goal is None else round(goal, fold.plan.measure.goal_places),
        "is_strained": fold.is_strained,
        "baseline": _describe_baseline(fold) if fold.phase.kind == "baseline" else None,
    }


def _describe_baseline(fold: SessionFold) -> Message:
    walked, percent = fold.tally_of("baseline"), fold.plan.goal.percent_of_baseline
    goal = None
    if walked.mean_value is not None and percent is not None:
        goal = walked.mean_value * percent / 100
    return {
        "mean": walked.mean_value,
        "sd": walked.sd_value,
        "count": walked.valid,
        "needed": fold.plan.goal.baseline_strides,
        "goal": goal,
        "asks": fold.plan.goal.asks,
    }


def change_mark(after: int, kind: str, value: ChangeValue) -> Message:
    """Return a change as a PT's chart points it out; of edited words only whose they are."""
    return {"after": after, "kind": str(kind), "value": CONTROLS[kind].part_shown(value)}


def type_mark(after: int, slug: str) -> Message:
    """Return the moment from which another feedback type was in force, for a PT's chart."""
    return {"after": after, "kind": "type", "value": VALENCES[slug].label}
