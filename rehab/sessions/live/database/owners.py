"""Ownership of sessions: which process writes one. Each claim raises the epoch, a fencing token.

Hosted servers are named by their lease; elsewhere, and for commands, the process itself is asked
for.
"""

from __future__ import annotations

import os
import socket
import subprocess
from collections.abc import Collection
from functools import cache
from pathlib import Path

from django.conf import settings
from django.db import connection

from rehab.sessions.live.database import lease
from rehab.sessions.log import noted_end
from rehab.sessions.models import TrainingSession
from rehab.training.changes import State

PROC_DIR = Path("/proc")
HANDED_ON = "handed on"  # the owner of a session that runs, whose process was stopped in order
# The previous owner may have written these since the session was read.
WRITTEN_BY_OWNER = ("checkpoint", "last_number", "state", "started_at", "ended_at")


LEFT = """
SELECT id, owner, false FROM rehab_trainingsession
WHERE owner > '' AND owner <> %(own)s AND state = %(running)s
"""
# Without those of servers whose lease is valid; and whether this one's is.
LEFT_BY_SERVERS = f"""
SELECT id, owner, EXISTS (SELECT 1 FROM rehab_server WHERE id = %(own)s AND {lease.VALID})
FROM rehab_trainingsession
WHERE owner > '' AND owner <> %(own)s AND state = %(running)s
AND NOT EXISTS (SELECT 1 FROM rehab_server WHERE id = owner AND {lease.VALID})
"""  # noqa: S608


class OwnedElsewhere(RuntimeError):
    """Another process is running the session; the message names it. ``owner``: its name."""

    def __init__(self, session_id: int, owner: str) -> None:
        super().__init__(
            f"Session {session_id} is run by another process ({owner.split('|')[1]}). Wait until "
            "it has ended, or stop that process."
            if "|" in owner
            else f"Session {session_id} is run by another server. Try again in a moment."
        )
        self.owner = owner


def _start_time(pid: int) -> str:
    """Return a process's start time, which distinguishes it from a later one with the same id."""
    try:
        if PROC_DIR.is_dir():
            return (PROC_DIR / str(pid) / "stat").read_text().rpartition(")")[2].split()[19]
        # macOS has no /proc. The output must not depend on who asks, or where.
        variables = os.environ | {"LC_ALL": "C", "TZ": "UTC"}
        command = ["ps", "-o", "lstart=", "-p", str(pid)]
        listed = subprocess.run(command, env=variables, capture_output=True, text=True, check=False)
        return " ".join(listed.stdout.split())
    except (OSError, IndexError):
        return ""


@cache
def _own_start_time(pid: int) -> str:
    return _start_time(pid)


def own_name() -> str:
    """Return the name that this process writes as owner."""
    if (own := lease.held()) is not None:
        return own.id
    return f"{socket.gethostname()}|{os.getpid()}|{_own_start_time(os.getpid())}"


def is_alive(owner: str) -> bool:
    """Return whether an owner's process runs, or that cannot be known."""
    own = lease.held()
    if owner and settings.HOSTED and owner != HANDED_ON and "|" not in owner:
        valid_ids = {server.id for server in lease.valid_servers()}
        return owner in valid_ids or not (own is None or own.may_judge_by(valid_ids))
    try:
        host, pid, started = owner.split("|")
    except ValueError:
        return False
    if host != socket.gethostname():
        # A hosted server's command on another machine; else the machine was renamed.
        return settings.HOSTED and own is None
    try:
        os.kill(int(pid), 0)
    except ProcessLookupError:
        return False
    except PermissionError:
        pass
    return _start_time(int(pid)) == started


def claim(session: TrainingSession) -> str:
    """Make this process the session's writer; return the previous owner, if any.

    Of several that try at once one succeeds. Raises OwnedElsewhere while another process runs it.
    """
    while True:
        previous = session.owner
        if previous and previous != own_name() and is_alive(previous):
            raise OwnedElsewhere(session.pk, previous)
        still = TrainingSession.everywhere.filter(pk=session.pk, epoch=session.epoch)
        if still.update(epoch=session.epoch + 1, owner=own_name()):
            session.epoch, session.owner = session.epoch + 1, own_name()
            session.refresh_from_db(fields=WRITTEN_BY_OWNER)
            return previous
        session.refresh_from_db(fields=["epoch", "owner"])  # another process was faster


def release(session_id: int, epoch: int) -> None:
    """Release the session, so that any process can claim it."""
    held = TrainingSession.everywhere.filter(pk=session_id, epoch=epoch)
    held.update(owner="", last_number=noted_end())


def hand_on(session_id: int, epoch: int) -> bool:
    """Release a session for another process that waits for it; False where it is not ours now."""
    held = TrainingSession.everywhere.filter(pk=session_id, epoch=epoch, owner=own_name())
    running = held.filter(state=State.RUNNING.value)
    end = noted_end()
    return bool(running.update(owner=HANDED_ON, last_number=end)) or bool(
        held.update(owner="", last_number=end)
    )


def release_all(held: Collection[int]) -> None:
    """Release the sessions that this process has; hand those on that run."""
    own = TrainingSession.everywhere.filter(pk__in=held, owner=own_name())
    own.filter(state=State.RUNNING.value).update(owner=HANDED_ON, last_number=noted_end())
    own.update(owner="", last_number=noted_end())


def find_ownerless() -> tuple[list[int], list[int]]:
    """Return the running sessions whose process died, and those that one handed on.

    One statement, however many servers there are and whatever they run.
    """
    has_leases = settings.HOSTED and connection.vendor == "postgresql"
    with connection.cursor() as cursor:
        names = {"own": own_name(), "running": State.RUNNING.value}
        cursor.execute(LEFT_BY_SERVERS if has_leases else LEFT, names)
        left = sorted(cursor.fetchall())
    own = lease.held()
    may_judge = own is None or (own.may_judge and any(is_valid for _, _, is_valid in left))

    def is_dead(owner: str) -> bool:
        return may_judge if has_leases and "|" not in owner else not is_alive(owner)

    dead = {owner for _, owner, _ in left if owner != HANDED_ON and is_dead(owner)}
    orphaned = [key for key, owner, _ in left if owner in dead]
    return orphaned, [key for key, owner, _ in left if owner == HANDED_ON]
