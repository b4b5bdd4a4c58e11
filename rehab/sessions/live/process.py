"""The process that serves: its interpreter's settings, its end in time, its database's log."""

from __future__ import annotations

import asyncio
import faulthandler
import gc
import logging
import os
import sys
import threading
from collections import Counter
from collections.abc import Collection
from typing import Any

from django.db import DatabaseError, connection

log = logging.getLogger(__name__)

# Python's full collections take 200 ms with 2,000 sockets (docs/reference/stack.md#live-path): make
# them rare. One of 50,000 young objects takes 15 to 30 ms while 1,000 sessions begin, of 5,000 at
# most 9 ms (docs/performance.md).
GC_THRESHOLDS = (5_000, 500, 100)
# How long a thread may hold the interpreter's lock while another one wants it (default 5 ms). The
# event loop of daphne gives it up at each system call: while a thread computes a page, each step
# takes so long several times (docs/performance.md#while-strangers-try-to-sign-in).
SWITCH_S = 0.0002
STOP_S = 30.0  # more than a stuck database may hold up the writer
CANCEL_AGAIN_S = 0.2


def end_in_time() -> None:
    """End the process if stopping takes too long, and log what it waited for.

    Nothing acknowledged is lost by that. Called on the event loop.
    """
    loop = asyncio.get_running_loop()

    def end() -> None:
        try:
            log.critical("The server could not stop within %g s and ends now.", STOP_S)
            waiting = Counter(map(_describe_wait, asyncio.all_tasks(loop)))
            for place, count in waiting.most_common():
                log.critical("%s task(s) waited in %s", count, place)
            faulthandler.dump_traceback()
        finally:
            os._exit(1)

    timer = threading.Timer(STOP_S, end)
    timer.daemon = True
    timer.start()


def _describe_wait(task: asyncio.Task[Any]) -> str:
    """Return where a task waits: its functions and their lines, the innermost last."""
    places: list[str] = []
    waiting: Any = task.get_coro()
    while getattr(waiting, "cr_frame", None) is not None:
        places.append(f"{waiting.__qualname__} ({waiting.cr_frame.f_lineno})")
        waiting = waiting.cr_await
    return " > ".join(places)


def tune_interpreter() -> None:
    """Make pauses by the garbage collector and by the writer's wait for the lock rare."""
    sys.setswitchinterval(SWITCH_S)
    gc.collect()
    gc.freeze()
    gc.set_threshold(*GC_THRESHOLDS)


def move_database_log() -> None:
    """Checkpoint SQLite's write-ahead log on its own connection, so that commits go on."""
    if connection.vendor != "sqlite":
        return
    try:
        with connection.cursor() as cursor:
            cursor.execute("PRAGMA wal_checkpoint(PASSIVE)")
    except DatabaseError as problem:
        log.warning("The database's log could not be moved: %s", problem)
    finally:
        connection.close()


async def end_tasks(tasks: Collection[asyncio.Task[Any]]) -> None:
    """Cancel tasks, again and again until all have ended; their errors are dropped.

    A task may lose a cancellation: ``asyncio.wait_for`` of Python 3.11 does where what it waits for
    is done in the same turn of the event loop.
    """
    while pending := [task for task in tasks if not task.done()]:
        for task in pending:
            task.cancel()
        await asyncio.wait(pending, timeout=CANCEL_AGAIN_S)
    await asyncio.gather(*tasks, return_exceptions=True)
