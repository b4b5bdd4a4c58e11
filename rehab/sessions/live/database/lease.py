"""The lease of a hosted server: others own nothing of it while it is valid.

A row each, renewed every second by a thread with a connection of its own, and judged by the
database's clock alone: names of hosts and numbers of processes mean nothing. A server without
Redis shares its database with no other: live sessions are in the memory of one process, and two
that cannot exchange messages would send pages and robots half of what happens.
"""

from __future__ import annotations

import logging
import threading
import time
import uuid
from collections.abc import Callable, Collection
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, NamedTuple

from django.db import DatabaseError, InterfaceError, connection

from rehab.sessions.live.database.own_connection import own_connection

if TYPE_CHECKING:
    from collections.abc import Iterator

    from django.db.backends.base.base import BaseDatabaseWrapper

log = logging.getLogger(__name__)

LEASE_S = 5.0  # after so long without a renewal a server's sessions are taken over
RENEW_S = 1.0
WAIT_S = 45.0  # longer than a server takes to stop (process.STOP_S)
RETRY_S = 0.25
TIMEOUT_MS = 2_000  # a database that is stuck
KEY = 0x67_61_72_72_79  # "garry": advisory locks are numbers. Held while a server enters

# A lease that ends later than any server asks for is from before the database's clock was set back.
VALID = f"""
expires_at > clock_timestamp()
AND expires_at < clock_timestamp() + {2 * LEASE_S} * interval '1 second'
"""
ENTER = """
INSERT INTO rehab_server (id, address, shares, expires_at)
VALUES (%(id)s, %(address)s, %(shares)s, clock_timestamp() + %(for)s * interval '1 second')
ON CONFLICT (id) DO UPDATE SET expires_at = EXCLUDED.expires_at
"""
RENEW = f"""
UPDATE rehab_server SET expires_at = clock_timestamp() + %(for)s * interval '1 second'
WHERE id = %(id)s AND {VALID}
"""  # noqa: S608
FORGET = """
DELETE FROM rehab_server WHERE expires_at
NOT BETWEEN clock_timestamp() - interval '1 hour' AND clock_timestamp() + interval '1 hour'
"""
EXCLUDING = f"""
SELECT address FROM rehab_server WHERE id <> %(id)s AND {VALID} AND NOT (shares AND %(shares)s)
"""  # noqa: S608


class AnotherServer(RuntimeError):
    """A server runs on the database that cannot share it; the message has the cure."""


class Server(NamedTuple):
    """Another server: its id, and the address by which a proxy reaches it."""

    id: str
    address: str


_held: Lease | None = None


def held() -> Lease | None:
    """Return this process's lease; None in commands, and where one process is the clinic."""
    return _held


def valid_servers() -> list[Server]:
    """Return the servers whose lease is valid."""
    with connection.cursor() as cursor:
        cursor.execute(f"SELECT id, address FROM rehab_server WHERE {VALID}")  # noqa: S608
        return [Server(*row) for row in cursor.fetchall()]


class Lease:
    """A server's lease, renewed by a thread of its own until the process ends.

    Parameters
    ----------
    address
        How a proxy reaches the server: host and port.
    shares
        Whether the server exchanges messages with others on its database (by Redis).
    on_excluded
        Called, on that thread, where another server has the database and one of them cannot share
        it: this one must end. Steps are safe meanwhile: each session's epoch prevents an earlier
        owner from writing.
    """

    def __init__(self, address: str, *, shares: bool, on_excluded: Callable[[], None]) -> None:
        self.id = uuid.uuid4().hex
        self.address = address
        self.shares = shares
        self.entered = 0  # how often: more than once where it expired meanwhile
        self._on_excluded = on_excluded
        self._connection: BaseDatabaseWrapper | None = None
        self._renewed_s = 0.0  # by the monotonic clock
        self._unbroken_since_s = 0.0
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
        if not self.shares:
            return True  # there was no other when it entered
        now_s = time.monotonic()
        return self.is_current and now_s - self._unbroken_since_s > 2 * RENEW_S

    def may_judge_by(self, valid_ids: Collection[str]) -> bool:
        """Return whether servers that are not among the valid ones are gone.

        Where this one is not among them either, the database's clock was set: all leases expired
        at once, and each server renews its own within a second.
        """
        return self.may_judge and (not self.shares or self.id in valid_ids)

    def acquire(self, wait_s: float = WAIT_S) -> None:
        """Enter, once no server is there that cannot share the database; then stay.

        Raises AnotherServer where that takes longer than ``wait_s``, and DatabaseError where
        nothing answers.
        """
        global _held  # noqa: PLW0603 (one lease a process)
        deadline_s = time.monotonic() + wait_s
        waited = False
        while not self._enter():
            if time.monotonic() > deadline_s:
                self._disconnect()
                raise AnotherServer(
                    "Another server runs on this database, and not both have Redis, by which "
                    "several exchange messages. Stop the other one, set the same GARRY_REDIS_URL "
                    "for all, or give this one a database of its own (GARRY_DATABASE_URL)."
                )
            if not waited:
                log.warning("Another server runs on this database; waiting until it has ended.")
                waited = True
            time.sleep(RETRY_S)
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
            try:
                if self._execute(RENEW):
                    self._renewed_s = time.monotonic()
                elif not self._enter():
                    log.critical("Another server has taken this database; this one ends.")
                    self._on_excluded()
                    return
            except (DatabaseError, InterfaceError) as problem:
                log.warning("The server's lease could not be renewed: %s", problem)
                self._disconnect()

    def _enter(self) -> bool:
        """Write the row, unless a server is there that excludes this one or is excluded by it."""
        with self._cursor() as cursor:
            cursor.execute("SELECT pg_advisory_lock(%s)", [KEY])  # one at a time
            try:
                cursor.execute(EXCLUDING, self._parameters)
                if cursor.fetchone() is not None:
                    return False
                cursor.execute(FORGET)
                cursor.execute(ENTER, self._parameters)
            finally:
                cursor.execute("SELECT pg_advisory_unlock(%s)", [KEY])
        self._renewed_s = self._unbroken_since_s = time.monotonic()
        self.entered += 1
        return True

    @property
    def _parameters(self) -> dict[str, Any]:
        return {"id": self.id, "address": self.address, "shares": self.shares, "for": LEASE_S}

    def _execute(self, statement: str) -> int:
        with self._cursor() as cursor:
            cursor.execute(statement, self._parameters)
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
