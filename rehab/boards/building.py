"""Builds boards of many patients beside everything else: by a thread that works a little at a time.

SQLite lets one writer in at a time, and what patients walk must be stored meanwhile: a step's
commit waits for one batch at most. How far it has come is stored with each batch (`entries.py`), so
that a server that was stopped goes on where it was; several may build at once. A board is not shown
before it is built.
"""

from __future__ import annotations

import atexit
import logging
import threading
import time

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
            while self._is_to_go_on():
                board_id = entries.find_unbuilt()
                if board_id is not None:
                    self._build(board_id)
        except Exception:  # a look at the board, or the next start, tries again
            log.exception("A board could not be built")
            with self._lock:
                self._thread = None
        finally:
            connection.close()

    def _is_to_go_on(self) -> bool:
        with self._lock:
            if self._ends.is_set() or not (self._is_wanted or entries.find_unbuilt()):
                self._thread = None
                return False
            self._is_wanted = False
            return True

    def _build(self, board_id: int) -> None:
        most, more = FIRST, True
        while more and not self._ends.is_set():
            began = time.perf_counter()
            more = entries.advance(board_id, most, timezone.now())
            held_s = time.perf_counter() - began
            most = max(FEWEST, min(MOST, round(most * min(2.0, HOLD_S / held_s))))
            self._ends.wait(max(held_s, PAUSE_S))
        if not more:
            entries.tidy()


builder = Builder()
atexit.register(builder.stop)


def rebuild(board: Leaderboard) -> None:
    """Have a board's rows made anew: those of a few patients here and now, more beside."""
    if len(entries.next_patients(board, 0, FEW + 1)) <= FEW:
        entries.refresh(board)
    else:
        entries.begin(board)
        transaction.on_commit(lambda: builder.wake())  # noqa: PLW0108 (looked up when it is time)
