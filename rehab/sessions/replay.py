"""Replaying a session's log: its committed steps and changes, folded in their order."""

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
    """Fold a session's log; give the fold.

    What could not have been (a second pause, say) is passed over, and logged: it altered nothing
    then, and a log that is refused for it would shut everyone out of all else that it holds.
    """
    passed_over: list[str] = []
    for entry in read_log(session):
        try:
            if isinstance(entry, Change):
                fold.change(entry)
            else:
                fold.step(entry)
        except (InvalidSetting, InvalidMeasurement) as problem:
            passed_over.append(f"{entry}: {problem}")
    if passed_over:
        log.warning(
            "The log of session %s holds what could not have been (%d times); the first: %s",
            session.pk,
            len(passed_over),
            passed_over[0],
        )
    return fold


def read_log(session: TrainingSession) -> Iterator[Measurement | Change]:
    """Give a session's committed steps and changes in the order in which they took effect."""
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
    """Give back what the source said of a stride; scored again, it gets the verdict it has."""
    return Measurement(
        number=step.number,
        time_s=step.time_s,
        side=Side(step.side),
        value=step.value,
        reasons=tuple(step.reasons),
        extra=step.extra,
    )
