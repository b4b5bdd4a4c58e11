"""Builds boards of many patients beside everything else: by a thread that works a little at a time.

SQLite lets one writer in at a time, and what patients walk must be stored meanwhile: a step's
commit waits for one batch at most. How far it has come is stored with each batch (`entries.py`), so
that a server that was stopped goes on where it was; several may build at once. A board is not shown
before it is built, nor while many of its rows are those of another day.
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

from rehab.boards import entries
from rehab.boards.models import Leaderboard

log = logging.getLogger(__name__)

FEW = 50  # patients whose rows are made while a page waits
HOLD_S = 0.015  # what a batch should take; its size follows from what the last one took
# Between two batches [s]. Who waits for SQLite looks every 5 to 25 ms.
PAUSE_S = 0.025
FIRST, FEWEST, MOST = 20, 10, 1_000  # patients a batch


# Works off so many patients at most, as of now; gives whether there are more.
Step = Callable[[int, datetime], bool]


class Builder:
    """One thread at most, while there is something to build."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._thread: threading.Thread | None = None
        self._ends = threading.Event()
        self._is_wanted = False

    def wake(self) -> None:
        """Build what is to be built, soon. Never waits."""
        with self._lock:
            self._is_wanted = True
            if self._thread is None and not self._ends.is_set():
                self._thread = threading.Thread(target=self._run, name="garry-boards", daemon=True)
                self._thread.start()

    def stop(self) -> None:
        """End after the batch at hand; another server, or the next start, goes on."""
        self._ends.set()
        with self._lock:
            thread = self._thread
        if thread is not None:
            thread.join()

    def _run(self) -> None:
        try:
            while (step := self._next()) is not None:
                self._go(step)
        except Exception:  # a look at the board, or the next start, tries again
            log.exception("A board could not be built")
            with self._lock:
                self._thread = None
        finally:
            connection.close()

    def _next(self) -> Step | None:
        """Give what is to be done. Looks again where somebody asked meanwhile."""
        while True:
            with self._lock:
                if self._ends.is_set() or not self._is_wanted:
                    self._thread = None
                    return None
                self._is_wanted = False
            step = find_step(timezone.now())
            if step is not None:
                with self._lock:
                    self._is_wanted = True  # there may be more after it
                return step

    def _go(self, step: Step) -> None:
        most, more = FIRST, True
        while more and not self._ends.is_set():
            began = time.perf_counter()
            more = step(most, timezone.now())
            held_s = time.perf_counter() - began
            most = max(FEWEST, min(MOST, round(most * min(2.0, HOLD_S / held_s))))
            self._ends.wait(max(held_s, PAUSE_S))
        if not more:
            entries.tidy()


def find_step(now: datetime) -> Step | None:
    """Give what works off so many patients of a board that is to be built, or caught up with."""
    board_id = entries.find_unbuilt()
    if board_id is not None:
        return partial(entries.advance, board_id)
    outdated = entries.find_outdated(now, FEW)
    if outdated is not None:
        return partial(entries.refresh_stale, outdated)
    return None


builder = Builder()
atexit.register(builder.stop)


def rebuild(board: Leaderboard, now: datetime) -> None:
    """Have a board's rows made anew: those of a few patients here and now, more beside."""
    if len(entries.next_patients(board, 0, FEW + 1)) <= FEW:
        entries.refresh(board, now=now)
    else:
        _begin(board)


def follow(board: Leaderboard, now: datetime, patients: set[int] | None = None) -> None:
    """Let a board follow what decides who may stand on it: for some patients, or (None) all."""
    if patients is not None and len(patients) <= FEW:
        entries.refresh(board, patients, now=now)
    elif entries.is_snapshot(board, now):
        entries.thin_out(board)
    else:
        rebuild(board, now)


def heal(patients: set[int], now: datetime) -> None:
    """Have the boards built that did not follow what some patients walked."""
    for board in entries.boards_of(entries.clinics_of(patients)):
        if not entries.is_snapshot(board, now):
            _begin(board)


def catch_up(board: Leaderboard, now: datetime) -> bool:
    """Bring the rows up to date that time has altered; False where those are many: they are then
    made beside, and the board is not shown meanwhile.
    """
    stale = entries.find_stale(board, now, FEW + 1)
    if len(stale) > FEW:
        builder.wake()
        return False
    if stale:
        entries.refresh(board, stale, now=now, corrected=True)
    return True


def _begin(board: Leaderboard) -> None:
    entries.begin(board)
    transaction.on_commit(lambda: builder.wake())  # noqa: PLW0108 (looked up when it is time)
