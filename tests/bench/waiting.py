"""What the machine itself makes everybody wait for: its disk and its processor.

A floor for latencies that hang on them, measured beside the run.
"""

from __future__ import annotations

import math
import os
import statistics
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

EVERY_S = 0.1
PAGE = bytes(8192)  # as PostgreSQL writes its log


class Waits:
    """How long each of many calls took from when it was due (`time.monotonic`).

    A call that was due while the one before it hung counts from then, so that a stall of a second
    is not one slow call among many quick ones.
    """

    def __init__(self) -> None:
        self._waits: list[tuple[float, float]] = []

    def p99_ms(self, begin: float = -math.inf, end: float = math.inf) -> float:
        """Return the 99 % of the calls that were due from ``begin`` to ``end``."""
        waited_s = [waited for due, waited in self._waits if begin <= due < end]
        return 1000 * statistics.quantiles(waited_s, n=100, method="inclusive")[98]

    @contextmanager
    def repeat(self, call: Callable[[], object]) -> Iterator[None]:
        """Call it each 0.1 s, in a thread, until the block ends."""
        ended = threading.Event()

        def run() -> None:
            due = time.monotonic()
            while not ended.wait(due - time.monotonic()):
                call()
                self._waits.append((due, time.monotonic() - due))
                due += EVERY_S

        thread = threading.Thread(target=run)
        thread.start()
        try:
            yield
        finally:
            ended.set()
            thread.join()


@contextmanager
def watch_machine(folder: Path) -> Iterator[tuple[Waits, Waits]]:
    """Yield how long the folder's disk takes to keep a page, and the processor to come."""
    disk, processor = Waits(), Waits()
    path = folder / f"disk probe {os.getpid()}"
    file = os.open(path, os.O_RDWR | os.O_CREAT)

    def keep() -> None:
        os.pwrite(file, PAGE, 0)
        os.fdatasync(file)

    try:
        keep()
        with disk.repeat(keep), processor.repeat(lambda: None):
            yield disk, processor
    finally:
        os.close(file)
        path.unlink()
