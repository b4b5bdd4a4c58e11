"""Writes the log: what was committed here has happened, and nothing else has.

One thread writes for all sessions of the process. It commits whatever is queued the moment that the
last commit is done: no timer, so that a fast disk answers at once and a slow one takes larger
batches (measured against a timer: docs/reference/stack.md#durability).
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

from rehab.sessions.live.actor import Row, StepRow, Summary
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
    """Give the values of rows, one after the other, in the order of ``STEP_COLUMNS``."""
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
    """Another process has taken the session over; this one may write nothing more to it."""


class Refolded(RuntimeError):
    """An earlier write of the same session failed, so that this one would leave a gap."""


@dataclass(frozen=True, slots=True, eq=False)
class Job:
    """Rows of one session that belong together.

    ``owner`` is the object whose rows these are: once a job of it has failed, none of its later
    ones is written. ``done`` is called on the event loop, with the error or None.
    """

    owner: object
    session_id: int
    epoch: int
    rows: Sequence[Row]
    summary: Summary | None
    done: Callable[[Exception | None], None]


def commit(jobs: Sequence[Job]) -> None:
    """Write jobs, in their order, in one transaction.

    Raises Fenced where one of the sessions has another owner, and what the database raises, for
    example IntegrityError for a step number that is taken; then nothing of it is written.
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
            _tell({row.session_id for row in metrics})


def _tell(sessions: set[int]) -> None:
    """Let those who live by sessions' figures follow. Their trouble is theirs: steps are kept."""
    try:
        with transaction.atomic():
            figures_stored.send(TrainingSession, sessions=sessions)
    except Exception:
        log.exception("Boards did not follow sessions %s; run manage.py rebuildboards", sessions)


def _check_epochs(expected: dict[int, int]) -> None:
    marks = ", ".join(["%s"] * len(expected))
    # SQLite's transaction is alone already; elsewhere nobody may take a session over meanwhile.
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

    One statement a row (``executemany``) gives the interpreter's lock away at each of them and
    waits for the event loop to hand it back: at 1,000 sessions that took seconds.
    """
    if not rows:
        return
    mark = "?" if connection.vendor == "sqlite" else "%s"
    with connection.wrap_database_errors, closing(connection.connection.cursor()) as cursor:
        for first in range(0, len(rows), STEPS_A_STATEMENT):
            chunk = rows[first : first + STEPS_A_STATEMENT]
            cursor.execute(_insert_statement(len(chunk), mark), _step_values(chunk))


class Writer:
    """The thread that commits. ``call`` hands a function to the event loop, thread-safely."""

    def __init__(self, call: Callable[[Callable[[], None]], object]) -> None:
        self._call = call
        self._queue: SimpleQueue[Job | None] = SimpleQueue()
        self._failed: set[int] = set()  # id() of owners; they stay referenced in `_keep`
        self._keep: list[object] = []
        self._closed = False
        self._thread = threading.Thread(target=self._run, name="garry-writer")
        self._thread.start()

    @property
    def backlog(self) -> int:
        """How many jobs wait."""
        return self._queue.qsize()

    def submit(self, job: Job) -> None:
        """Queue a job; never waits. After ``close`` it fails at once."""
        if self._closed:
            self._call(lambda: job.done(Refolded("The server is stopping.")))
        else:
            self._queue.put(job)

    def close(self) -> None:
        """Commit what is queued, then end the thread. Waits for it."""
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
        """Wait for a job and take along what else is there."""
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
        sound = [job for job in jobs if id(job.owner) not in self._failed]
        results: list[tuple[Job, Exception | None]]
        try:
            if len(sound) < len(jobs):
                raise Refolded
            commit(jobs)
            results = [(job, None) for job in jobs]
        except Exception:  # whatever it is, the thread goes on: all sessions depend on it
            close_old_connections()
            results = [(job, self._write_alone(job)) for job in jobs]
        self._call(lambda: _report(results))

    def _write_alone(self, job: Job) -> Exception | None:
        """Write one job, so that one bad session harms no other. Give the error."""
        if id(job.owner) in self._failed:
            return Refolded("An earlier write of this session failed.")
        try:
            commit([job])
        except Exception as problem:
            log.exception("Session %s could not be written", job.session_id)
            self._failed.add(id(job.owner))
            self._keep.append(job.owner)
            return problem
        return None


def _report(results: list[tuple[Job, Exception | None]]) -> None:
    for job, problem in results:
        job.done(problem)
