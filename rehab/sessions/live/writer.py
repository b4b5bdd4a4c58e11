"""Writes the log, with group commits.

One thread writes for all sessions of the process. As soon as a commit is done it commits all that
is queued by then: no timer, so that a fast disk answers at once and a slow one gets larger batches
(measured against a timer: docs/reference/stack.md#durability).
"""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import dataclass
from functools import lru_cache
from queue import Empty, SimpleQueue
from typing import Any

from django.db import close_old_connections, connection, transaction

from rehab.sessions.live.aggregate import Row, StepRow, Summary
from rehab.sessions.log import SessionEvent, SessionMetric, figures_stored
from rehab.sessions.models import TrainingSession

log = logging.getLogger(__name__)

MAX_ROWS = 5000  # rows a transaction

# Steps are the one table that is written many times a second. Plain rows spare the ORM's objects,
# compiler and wrappers: a headless run went from 7,400 to 18,800 steps/s with that alone.
STEP_COLUMNS = (
    "session_id",
    "number",
    "time_s",
    "received_at",
    "side",
    "value",
    "gain",
    "shown",
    "goal",
    "performance",
    "hit",
    "points",
    "valid",
    "reasons",
    "phase",
    "rules_version",
    "extra",
)
# SQLite takes 32,766 parameters a statement, PostgreSQL 65,535.
STEPS_A_STATEMENT = 500


def _step_values(rows: Sequence[StepRow]) -> list[Any]:
    """Return the values of rows as one flat list, each row in the order of ``STEP_COLUMNS``."""
    to_time = connection.ops.adapt_datetimefield_value
    to_json = connection.ops.adapt_json_value
    values: list[Any] = []
    for session_id, step, received_at in rows:
        values += (
            session_id,
            step.number,
            step.time_s,
            to_time(received_at),
            step.side.value,
            step.value,
            step.gain,
            step.shown,
            step.goal,
            step.performance,
            step.hit,
            step.points,
            step.valid,
            to_json(list(step.reasons), None),
            step.phase,
            step.rules_version,
            to_json(dict(step.extra), None),
        )
    return values


@lru_cache(maxsize=STEPS_A_STATEMENT)
def _insert_statement(count: int, mark: str) -> str:
    row = f"({', '.join([mark] * len(STEP_COLUMNS))})"
    columns = ", ".join(STEP_COLUMNS)
    return f"INSERT INTO rehab_step ({columns}) VALUES {', '.join([row] * count)}"  # noqa: S608


class Fenced(RuntimeError):
    """Another process has claimed the session; this one must not write to it."""


class EarlierWriteFailed(RuntimeError):
    """An earlier write of the session failed, so this one would leave a gap."""


@dataclass(frozen=True, slots=True, eq=False)
class Job:
    """Rows of one session, committed together.

    ``owner``: the object whose rows these are; after a failed job none of its later ones is
    written. ``done`` is called on the event loop with the error, or None.
    """

    owner: object
    session_id: int
    epoch: int
    rows: Sequence[Row]
    summary: Summary | None
    done: Callable[[Exception | None], None]


def commit(jobs: Sequence[Job]) -> None:
    """Write jobs, in their order, in one transaction.

    Raises Fenced if a session has another owner, and the database's errors, for example
    IntegrityError for a duplicate step number; nothing is written then.
    """
    with transaction.atomic():
        _check_epochs({job.session_id: job.epoch for job in jobs})
        _insert_steps([row for job in jobs for row in job.rows if isinstance(row, StepRow)])
        events = [row for job in jobs for row in job.rows if isinstance(row, SessionEvent)]
        if events:
            SessionEvent.everywhere.bulk_create(events)
        metrics = [row for job in jobs for row in job.rows if isinstance(row, SessionMetric)]
        if metrics:
            SessionMetric.everywhere.bulk_create(metrics)
        for job in jobs:
            if job.summary is not None:
                TrainingSession.everywhere.filter(pk=job.session_id).update(**job.summary)
        if metrics:
            _announce_figures({row.session_id for row in metrics})


def _announce_figures(sessions: set[int]) -> None:
    """Send ``figures_stored``; errors of its receivers are logged, the steps are kept."""
    try:
        with transaction.atomic():
            figures_stored.send(TrainingSession, sessions=sessions)
    except Exception:
        log.exception("Boards did not follow sessions %s; run manage.py rebuildboards", sessions)


def _check_epochs(expected: dict[int, int]) -> None:
    marks = ", ".join(["%s"] * len(expected))
    # Elsewhere than in SQLite, other transactions run at the same time: they must not claim it now.
    lock = "" if connection.vendor == "sqlite" else " FOR SHARE"
    with connection.cursor() as cursor:
        cursor.execute(
            f"SELECT id, epoch FROM rehab_trainingsession WHERE id IN ({marks}){lock}",  # noqa: S608
            list(expected),
        )
        if dict(cursor.fetchall()) != expected:
            raise Fenced("Another process has taken the session over.")


def _insert_steps(rows: Sequence[StepRow]) -> None:
    """Insert rows, many in a statement.

    One statement for each row (``executemany``) releases the interpreter's lock each time and waits
    for the event loop to return it: seconds at 1,000 sessions.
    """
    if not rows:
        return
    mark = "?" if connection.vendor == "sqlite" else "%s"
    with connection.wrap_database_errors, closing(connection.connection.cursor()) as cursor:
        for first in range(0, len(rows), STEPS_A_STATEMENT):
            chunk = rows[first : first + STEPS_A_STATEMENT]
            cursor.execute(_insert_statement(len(chunk), mark), _step_values(chunk))


class Writer:
    """The thread that commits. ``call`` schedules a function on the event loop, thread-safely."""

    def __init__(self, call: Callable[[Callable[[], None]], object]) -> None:
        self._call = call
        self._queue: SimpleQueue[Job | None] = SimpleQueue()
        self._failed: set[int] = set()  # id() of owners; they stay referenced in `_failed_owners`
        self._failed_owners: list[object] = []
        self._closed = False
        self._thread = threading.Thread(target=self._run, name="garry-writer")
        self._thread.start()

    @property
    def backlog(self) -> int:
        """Number of jobs in the queue."""
        return self._queue.qsize()

    def submit(self, job: Job) -> None:
        """Queue a job without waiting. After ``close`` it fails at once."""
        if self._closed:
            self._call(lambda: job.done(EarlierWriteFailed("The server is stopping.")))
        else:
            self._queue.put(job)

    def close(self) -> None:
        """Commit what is queued, then end the thread and wait for that."""
        self._closed = True
        self._queue.put(None)
        self._thread.join()

    def _run(self) -> None:
        try:
            more = True
            while more:
                jobs, more = self._next_jobs()
                if jobs:
                    self._write(jobs)
        finally:
            connection.close()

    def _next_jobs(self) -> tuple[list[Job], bool]:
        """Wait for a job; return all that are queued, and whether the thread goes on."""
        job = self._queue.get()
        jobs: list[Job] = []
        rows = 0
        while job is not None:
            jobs.append(job)
            rows += len(job.rows)
            if rows >= MAX_ROWS:
                return jobs, True
            try:
                job = self._queue.get_nowait()
            except Empty:
                return jobs, True
        return jobs, False

    def _write(self, jobs: list[Job]) -> None:
        writable = [job for job in jobs if id(job.owner) not in self._failed]
        results: list[tuple[Job, Exception | None]]
        try:
            if len(writable) < len(jobs):
                raise EarlierWriteFailed
            commit(jobs)
            results = [(job, None) for job in jobs]
        except Exception:  # any: all sessions depend on this thread
            close_old_connections()
            results = [(job, self._write_alone(job)) for job in jobs]
        self._call(lambda: _report(results))

    def _write_alone(self, job: Job) -> Exception | None:
        """Write one job alone, so that its failure affects no other session. Return the error."""
        if id(job.owner) in self._failed:
            return EarlierWriteFailed("An earlier write of this session failed.")
        try:
            commit([job])
        except Exception as problem:
            log.exception("Session %s could not be written", job.session_id)
            self._failed.add(id(job.owner))
            self._failed_owners.append(job.owner)
            return problem
        return None


def _report(results: list[tuple[Job, Exception | None]]) -> None:
    for job, problem in results:
        job.done(problem)
