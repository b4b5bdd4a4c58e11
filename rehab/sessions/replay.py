"""Replay of a session's log: its committed steps and changes, folded in their order."""

from __future__ import annotations

import logging
from collections.abc import Iterator

from rehab.sessions.log import SessionEvent, Step
from rehab.sessions.models import TrainingSession
from rehab.training.changes import Change
from rehab.training.controls import CONTROLS
from rehab.training.fold import SessionFold
from rehab.training.measures import InvalidSetting
from rehab.training.steps import InvalidMeasurement, Measurement, Side

log = logging.getLogger(__name__)


def fold_log(fold: SessionFold, session: TrainingSession) -> SessionFold:
    """Fold a session's log and return the fold.

    Impossible entries (such as a second pause) are skipped with a warning: they had no effect when
    they were stored, and refusing the log would make the rest of the session unreadable.
    """
    skipped: list[str] = []
    for entry in log_entries(session):
        try:
            if isinstance(entry, Change):
                fold.change(entry)
            else:
                fold.step(entry)
        except (InvalidSetting, InvalidMeasurement) as problem:
            skipped.append(f"{entry}: {problem}")
    if skipped:
        log.warning(
            "Skipped %d impossible entries in the log of session %s; the first: %s",
            len(skipped),
            session.pk,
            skipped[0],
        )
    return fold


def log_entries(session: TrainingSession) -> Iterator[Measurement | Change]:
    """Return a session's committed steps and changes in the order in which they took effect."""
    changes = SessionEvent.everywhere.filter(session=session, kind__in=list(CONTROLS))
    events = list(changes.order_by("pk"))
    events.reverse()
    number = 0
    for step in Step.everywhere.filter(session=session).order_by("number").iterator():
        while events and events[-1].after_number <= number:
            yield _to_change(events.pop())
        yield to_measurement(step)
        number = step.number
    while events:
        yield _to_change(events.pop())


def _to_change(event: SessionEvent) -> Change:
    return Change(event.kind, event.data.get("value", event.value))


def to_measurement(step: Step) -> Measurement:
    """Return a step as its source sent it; scoring it again gives the stored verdict."""
    return Measurement(
        number=step.number,
        time_s=step.time_s,
        side=Side(step.side),
        value=step.value,
        reasons=tuple(step.reasons),
        extra=step.extra,
    )
