"""Replay of a session's log: its committed steps and changes, folded in their order."""

from __future__ import annotations

import logging
from collections.abc import Iterable, Iterator
from datetime import datetime

from django.db.models import Count, Max

from rehab.sessions.log import SessionEvent, Step
from rehab.sessions.models import TrainingSession
from rehab.training.changes import Change
from rehab.training.controls import CONTROLS
from rehab.training.fold import SessionFold
from rehab.training.measures import InvalidSetting
from rehab.training.steps import InvalidMeasurement, Measurement, Side

log = logging.getLogger(__name__)


class DamagedLog(RuntimeError):
    """A log lacks steps that were stored once; the message says which, and the cure."""


def fold_log(fold: SessionFold, session: TrainingSession) -> SessionFold:
    """Fold a session's log, from the fold's last step on, and return the fold.

    Impossible entries (such as a second pause) are skipped with a warning: they had no effect when
    they were stored, and refusing the log would make the rest of the session unreadable. What comes
    behind a hole is not folded: nobody knows what it was worth. That is logged as an error.
    """
    skipped: list[str] = []
    try:
        for entry in log_entries(session, fold.last_number):
            try:
                if isinstance(entry, Change):
                    fold.change(entry)
                else:
                    fold.step(entry)
            except (InvalidSetting, InvalidMeasurement) as problem:
                skipped.append(f"{entry}: {problem}")
    except DamagedLog as problem:
        log.error("%s", problem)
    if skipped:
        log.warning(
            "Skipped %d impossible entries in the log of session %s; the first: %s",
            len(skipped),
            session.pk,
            skipped[0],
        )
    return fold


def log_entries(session: TrainingSession, after: int = 0) -> Iterator[Measurement | Change]:
    """Return a session's committed steps and changes in the order in which they took effect.

    ``after``: those after this step, which was the last thing that happened. Raises DamagedLog
    where a step is missing.
    """
    for _, entry in log_rows(session, list(CONTROLS), after):
        yield entry if isinstance(entry, Measurement) else to_change(entry)


def log_rows(
    session: TrainingSession, kinds: Iterable[str], after: int = 0
) -> Iterator[tuple[datetime, Measurement | SessionEvent]]:
    """Return a session's committed steps and its events of these kinds, by our clock, in order.

    ``after``, errors: as in ``log_entries``.
    """
    chosen = SessionEvent.everywhere.filter(session=session, kind__in=list(kinds))
    events = list(chosen.filter(after_number__gte=after).order_by("pk"))
    events.reverse()
    number = after
    steps = Step.everywhere.filter(session=session, number__gt=after).order_by("number")
    for received_at, *stored in steps.values_list("received_at", *MEASURED).iterator():
        while events and events[-1].after_number <= number:
            yield events[-1].at, events.pop()
        step = _to_measurement(*stored)
        if step.number != number + 1:
            raise DamagedLog(describe_hole(session.pk, number, step.number))
        yield received_at, step
        number = step.number
    while events:
        yield events[-1].at, events.pop()


def check_log(session: TrainingSession) -> int:
    """Return the last number of a log that has every step. Raises DamagedLog for any other."""
    steps = Step.everywhere.filter(session=session)
    found = steps.aggregate(count=Count("pk"), last=Max("number"))
    last = max(found["last"] or 0, session.last_number)
    if found["count"] != last:
        raise DamagedLog(describe_hole(session.pk, found["count"], last))
    return last


def describe_hole(session_id: int, before: int, after: int) -> str:
    """Return what is missing of a log, with the cure."""
    return (
        f"The log of session {session_id} has a hole: steps between {before} and {after} were "
        "stored and are not there. Restore a backup that has them, or set up a new session."
    )


def to_change(event: SessionEvent) -> Change:
    """Return a change as its event records it."""
    return Change(event.kind, event.data.get("value", event.value))


# What a source sent of a step. Plain rows: a model's object for each would take most of the time.
MEASURED = ("number", "time_s", "side", "value", "reasons", "extra", "rules_version")


def _to_measurement(
    number: int,
    time_s: float,
    side: str,
    value: float | None,
    reasons: list[str],
    extra: dict[str, float],
    rules_version: int,
) -> Measurement:
    """Return a step as its source sent it; scoring it again gives the stored verdict."""
    return Measurement(number, time_s, Side(side), value, tuple(reasons), extra, rules_version)
