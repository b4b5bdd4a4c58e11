"""The lease of a hosted server: others own nothing of it while it is valid.

A row each, renewed every second by a thread with a connection of its own, and judged by the
database's clock alone: names of hosts and numbers of processes mean nothing.
"""

from __future__ import annotations

import logging
import threading
import time
import uuid
from collections.abc import Collection
from contextlib import contextmanager
from hashlib import sha256
from typing import TYPE_CHECKING, Any, NamedTuple

from django.db import DatabaseError, InterfaceError, connection

from rehab.sessions.live.database.own_connection import own_connection

if TYPE_CHECKING:
    from collections.abc import Iterator

    from django.db.backends.base.base import BaseDatabaseWrapper

log = logging.getLogger(__name__)

LEASE_S = 5.0  # after so long without a renewal a server's clinics are taken over
RENEW_S = 1.0
PULSE_MAX_S = 1.0  # the age of the event loop's last pulse, beyond which a lease is not renewed
TIMEOUT_MS = 2_000  # a database that is stuck

# A lease that ends later than any server asks for is from before the database's clock was set back.
VALID = f"""
expires_at > clock_timestamp()
AND expires_at < clock_timestamp() + {2 * LEASE_S} * interval '1 second'
"""
ENTER = """
INSERT INTO rehab_server (id, address, ready, expires_at)
VALUES (%(id)s, %(address)s, %(ready)s, clock_timestamp() + %(for)s * interval '1 second')
ON CONFLICT (id) DO UPDATE SET ready = EXCLUDED.ready, expires_at = EXCLUDED.expires_at
"""
RENEW = f"""
UPDATE rehab_server
SET ready = %(ready)s, expires_at = clock_timestamp() + %(for)s * interval '1 second'
WHERE id = %(id)s AND {VALID}
"""  # noqa: S608
FORGET = """
DELETE FROM rehab_server WHERE expires_at
NOT BETWEEN clock_timestamp() - interval '1 hour' AND clock_timestamp() + interval '1 hour'
"""
SERVERS = f"SELECT id, address, ready FROM rehab_server WHERE {VALID}"  # noqa: S608


class Server(NamedTuple):
    """A server: its id, the address by which a proxy reaches it, and whether it takes clinics."""

    id: str
    address: str
    ready: bool


_held: Lease | None = None


def held() -> Lease | None:
    """Return this process's lease; None in commands, and where one process is the clinic."""
    return _held


def valid_servers() -> list[Server]:
    """Return the servers whose lease is valid."""
    with connection.cursor() as cursor:
        cursor.execute(SERVERS)
        return [Server(*row) for row in cursor.fetchall()]


def find_place(clinic_id: int, servers: Collection[Server]) -> Server | None:
    """Return the server that a clinic belongs to while nobody has it; None where none is ready.

    By rendezvous hashing: all servers agree without a word, and where one comes or goes only its
    share of the clinics moves.
    """

    def weigh(server: Server) -> tuple[bytes, str]:
        return sha256(f"{clinic_id} {server.address}".encode()).digest(), server.id

    return max((server for server in servers if server.ready), key=weigh, default=None)


class Lease:
    """A server's lease, renewed by a thread of its own until the process ends.

    Parameters
    ----------
    address
        How a proxy reaches the server: host and port.
    """

    def __init__(self, address: str) -> None:
        self.id = uuid.uuid4().hex
        self.address = address
        self.is_ready = False  # for clinics; others learn of it with the next renewal
        self.entered = 0  # how often: more than once where it expired meanwhile
        self.servers: list[Server] = []  # that were valid when it was renewed last
        self._connection: BaseDatabaseWrapper | None = None
        self._renewed_s = 0.0  # by the monotonic clock
        self._unbroken_since_s = 0.0
        self._pulse_s: float | None = None  # of the event loop, once there is one
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._renew, name="garry-lease", daemon=True)

    @property
    def is_current(self) -> bool:
        """Whether it was renewed in time, as far as this process knows."""
        return time.monotonic() - self._renewed_s < LEASE_S

    @property
    def may_judge(self) -> bool:
        """Whether others that did not renew theirs are gone, and not the database of all of us.

        After an outage each server renews its lease within a second; until then none is gone.
        """
        now_s = time.monotonic()
        return self.is_current and now_s - self._unbroken_since_s > 2 * RENEW_S

    def may_judge_by(self, valid_ids: Collection[str]) -> bool:
        """Return whether servers that are not among the valid ones are gone.

        Where this one is not among them either, the database's clock was set: all leases expired
        at once, and each server renews its own within a second.
        """
        return self.may_judge and self.id in valid_ids

    def show_pulse(self) -> None:
        """Note that the event loop turns: without it this server does nothing for its clinics."""
        self._pulse_s = time.monotonic()

    def acquire(self) -> None:
        """Enter, then stay. Raises DatabaseError where nothing answers."""
        global _held  # noqa: PLW0603 (one lease a process)
        self._enter()
        _held = self
        self._thread.start()

    def release(self) -> None:
        """End the lease, so that no server has to wait until it expires."""
        global _held  # noqa: PLW0603
        self._closing.set()
        if self._thread.is_alive():
            self._thread.join(TIMEOUT_MS / 1000 + RENEW_S)
        try:
            self._execute("DELETE FROM rehab_server WHERE id = %(id)s")
        except (DatabaseError, InterfaceError):
            log.warning("The server's lease expires by itself.", exc_info=True)
        self._disconnect()
        if _held is self:
            _held = None

    def _renew(self) -> None:
        while not self._closing.wait(RENEW_S):
            began_s = time.monotonic()
            if self._pulse_s is not None and began_s - self._pulse_s > PULSE_MAX_S:
                log.warning("The event loop is silent: the server's lease is not renewed.")
                continue
            try:
                if self._execute(RENEW):
                    self._renewed_s = began_s
                else:
                    self._enter()
                self._read_servers()
            except (DatabaseError, InterfaceError) as problem:
                log.warning("The server's lease could not be renewed: %s", problem)
                self._disconnect()

    def _enter(self) -> None:
        """Write the row."""
        began_s = time.monotonic()
        self._execute(FORGET)
        self._execute(ENTER)
        self.entered += 1  # first: what others took meanwhile is dropped before robots move again
        self._renewed_s = self._unbroken_since_s = began_s
        self._read_servers()

    def _read_servers(self) -> None:
        with self._cursor() as cursor:
            cursor.execute(SERVERS)
            self.servers = [Server(*row) for row in cursor.fetchall()]

    def _execute(self, statement: str) -> int:
        given = {"id": self.id, "address": self.address, "ready": self.is_ready, "for": LEASE_S}
        with self._cursor() as cursor:
            cursor.execute(statement, given)
            return int(cursor.rowcount)

    @contextmanager
    def _cursor(self) -> Iterator[Any]:
        if self._connection is None:
            self._connection = own_connection(TIMEOUT_MS, TIMEOUT_MS)
            self._connection.inc_thread_sharing()  # begun by one thread, renewed by another
        try:
            with self._connection.cursor() as cursor:
                yield cursor
        except (DatabaseError, InterfaceError):
            self._disconnect()
            raise

    def _disconnect(self) -> None:
        if self._connection is not None:
            self._connection.close()
            self._connection = None
