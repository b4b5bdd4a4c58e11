"""Which process writes a session: it puts its name there, and shuts out the one before."""

from __future__ import annotations

import os
import socket
from pathlib import Path

from django.conf import settings
from django.db.models import F

from rehab.sessions.models import TrainingSession


class OwnedElsewhere(RuntimeError):
    """Another process on this machine is running the session; the message says which."""


def _started(pid: int) -> str:
    """Give a process's start time, so that a number used again is not taken for the old one."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[19]
    except (OSError, IndexError):
        return ""


def my_name() -> str:
    """Give this process's name among owners."""
    return f"{socket.gethostname()}|{os.getpid()}|{_started(os.getpid())}"


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


def claim(session: TrainingSession) -> None:
    """Make this process the session's writer. Raises OwnedElsewhere while another one is."""
    if session.owner and session.owner != my_name() and is_alive(session.owner):
        raise OwnedElsewhere(
            f"Session {session.pk} is run by another process ({session.owner.split('|')[1]}). "
            "Wait until it has ended, or stop that process."
        )
    TrainingSession.everywhere.filter(pk=session.pk).update(epoch=F("epoch") + 1, owner=my_name())
    session.refresh_from_db(fields=["epoch", "owner"])


def release(session_id: int, epoch: int) -> None:
    """Give the session up, so that any process may take it."""
    TrainingSession.everywhere.filter(pk=session_id, epoch=epoch).update(owner="")
