"""The events of a step or a change, the same while a session runs and when it is replayed."""

from __future__ import annotations

from collections.abc import Iterable
from datetime import datetime
from typing import NamedTuple

from rehab.sessions.events.change import change_event, cue_event, phase_event
from rehab.sessions.events.event import LiveEvent
from rehab.sessions.events.step import StepContext, step_event
from rehab.training.changes import Change, ChangeKind, State
from rehab.training.controls import Audience
from rehab.training.fold import SessionFold
from rehab.training.steps import ScoredStep


class Before(NamedTuple):
    """How a session stood before a step or a change, which its events follow from."""

    context: StepContext
    phase_index: int
    goal: float | None
    obstacle: str
    switches: int
    state: State
    is_strained: bool

    @classmethod
    def of(cls, fold: SessionFold) -> Before:
        """Return how a session stands now."""
        return cls(
            StepContext.of(fold),
            fold.phase_index,
            fold.goal,
            fold.obstacle,
            len(fold.valences.switches),
            fold.state,
            fold.is_strained,
        )

    def is_still_so(self, fold: SessionFold) -> bool:
        """Return whether a step has changed nothing of this, as most do."""
        as_before = (fold.state, fold.is_strained) == (self.state, self.is_strained)
        return as_before and not self.has_moved(fold)

    def has_moved(self, fold: SessionFold) -> bool:
        """Return whether phase, goal or what is in the plan's way are others since then."""
        return (
            fold.phase_index != self.phase_index
            or fold.goal != self.goal
            or fold.obstacle != self.obstacle
        )

    def changed_by_step(self, fold: SessionFold) -> list[str]:
        """Return what a step has changed by the plan's own rules, as kinds of changes."""
        if self.is_still_so(fold):
            return []
        has_paused = self.state is State.RUNNING and fold.state is not State.RUNNING
        changed = {
            ChangeKind.PHASE: fold.phase_index != self.phase_index,
            ChangeKind.GOAL: fold.goal != self.goal,
            ChangeKind.PAUSE: has_paused,
        }
        return [kind for kind, has_changed in changed.items() if has_changed]


def events_of_step(
    fold: SessionFold,
    before: Before,
    step: ScoredStep,
    audiences: Iterable[Audience],
    received_at: datetime | None = None,
    *,
    live: bool,
) -> list[LiveEvent]:
    """Return the events of a step that was just scored; see `step_event`."""
    events = [step_event(fold, before.context, step, audiences, received_at, live=live)]
    if before.is_still_so(fold):
        return events
    only_adapted = fold.following.moved and fold.phase_index == before.phase_index
    if before.has_moved(fold) and not only_adapted:
        events.append(phase_event(fold, switched=len(fold.valences.switches) > before.switches))
    elif fold.is_strained != before.is_strained:
        events.append(cue_event(fold))
    changed = before.changed_by_step(fold)
    return events + [change_event(fold, kind) for kind in changed if kind != ChangeKind.PHASE]


def events_of_change(fold: SessionFold, before: Before, change: Change) -> list[LiveEvent]:
    """Return the events of a change that was just applied."""
    if len(fold.valences.switches) > before.switches:
        return [phase_event(fold, switched=True)]
    return [change_event(fold, change.kind, change.value)]
