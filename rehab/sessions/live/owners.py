"""Which process writes a session: it puts its name there, and shuts out the one before."""

from __future__ import annotations

import os
import socket
import subprocess
from functools import cache
from pathlib import Path

from django.conf import settings

from rehab.sessions.models import TrainingSession
from rehab.training.changes import State

PROCESSES = Path("/proc")
# What the one before may have written since the session was read.
FOLLOWING = ("state", "started_at", "ended_at")


class OwnedElsewhere(RuntimeError):
    """Another process on this machine is running the session; the message says which."""


def _started(pid: int) -> str:
    """Give a process's start time, so that a number used again is not taken for the old one."""
    try:
        if PROCESSES.is_dir():
            return (PROCESSES / str(pid) / "stat").read_text().rpartition(")")[2].split()[19]
        # macOS has no such folder. The same words for whoever asks, wherever that is.
        variables = os.environ | {"LC_ALL": "C", "TZ": "UTC"}
        command = ["ps", "-o", "lstart=", "-p", str(pid)]
        said = subprocess.run(command, env=variables, capture_output=True, text=True, check=False)
        return " ".join(said.stdout.split())
    except (OSError, IndexError):
        return ""


@cache
def _my_start(pid: int) -> str:
    return _started(pid)


def my_name() -> str:
    """Give this process's name among owners."""
    return f"{socket.gethostname()}|{os.getpid()}|{_my_start(os.getpid())}"


def is_alive(owner: str) -> bool:
    """Say whether an owner still runs. Those on other hosted machines are taken to."""
    try:
        host, pid, started = owner.split("|")
    except ValueError:
        return False
    if host != socket.gethostname():
        # One machine may have been given another name; only hosted servers share a database.
        return bool(settings.HOSTED)
    try:
        os.kill(int(pid), 0)
    except ProcessLookupError:
        return False
    except PermissionError:
        pass
    return _started(int(pid)) == started


def claim(session: TrainingSession) -> str:
    """Make this process the session's writer; give the owner before, if any.

    Of several that try at once one succeeds. Raises OwnedElsewhere while another one has it.
    """
    while True:
        before = session.owner
        if before and before != my_name() and is_alive(before):
            raise OwnedElsewhere(
                f"Session {session.pk} is run by another process ({before.split('|')[1]}). "
                "Wait until it has ended, or stop that process."
            )
        still = TrainingSession.everywhere.filter(pk=session.pk, epoch=session.epoch)
        if still.update(epoch=session.epoch + 1, owner=my_name()):
            session.epoch, session.owner = session.epoch + 1, my_name()
            session.refresh_from_db(fields=FOLLOWING)
            return before
        session.refresh_from_db(fields=["epoch", "owner"])  # another process was quicker


def release(session_id: int, epoch: int) -> None:
    """Give the session up, so that any process may take it."""
    TrainingSession.everywhere.filter(pk=session_id, epoch=epoch).update(owner="")


def release_all(held: list[tuple[int, int]]) -> None:
    """Give up sessions, each with its epoch."""
    for session_id, epoch in held:
        release(session_id, epoch)


def find_left_running() -> list[int]:
    """Give the sessions that run and that no process has."""
    running = TrainingSession.everywhere.filter(state=State.RUNNING.value)
    return [one.pk for one in running if not one.owner or not is_alive(one.owner)]
