"""Running the load against a server of a bench."""

from __future__ import annotations

import json
import resource
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import psutil

from tests.support.servers import ROOT, Server, clean_environment, free_port

BUSY_MS = 5.0  # a relay that is slower than that measures the machine


def seed(server: Server, count: int) -> list[dict[str, Any]]:
    """Make so many running sessions in a server's database; give ids and tokens."""
    made = subprocess.run(
        [sys.executable, "-m", "tests.support.live_seed", str(count)],
        cwd=ROOT,
        env=clean_environment(server.folder, server.port)
        | {"DJANGO_SETTINGS_MODULE": "garry_site.settings"},
        capture_output=True,
        text=True,
        check=True,
    )
    rows: list[dict[str, Any]] = json.loads(made.stdout)
    return rows


def drive(
    mode: str,
    port: int,
    pid: int,
    rows: Path,
    viewers: int,
    *,
    seconds: float = 6.0,
    slices: int = 1,
    seen: Path | None = None,
) -> dict[str, Any]:
    """Run the load against a server; add what the server's process spent for each step.

    ``slices``: of that time, each with its latencies, its end and the memory then. ``seen``: where
    a watched server (watched.py) writes what it saw, which is added, too.
    """
    program = [sys.executable, "tests/bench/load.py", mode, str(port), str(rows)]
    process = subprocess.Popen(
        [*program, f"--viewers={viewers}", f"--seconds={seconds}", f"--slices={slices}"],
        cwd=ROOT,
        stdout=subprocess.PIPE,
        text=True,
    )
    assert process.stdout is not None
    server, spent, first_rss, result = psutil.Process(pid), 0.0, 0, {}
    ends: list[tuple[float, float]] = []
    for line in process.stdout:
        times = server.cpu_times()
        used = times.user + times.system
        if line == "measure\n":
            spent, first_rss = used, server.memory_info().rss
            if seen is not None:
                server.send_signal(signal.SIGUSR1)
        elif line == "slice\n":
            ends.append((time.monotonic(), server.memory_info().rss / 1e6))
        elif line == "measured\n":
            spent = used - spent
            if seen is not None:
                server.send_signal(signal.SIGUSR2)
        else:
            result = json.loads(line)
    process.stdout.close()
    assert process.wait() == 0
    result["us_per_step"] = 1e6 * spent / result["steps"]
    result["rss_mb"] = server.memory_info().rss / 1e6
    result["first_rss_mb"] = first_rss / 1e6
    for part, (ended, mb) in zip(result["slices"], ends, strict=True):
        part |= {"ended": ended, "rss_mb": mb}
    if seen is not None:
        result |= json.loads(seen.read_text())
    return result


def allow_many_files() -> None:
    """Let this process and its children open as many sockets as the machine allows."""
    _, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (hard, hard))


@contextmanager
def relay() -> Iterator[tuple[int, int]]:
    """Run a bare relay, which stores nothing; give its port and process."""
    port = free_port()
    process = subprocess.Popen(
        [sys.executable, "tests/bench/relay.py", str(port)],
        cwd=ROOT,
        stdout=subprocess.PIPE,
        text=True,
    )
    assert process.stdout is not None
    try:
        assert process.stdout.readline() == "Ready\n"
        yield port, process.pid
    finally:
        process.kill()
        process.wait()
        process.stdout.close()
