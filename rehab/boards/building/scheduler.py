"""Rebuilding boards: of a few patients at once, of many in a thread in batches of patients.

The thread also lets boards follow the sessions that have ended (``boards_due``).

SQLite allows one writer at a time, and steps must be stored meanwhile: a step's commit waits for
one batch at most. The progress is stored with each batch (`entries.py`), so that a server that was
stopped goes on where it was; several may build at once. A board is not shown before it is built,
nor while many of its rows are of an earlier day.
"""

from __future__ import annotations

import atexit
import logging
import threading
import time
from collections.abc import Callable
from datetime import datetime
from functools import partial

from django.db import connection, transaction
from django.utils import timezone

from rehab.boards.building import entries
from rehab.boards.models import Leaderboard
from rehab.sessions.models import TrainingSession

log = logging.getLogger(__name__)

MAX_INLINE = 50  # patients whose rows are computed while a page waits
BATCH_S = 0.015  # the aim for a batch; its size follows from how long the last one took
# Between two batches [s]. Writers that wait for SQLite try again every 5 to 25 ms.
PAUSE_S = 0.025
FIRST_SIZE, MIN_SIZE, MAX_SIZE = 20, 10, 1_000  # patients a batch

# Builds a number of patients at most, as of a moment; returns whether there are more.
Work = Callable[[int, datetime], bool]


class BoardBuilder:
    """Builds boards in a thread, which runs only while there is something to build."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._thread: threading.Thread | None = None
        self._stopping = threading.Event()
        self._is_wanted = False

    def wake(self) -> None:
        """Start the thread if there may be something to build. Never waits."""
        with self._lock:
            self._is_wanted = True
            if self._thread is None and not self._stopping.is_set():
                self._thread = threading.Thread(target=self._run, name="garry-boards", daemon=True)
                self._thread.start()

    def stop(self) -> None:
        """Stop after the current batch; another server, or the next start, goes on."""
        self._stopping.set()
        with self._lock:
            thread = self._thread
        if thread is not None:
            thread.join()

    def _run(self) -> None:
        try:
            while (work := self._find_work()) is not None:
                self._run_batches(work)
        except Exception:  # the next page with the board, or the next start, tries again
            log.exception("A board could not be built")
            with self._lock:
                self._thread = None
        finally:
            connection.close()

    def _find_work(self) -> Work | None:
        """Return what is to be built; None, and the thread ends, where there is nothing.

        If ``wake`` was called meanwhile, it looks again.
        """
        while True:
            with self._lock:
                if self._stopping.is_set() or not self._is_wanted:
                    self._thread = None
                    return None
                self._is_wanted = False
            work = find_work(timezone.now())
            if work is not None:
                with self._lock:
                    self._is_wanted = True  # there may be more after it
                return work

    def _run_batches(self, work: Work) -> None:
        size, more = FIRST_SIZE, True
        while more and not self._stopping.is_set():
            began = time.perf_counter()
            more = work(size, timezone.now())
            held_s = time.perf_counter() - began
            size = max(MIN_SIZE, min(MAX_SIZE, round(size * min(2.0, BATCH_S / held_s))))
            self._stopping.wait(max(held_s, PAUSE_S))
        if not more:
            entries.analyze_tables()


def find_work(now: datetime) -> Work | None:
    """Return the work that builds or updates a board; None where there is none."""
    if find_ended(1):
        return follow_sessions
    board_id = entries.find_unbuilt()
    if board_id is not None:
        return partial(entries.build_next, board_id)
    outdated = entries.find_outdated(now, MAX_INLINE)
    if outdated is not None:
        return partial(entries.refresh_stale, outdated)
    return None


def find_ended(limit: int) -> dict[int, int]:
    """Return sessions that have ended and that boards do not have yet, with their patients."""
    due = TrainingSession.everywhere.filter(boards_due=True).order_by("pk")
    return dict(due.values_list("pk", "patient_id")[:limit])


def follow_sessions(limit: int, now: datetime) -> bool:
    """Bring boards up to date with sessions that have ended; return whether there are more.

    Each board is a transaction of its own. What is done twice, after a crash or beside another
    process, comes out the same. Boards that cannot follow are rebuilt.
    """
    ended = find_ended(limit)
    patients = set(ended.values())
    try:
        entries.refresh_patients(patients, now=now)
    except Exception:
        log.exception(
            "Boards could not be updated after sessions %s. They are rebuilt in the background; if "
            "that fails too, run manage.py rebuildboards",
            sorted(ended),
        )
        rebuild_after_failure(patients, now)
    TrainingSession.everywhere.filter(pk__in=ended).update(boards_due=False)
    return len(ended) == limit


board_builder = BoardBuilder()
atexit.register(board_builder.stop)


def rebuild(board: Leaderboard, now: datetime) -> None:
    """Rebuild a board's rows: those of a few patients now, more in the thread."""
    if len(entries.next_patients(board, 0, MAX_INLINE + 1)) <= MAX_INLINE:
        entries.refresh(board, now=now)
    else:
        _rebuild_in_thread(board)


def update_eligibility(board: Leaderboard, now: datetime, patients: set[int] | None = None) -> None:
    """Update a board after a change of who is eligible: some patients, or (None) any of them."""
    if patients is not None and len(patients) <= MAX_INLINE:
        entries.refresh(board, patients, now=now)
    elif entries.is_snapshot(board, now):
        entries.drop_ineligible(board)
    else:
        rebuild(board, now)


def rebuild_after_failure(patients: set[int], now: datetime) -> None:
    """Rebuild the boards that could not be updated after sessions of some patients."""
    for board in entries.boards_of(entries.clinics_of(patients)):
        if not entries.is_snapshot(board, now):
            _rebuild_in_thread(board)


def catch_up(board: Leaderboard, now: datetime) -> bool:
    """Bring the rows of an earlier day up to date; return whether they are.

    Many rows are left to the thread: the board is not shown meanwhile.
    """
    if find_ended(1):  # the page was quicker than the thread
        follow_sessions(MAX_INLINE, now)
    stale = entries.find_stale(board, now, MAX_INLINE + 1)
    if len(stale) > MAX_INLINE:
        board_builder.wake()
        return False
    if stale:
        entries.refresh(board, stale, now=now, corrected=True)
    return True


def _rebuild_in_thread(board: Leaderboard) -> None:
    entries.start_rebuild(board)
    transaction.on_commit(lambda: board_builder.wake())  # noqa: PLW0108 (tests replace `wake`)
