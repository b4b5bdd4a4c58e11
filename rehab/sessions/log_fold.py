"""Replay of a session's log: its committed steps and changes, folded in their order."""

from __future__ import annotations

import logging
from collections.abc import Collection, Iterable, Iterator
from dataclasses import fields
from datetime import datetime
from typing import Any, NamedTuple

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
    """Fold a session's log, from the fold's last step on, and return the fold."""
    return fold_entries(fold, session.pk, log_entries(session, fold.last_number))


def fold_entries(
    fold: SessionFold, session_id: int, entries: Iterable[Measurement | Change]
) -> SessionFold:
    """Fold entries of a log and return the fold.

    Impossible entries (such as a second pause) are skipped with a warning: they had no effect when
    they were stored, and refusing the log would make the rest of the session unreadable. What comes
    follows a hole is not folded, since its score cannot be known; that is logged as an error.
    """
    skipped: list[str] = []
    try:
        for entry in entries:
            try:
                if isinstance(entry, Change):
                    fold.change(entry)
                else:
                    fold.step(entry)
            except (InvalidSetting, InvalidMeasurement) as problem:
                skipped.append(f"{entry}: {problem}")
    except DamagedLog as problem:
        log.error("%s", str(problem))  # not the error, which holds the query that was under way
    if skipped:
        log.warning(
            "Skipped %d impossible entries in the log of session %s; the first: %s",
            len(skipped),
            session_id,
            skipped[0],
        )
    return fold


def log_entries(session: TrainingSession, after: int = 0) -> Iterator[Measurement | Change]:
    """Return a session's committed steps and changes in the order in which they took effect.

    ``after``: those after this step, which was the last thing that happened. Raises DamagedLog
    where a step is missing.
    """
    changes = SessionEvent.everywhere.filter(
        session=session, kind__in=list(CONTROLS), after_number__gte=after
    ).order_by("pk")
    steps = Step.everywhere.filter(session=session, number__gt=after).order_by("number")
    stored = steps.values_list(*MEASURED).iterator()
    return merge_entries(session.pk, after, stored, list(changes))


def merge_entries(
    session_id: int, after: int, steps: Iterable[StoredMeasurement], changes: list[SessionEvent]
) -> Iterator[Measurement | Change]:
    """Return steps (their columns ``MEASURED``) and changes in the order in which they took effect.

    Both in the order of the log, behind step ``after``. Raises DamagedLog where a step is missing.
    """
    for _, entry in _merge(session_id, after, ((None, *step) for step in steps), changes):
        yield entry if isinstance(entry, Measurement) else to_change(entry)


def log_rows(
    session: TrainingSession, kinds: Iterable[str]
) -> Iterator[tuple[datetime, Measurement | SessionEvent]]:
    """Return a session's committed steps and its events of these kinds, by our clock, in order.

    Errors: as in ``log_entries``.
    """
    chosen = SessionEvent.everywhere.filter(session=session, kind__in=list(kinds))
    steps = Step.everywhere.filter(session=session).order_by("number")
    stored = steps.values_list("received_at", *MEASURED).iterator()
    return _merge(session.pk, 0, stored, list(chosen.order_by("pk")))


def _merge(
    session_id: int, after: int, steps: Iterable[tuple[Any, ...]], events: list[SessionEvent]
) -> Iterator[tuple[Any, Measurement | SessionEvent]]:
    """Return steps, each with what stands before its columns, and events with their time."""
    waiting, number = events[::-1], after
    for received_at, *stored in steps:
        while waiting and waiting[-1].after_number <= number:
            yield waiting[-1].at, waiting.pop()
        step = to_measurement(*stored)
        if step.number != number + 1:
            raise DamagedLog(describe_hole(session_id, number, step.number))
        yield received_at, step
        number = step.number
    while waiting:
        yield waiting[-1].at, waiting.pop()


def check_log(session: TrainingSession) -> int:
    """Return the last number of a log that has every step. Raises DamagedLog for any other."""
    return check_end(session, count_steps([session.pk])[session.pk])


class StoredSteps(NamedTuple):
    """How many steps are stored of a session, and the number of the last one."""

    steps: int
    last: int


def count_steps(session_ids: Collection[int]) -> dict[int, StoredSteps]:
    """Return what is stored of each session."""
    steps = Step.everywhere.filter(session__in=session_ids).order_by().values_list("session")
    found = {key: StoredSteps(*ends) for key, *ends in steps.annotate(Count("pk"), Max("number"))}
    return {key: found.get(key, StoredSteps(0, 0)) for key in session_ids}


def check_end(session: TrainingSession, stored: StoredSteps) -> int:
    """Return the last number of a log, given what is stored. Raises DamagedLog if steps lack."""
    last = max(stored.last, session.last_number)
    if stored.steps != last:
        raise DamagedLog(describe_hole(session.pk, stored.steps, last))
    return last


def describe_hole(session_id: int, before: int, after: int) -> str:
    """Return what is missing of a log, with the cure."""
    return (
        f"The log of session {session_id} has a hole: steps between {before} and {after} were "
        "stored and are not there. Restore a backup that has them, or set up a new session."
    )


def to_change(event: SessionEvent) -> Change:
    """Return a stored change as it was made."""
    return Change(event.kind, event.data.get("value", event.value))


# What a source sent of a step. Plain rows: a model's object for each would take most of the time.
MEASURED = tuple(field.name for field in fields(Measurement))
StoredMeasurement = tuple[Any, ...]


def to_measurement(
    number: int, time_s: float, side: str, value: float | None, reasons: list[str], *rest: Any
) -> Measurement:
    """Return a step (its columns ``MEASURED``) as its source sent it; scoring it again gives the
    stored verdict.
    """
    return Measurement(number, time_s, Side(side), value, tuple(reasons), *rest)
