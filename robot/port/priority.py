"""The priority of a process that must not wait for others, and how long this computer lets one."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from robot.motion.limits import ORDER_HOLDS_S, TICK_S

PACKAGES = Path(__file__).parents[2]

# Above every ordinary program, below the kernel's own threads (50).
REALTIME = 10
NICE = -10
JITTER_TICKS = 100
# A stop may come this much later without the sums of docs/safety.md being wrong [s] (ours).
MUCH_S = 0.05


def raise_priority() -> str:
    """Set the highest priority that the rights allow, for this process and those that it forks.

    Returns
    -------
    str
        ``real-time``, ``raised`` or ``ordinary``.
    """
    with suppress(OSError, AttributeError):  # not every system has it
        os.sched_setscheduler(0, os.SCHED_RR, os.sched_param(REALTIME))
        return "real-time"
    with suppress(OSError, AttributeError):
        os.setpriority(os.PRIO_PROCESS, 0, NICE)
        return "raised"
    return "ordinary"


def find_priority() -> str:
    """Return what ``raise_priority`` would give a process, as it is called."""
    look = "from robot.port.priority import raise_priority; print(raise_priority())"
    command = [sys.executable, "-c", look]
    done = subprocess.run(command, cwd=PACKAGES, capture_output=True, text=True, check=True)
    return done.stdout.strip()


def measure_jitter(monotonic: Callable[[], float], sleep: Callable[[float], object]) -> float:
    """Return how much longer than asked for a pause of a tick takes at most [s].

    Parameters
    ----------
    monotonic, sleep
        The computer's clock [s], and how to wait by it.
    """
    worst_s = 0.0
    for _ in range(JITTER_TICKS):
        began_s = monotonic()
        sleep(TICK_S)
        worst_s = max(worst_s, monotonic() - began_s - TICK_S)
    return worst_s


def explain_jitter(worst_s: float) -> str:
    """Return the cure for pauses that are longer than asked for; empty where none is needed."""
    if worst_s <= MUCH_S:
        return ""
    if worst_s <= ORDER_HOLDS_S:
        means = "Each stop may come so much later"
    else:
        means = f"A gesture ends by itself after {1000 * ORDER_HOLDS_S:g} ms without an order"
    return f"{means}. Close other programs, or give GARRY priority (/help/robot/)."
