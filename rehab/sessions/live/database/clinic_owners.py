"""Ownership of clinics: which process writes their sessions. Each claim raises a fencing token.

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
from typing import NamedTuple

from django.conf import settings
from django.db import connection
from django.db.models import Exists, OuterRef

from rehab.sessions.live.database import server_lease
from rehab.sessions.live.database.server_lease import VALID, Server
from rehab.sessions.log import noted_end
from rehab.sessions.models import TrainingSession
from rehab.sessions.ownership import ClinicOwner
from rehab.training.changes import State

PROC_DIR = Path("/proc")
HANDED_ON = "handed on"  # the owner of a clinic that was released while sessions ran
FREE = ("", HANDED_ON)
# Of servers: by the index of owners. It costs what dead servers had, whatever others have.
LEFT_BY_SERVERS = f"""
SELECT clinic_id, owner, EXISTS (SELECT 1 FROM rehab_server WHERE id = %(own)s AND {VALID})
FROM rehab_clinicowner
WHERE owner = ANY (ARRAY(
    SELECT id FROM rehab_server WHERE NOT ({VALID}) UNION ALL SELECT %(handed_on)s
))
"""  # noqa: S608
# Also of those that have no lease at all: a database may be a copy, or older than they are.
LEFT_BY_ANY = f"""
WITH valid AS MATERIALIZED (SELECT id FROM rehab_server WHERE {VALID})
SELECT clinic_id, owner, EXISTS (SELECT 1 FROM valid WHERE id = %(own)s) FROM rehab_clinicowner
WHERE owner NOT IN ('', %(own)s) AND NOT EXISTS (SELECT 1 FROM valid WHERE id = owner)
"""  # noqa: S608
LEFT_BY_PROCESSES = """
SELECT clinic_id, owner, false FROM rehab_clinicowner WHERE owner NOT IN ('', %(own)s)
"""


class OwnedElsewhere(RuntimeError):
    """Another process has the clinic. ``server``: its address for the proxy, if it is a server."""

    def __init__(self, owner: str, server: str = "") -> None:
        super().__init__(
            f"The clinic's sessions are run by another process ({owner.split('|')[1]}). Wait until "
            "it has ended, or stop that process."
            if "|" in owner
            else "The clinic's sessions are run by another server. Try again in a moment."
        )
        self.server = server


class Claim(NamedTuple):
    """A clinic that this process has claimed.

    Attributes
    ----------
    epoch
        Under which it writes.
    running
        The clinic's sessions that run.
    is_orphaned
        Whether the process that had the clinic died; else it had released it.
    """

    clinic_id: int
    epoch: int
    running: list[int]
    is_orphaned: bool


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
    if (own := server_lease.held()) is not None:
        return own.id
    return _name(os.getpid(), _own_start_time(os.getpid()))


def process_name(pid: int) -> str:
    """Return the name of a process of this machine, for `is_alive`."""
    return _name(pid, _start_time(pid))


def _name(pid: int, started: str) -> str:
    return f"{socket.gethostname()}|{pid}|{started}"


def is_alive(owner: str, servers: Collection[Server] | None = None) -> bool:
    """Return whether an owner's process runs, or that cannot be known.

    ``servers``: those whose lease is valid, if they were read already.
    """
    own = server_lease.held()
    if owner and settings.HOSTED and "|" not in owner:
        valid = server_lease.valid_servers() if servers is None else servers
        valid_ids = {server.id for server in valid}
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


def _has_leases() -> bool:
    return settings.HOSTED and connection.vendor == "postgresql"


def find_elsewhere(clinic_id: int, owner: str | None = None) -> OwnedElsewhere | None:
    """Return who has a clinic, or is to have it, where that is not this process.

    ``owner``: as it is stored, if it was read already.
    """
    if owner is None:
        rows = ClinicOwner.everywhere.filter(pk=clinic_id)
        owner = rows.values_list("owner", flat=True).first() or ""
    servers = server_lease.valid_servers() if _has_leases() else []
    if owner in FREE and server_lease.held() is not None:
        place = server_lease.find_place(clinic_id, servers)
        owner = own_name() if place is None else place.id
    if owner in (*FREE, own_name()) or not is_alive(owner, servers):
        return None
    addresses = {server.id: server.address for server in servers}
    return OwnedElsewhere(owner, addresses.get(owner, ""))


def claim(clinic_id: int) -> Claim:
    """Make this process the writer of a clinic's sessions.

    Of several that try at once one succeeds. Raises OwnedElsewhere while another process has the
    clinic, or a clinic that nobody has belongs to another server.
    """
    ClinicOwner.everywhere.get_or_create(pk=clinic_id)
    while True:
        row = ClinicOwner.everywhere.get(pk=clinic_id)
        if (problem := find_elsewhere(clinic_id, row.owner)) is not None:
            raise problem
        still = ClinicOwner.everywhere.filter(pk=clinic_id, epoch=row.epoch, owner=row.owner)
        # Else another one was faster, or has just released it in order.
        if still.update(epoch=row.epoch + 1, owner=own_name()):
            there = TrainingSession.everywhere.filter(clinic=clinic_id, state=State.RUNNING.value)
            running = list(there.order_by("pk").values_list("pk", flat=True))
            return Claim(clinic_id, row.epoch + 1, running, row.owner not in (*FREE, own_name()))


def note_ends(session_ids: Collection[int]) -> None:
    """Note where the logs of these sessions end."""
    TrainingSession.everywhere.filter(pk__in=session_ids).update(last_number=noted_end())


def release(clinic_ids: Collection[int]) -> None:
    """Release clinics that this process has, so that any other can claim them."""
    held = ClinicOwner.everywhere.filter(pk__in=clinic_ids, owner=own_name())
    running = TrainingSession.everywhere.filter(clinic=OuterRef("pk"), state=State.RUNNING.value)
    held.filter(Exists(running)).update(owner=HANDED_ON)
    held.update(owner="")


def find_taken(epochs: dict[int, int]) -> set[int]:
    """Return the clinics, given with their epochs, that another process has claimed since."""
    stored = dict(ClinicOwner.everywhere.filter(pk__in=epochs).values_list("pk", "epoch"))
    return {key for key, epoch in epochs.items() if stored.get(key) != epoch}


def find_ownerless(*, thorough: bool = True) -> tuple[list[int], list[int]]:
    """Return the clinics whose process died, and those that one released while sessions ran.

    One statement, however many servers there are and whatever they have. ``thorough``: also where
    the dead one has left no lease.
    """
    statement = LEFT_BY_PROCESSES
    if has_leases := _has_leases():
        statement = LEFT_BY_ANY if thorough else LEFT_BY_SERVERS
    with connection.cursor() as cursor:
        cursor.execute(statement, {"own": own_name(), "handed_on": HANDED_ON})
        left = sorted(cursor.fetchall())
    own = server_lease.held()
    may_judge = own is None or (own.may_judge and any(is_valid for _, _, is_valid in left))

    def is_dead(owner: str) -> bool:
        return may_judge if has_leases and "|" not in owner else not is_alive(owner)

    dead = {owner for _, owner, _ in left if owner != HANDED_ON and is_dead(owner)}
    orphaned = [key for key, owner, _ in left if owner in dead]
    return orphaned, [key for key, owner, _ in left if owner == HANDED_ON]


def belongs_here(clinic_id: int) -> bool:
    """Return whether it is this process's to take a clinic that was left."""
    own = server_lease.held()
    place = server_lease.find_place(clinic_id, own.servers) if own is not None else None
    return place is None or place.id == own_name()
