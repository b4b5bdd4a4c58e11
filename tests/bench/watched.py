"""`manage.py serve`, watched: commits, stalls of the event loop, garbage collections, its threads.

`python -m tests.bench.watched FILE serve …`: SIGUSR1 begins anew, SIGUSR2 writes what was seen so
far into the file (JSON, ms; of threads, seconds of processor time).
"""

from __future__ import annotations

import asyncio
import gc
import json
import os
import signal
import sys
import threading
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

LOOP_S = 0.005  # between looks at the event loop
now = time.perf_counter


def measure_threads() -> dict[str, float]:
    """Return the processor time that each thread of Python's has taken, by name [s]."""
    return {
        thread.name: time.clock_gettime(time.pthread_getcpuclockid(thread.ident))
        for thread in threading.enumerate()
        if thread.ident is not None
    }


class Watch:
    """What happened in the process since it was asked to begin anew."""

    def __init__(self) -> None:
        self.begin()

    def begin(self, *_: Any) -> None:
        """Forget everything."""
        self.commits_s: list[float] = []
        self.jobs = 0
        self.stall_s = self.pause_s = 0.0
        self.pause_began = now()
        self.spent_s = measure_threads()

    def write(self, path: Path) -> None:
        """Write what was seen."""
        ordered = sorted(self.commits_s) or [0.0]
        seen = {
            "commits": len(self.commits_s),
            "rows_a_commit": self.jobs / max(1, len(self.commits_s)),
            "commit_p50_ms": 1000 * ordered[len(ordered) // 2],
            "commit_p99_ms": 1000 * ordered[int(len(ordered) * 0.99)],
            "stall_ms": 1000 * self.stall_s,
            "gc_ms": 1000 * self.pause_s,
            "threads_s": {
                name: spent - self.spent_s.get(name, 0.0)
                for name, spent in measure_threads().items()
            },
        }
        whole = path.with_suffix(".part")
        whole.write_text(json.dumps(seen))
        whole.replace(path)

    def see_collection(self, phase: str, _: Any) -> None:
        """Time a pause by the garbage collector."""
        if phase == "start":
            self.pause_began = now()
        else:
            self.pause_s = max(self.pause_s, now() - self.pause_began)

    async def see_loop(self) -> None:
        """Time how late the event loop is."""
        while True:
            before = now()
            await asyncio.sleep(LOOP_S)
            self.stall_s = max(self.stall_s, now() - before - LOOP_S)


def watch(path: Path) -> None:
    """Watch this process."""
    from rehab.sessions.live import process
    from rehab.sessions.live.session import group_commit
    from rehab.sessions.live.session.commit_transaction import commit

    seen, tune = Watch(), process.tune_interpreter

    def timed_commit(jobs: Sequence[Any]) -> None:
        began = now()
        commit(jobs)
        seen.commits_s.append(now() - began)
        seen.jobs += len(jobs)

    def tune_and_watch() -> None:
        tune()
        tasks.append(asyncio.get_running_loop().create_task(seen.see_loop()))

    tasks: list[asyncio.Task[None]] = []
    vars(group_commit).update(commit=timed_commit)
    vars(process).update(tune_interpreter=tune_and_watch)
    gc.callbacks.append(seen.see_collection)
    signal.signal(signal.SIGUSR1, seen.begin)
    signal.signal(signal.SIGUSR2, lambda *_: seen.write(path))


if __name__ == "__main__":
    os.environ.setdefault("DJANGO_SETTINGS_MODULE", "garry_site.settings")
    import django
    from django.core.management import execute_from_command_line

    django.setup()
    watch(Path(sys.argv[1]))
    execute_from_command_line(["manage.py", *sys.argv[2:]])
