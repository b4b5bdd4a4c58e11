"""Writes the log, with group commits.

One thread writes for all sessions of the process. As soon as a commit is done it commits all that
is queued by then: no timer, so that a fast disk answers at once and a slow one gets larger batches
(measured against a timer: docs/reference/stack.md#durability). Only while several sessions walk,
commits begin at least ``SPACING_S`` apart: each costs as much as twenty rows do, and a turn of the
event loop (docs/performance.md). A session that walks alone may wait for each ack.
"""

from __future__ import annotations

import logging
import threading
import time
from collections import deque
from collections.abc import Callable
from queue import Empty, SimpleQueue
from weakref import WeakSet

from django.db import DEFAULT_DB_ALIAS, close_old_connections, connection, connections

from rehab.sessions.live.database.own_connection import own_connection
from rehab.sessions.live.database.trouble import Trouble, classify_failure, concerns_all
from rehab.sessions.live.session.commit_transaction import EarlierWriteFailed, Job, commit
from rehab.sessions.live.session.prometheus_metrics import (
    DELIVERY_S,
    WRITE_FAILURES,
    measure_commit,
)

log = logging.getLogger(__name__)

MAX_ROWS = 5000  # rows a transaction
SPACING_S = 0.012  # between the beginnings of commits while several sessions walk
LATE_COMMIT_S = 1.0  # a commit that takes longer is reported to people and robots
CLOSE_S = 20.0  # how long a stop waits for a database that does not answer
# Of the writer's own connection to PostgreSQL: what waits longer has failed, and is reported.
LOCK_TIMEOUT_MS = 3_000
STATEMENT_TIMEOUT_MS = 10_000
ALONE_LOCK_TIMEOUT_MS = 200  # of one session's rows, after a batch has failed


class Writer:
    """The thread that commits. ``call`` schedules a function on the event loop, thread-safely."""

    def __init__(self, call: Callable[[Callable[[], None]], object]) -> None:
        self._call = call
        self._queue: SimpleQueue[Job | None] = SimpleQueue()
        self._failed: WeakSet[object] = WeakSet()  # owners that have a gap now
        self._finished: deque[tuple[Job, Exception | None]] = deque()
        self._is_report_due = False
        self._closed = False
        self._busy_since_s: float | None = None
        self._next_commit_s = 0.0  # not before
        self._last_session: int | None = None  # of the last commit, if it was one session's
        self._failure = Trouble.NONE  # of the last batch
        # A daemon: a database that never answers must not prevent the process from ending.
        self._thread = threading.Thread(target=self._run, name="garry-writer", daemon=True)
        self._thread.start()

    @property
    def backlog(self) -> int:
        """Number of jobs in the queue."""
        return self._queue.qsize()

    @property
    def trouble(self) -> Trouble:
        """Why nothing is stored at present, if that is so."""
        since_s = self._busy_since_s
        if since_s is not None and time.monotonic() - since_s > LATE_COMMIT_S:
            return Trouble.LATE
        return self._failure

    def submit(self, job: Job) -> None:
        """Queue a job without waiting. After ``close`` it fails at once."""
        if self._closed:
            self._finish([(job, EarlierWriteFailed("The server is stopping."))])
        else:
            self._queue.put(job)

    def close(self) -> None:
        """Commit what is queued, then end the thread and wait for that, but not for ever."""
        self._closed = True
        self._queue.put(None)
        self._thread.join(CLOSE_S)
        if self._thread.is_alive():
            log.error(
                "The database does not answer: %s job(s) were not stored, and not acknowledged",
                self.backlog,
            )

    def _run(self) -> None:
        try:
            connections[DEFAULT_DB_ALIAS] = own_connection(LOCK_TIMEOUT_MS, STATEMENT_TIMEOUT_MS)
            more = True
            while more:
                jobs: list[Job] = []
                try:
                    more = self._collect(jobs)
                    if jobs:
                        self._busy_since_s = began_s = time.monotonic()
                        self._write(jobs)
                        self._next_commit_s = 0.0 if self._is_alone(jobs) else began_s + SPACING_S
                except Exception as problem:  # a fault of ours: it must not end the thread
                    self._fail(jobs, problem)
                self._busy_since_s = None
        finally:
            connection.close()

    def _collect(self, jobs: list[Job]) -> bool:
        """Wait for a job and add all that are queued; return whether the thread goes on."""
        job = self._queue.get()
        if job is None:
            return False
        jobs.append(job)
        early_s = self._next_commit_s - time.monotonic()
        if early_s > 0:
            time.sleep(early_s)  # meanwhile more is queued
        rows = len(job.rows)
        while rows < MAX_ROWS:
            try:
                job = self._queue.get_nowait()
            except Empty:
                break
            if job is None:
                return False
            jobs.append(job)
            rows += len(job.rows)
        return True

    def _is_alone(self, jobs: list[Job]) -> bool:
        """Return whether the last two commits were of one and the same session."""
        before, first = self._last_session, jobs[0].session_id
        self._last_session = first if all(job.session_id == first for job in jobs) else None
        return self._last_session is not None and self._last_session == before

    def _write(self, jobs: list[Job]) -> None:
        results: list[tuple[Job, Exception | None]]
        try:
            if any(job.owner in self._failed for job in jobs):
                raise EarlierWriteFailed
            self._commit(jobs)
            results = [(job, None) for job in jobs]
            self._failure = Trouble.NONE
        except Exception as problem:  # any: all sessions depend on this thread
            WRITE_FAILURES.inc()
            close_old_connections()
            if concerns_all(problem):
                self._fail(jobs, problem)
                return
            results = self._write_each(jobs)
        self._finish(results)

    def _commit(self, jobs: list[Job]) -> None:
        sessions = len({job.session_id for job in jobs})
        with measure_commit(sessions, sum(len(job.rows) for job in jobs)):
            commit(jobs)

    def _fail(self, jobs: list[Job], problem: Exception) -> None:
        log.error("Nothing could be stored", exc_info=problem)
        self._failure = classify_failure(problem)
        self._failed.update(job.owner for job in jobs)
        self._finish([(job, problem) for job in jobs])

    def _write_each(self, jobs: list[Job]) -> list[tuple[Job, Exception | None]]:
        """Write each job alone, so that the failure of one affects no other session."""
        _set_lock_timeout(ALONE_LOCK_TIMEOUT_MS)
        try:
            return [(job, self._write_alone(job)) for job in jobs]
        finally:
            _set_lock_timeout(LOCK_TIMEOUT_MS)

    def _write_alone(self, job: Job) -> Exception | None:
        """Write one job alone. Return the error."""
        if job.owner in self._failed:
            return EarlierWriteFailed("An earlier write of this session failed.")
        try:
            self._commit([job])
        except Exception as problem:
            log.exception("Session %s could not be written", job.session_id)
            self._failed.add(job.owner)
            return problem
        return None

    def _finish(self, results: list[tuple[Job, Exception | None]]) -> None:
        """Report jobs on the event loop: all that are finished by its next turn at once."""
        self._finished.extend(results)
        if not self._is_report_due:
            self._is_report_due = True
            self._call(self._report)

    def _report(self) -> None:
        self._is_report_due = False  # first: what is finished from here on reports again
        while self._finished:
            job, problem = self._finished.popleft()
            try:
                job.done(problem)
            except (
                Exception
            ):  # the others' steps are stored, and their sources wait for the acknowledgment
                log.exception("Session %s could not be notified of what was stored", job.session_id)
            if job.came_s and problem is None:
                DELIVERY_S.observe(time.monotonic() - job.came_s)


def _set_lock_timeout(milliseconds: int) -> None:
    if connection.vendor == "postgresql":
        try:
            with connection.cursor() as cursor:
                cursor.execute(f"SET lock_timeout = {milliseconds:d}")
        except Exception:
            log.warning("The database does not take a timeout", exc_info=True)
