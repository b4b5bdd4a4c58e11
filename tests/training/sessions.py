"""Sessions to test the rules with: short to write, walked one stride a second."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from rehab.training.changes import Change, ChangeKind
from rehab.training.fold import SessionFold
from rehab.training.goals import GoalRule
from rehab.training.measures import A2, Measure
from rehab.training.phases import Phase, make_phase
from rehab.training.plans import SessionPlan
from rehab.training.steps import Measurement, ScoredStep, Side
from rehab.training.valences import VALENCES, Valence, find_valence

STRIDE_S = 1.0

# A quantity that training should lower, so that no rule forgets the direction.
SWAY = Measure("sway", "sway", "cm", 0, 50, 0, 40, higher_is_better=False)


def make_plan(
    *phases: Phase,
    valence: str = "binary",
    goal: float | None = 4.0,
    percent: float | None = None,
    measure: Measure = A2,
    **settings: Any,
) -> SessionPlan:
    """Return a plan for the left leg: training without end unless phases are given."""
    return SessionPlan(
        measure=measure,
        valence=find_valence(valence),
        phases=phases or (make_phase("training"),),
        trained_side=Side.LEFT,
        goal=GoalRule(percent_of_baseline=percent) if percent else GoalRule(value=goal),
        **settings,
    )


def others_than(valence: str) -> tuple[Valence, ...]:
    """Return the valences that a session of this one may be changed to."""
    return tuple(other for slug, other in VALENCES.items() if slug != valence)


def start(plan: SessionPlan) -> SessionFold:
    """Return a running session."""
    fold = SessionFold(plan)
    fold.change(Change(ChangeKind.START))
    return fold


def walk(
    fold: SessionFold,
    values: Iterable[float | None],
    *,
    side: Side = Side.LEFT,
    reasons: tuple[str, ...] = (),
) -> list[ScoredStep]:
    """Walk one stride a second from where the session stands."""
    steps = []
    for value in values:
        time_s = 0.0 if fold.last_time_s is None else fold.last_time_s + STRIDE_S
        steps.append(fold.step(Measurement(fold.last_number + 1, time_s, side, value, reasons)))
    return steps


def step_at(fold: SessionFold, time_s: float, value: float | None = 4.0) -> ScoredStep:
    """Walk one stride that ends at a time."""
    return fold.step(Measurement(fold.last_number + 1, time_s, Side.LEFT, value))
