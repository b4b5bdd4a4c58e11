"""One server for a hosted database: a lock that PostgreSQL takes back when its holder is gone.

Live sessions are in the memory of one process. A second one on the same database would tell pages
and robots half of what happens, so it waits for the first to end, or does not start.
"""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable

from django.db import DEFAULT_DB_ALIAS, DatabaseError, InterfaceError, connections
from django.db.backends.base.base import BaseDatabaseWrapper

log = logging.getLogger(__name__)

KEY = 0x67_61_72_72_79  # "garry": advisory locks are numbers
RENEW_S = 2.0
# A holder that says nothing for so long loses the lock: it hangs, or its machine is gone.
HOLDS_S = 15
WAIT_S = 45.0  # longer than a server takes to stop (process.STOP_S)
RETRY_S = 0.25

_held = threading.Event()


class AnotherServer(RuntimeError):
    """Another server runs on the database; the message says what to do."""


def is_held() -> bool:
    """Return whether this process is the database's only server."""
    return _held.is_set()


class ServerLock:
    """The lock of a hosted server, renewed by a thread of its own until the process ends.

    ``on_lost`` is called, on that thread, when another server has it: this one must end. Steps are
    safe meanwhile: each session's epoch keeps an earlier owner from writing.
    """

    def __init__(self, on_lost: Callable[[], None]) -> None:
        self._on_lost = on_lost
        self._connection: BaseDatabaseWrapper | None = None
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._renew, name="garry-lock", daemon=True)

    def acquire(self, wait_s: float = WAIT_S) -> None:
        """Take the lock, once the server that has it has ended; then keep it.

        Raises AnotherServer where that takes longer than ``wait_s``.
        """
        deadline_s = time.monotonic() + wait_s
        waited = False
        while not self._try():
            if time.monotonic() > deadline_s:
                raise AnotherServer(
                    "Another server runs on this database. One process serves all clinics: stop "
                    "the other one, or give this one a database of its own (GARRY_DATABASE_URL)."
                )
            if not waited:
                log.warning("Another server runs on this database; waiting until it has ended.")
                waited = True
            time.sleep(RETRY_S)
        self._thread.start()

    def release(self) -> None:
        """Release the lock: another server may start."""
        self._closing.set()
        if self._thread.is_alive():
            self._thread.join(RENEW_S)
        self._disconnect()

    def _try(self) -> bool:
        """Return whether the lock is ours now. Raises DatabaseError where nothing answers."""
        try:
            if self._connection is None:
                self._connection = _connect()
            with self._connection.cursor() as cursor:
                cursor.execute("SELECT pg_try_advisory_lock(%s)", [KEY])
                if cursor.fetchone()[0]:
                    _held.set()
                    return True
        except (DatabaseError, InterfaceError):
            self._disconnect()
            raise
        self._disconnect()
        return False

    def _disconnect(self) -> None:
        _held.clear()
        if self._connection is not None:
            self._connection.close()
            self._connection = None

    def _renew(self) -> None:
        while not self._closing.wait(RENEW_S):
            try:
                if self._connection is not None:
                    self._ping(self._connection)
                elif not self._try():
                    log.critical("Another server has taken this database; this one ends.")
                    self._on_lost()
                    return
            except (DatabaseError, InterfaceError):
                log.warning("The server's lock is gone and is tried again.", exc_info=True)

    def _ping(self, connection: BaseDatabaseWrapper) -> None:
        try:
            with connection.cursor() as cursor:
                cursor.execute("SELECT 1")
        except (DatabaseError, InterfaceError):
            self._disconnect()
            raise


def _connect() -> BaseDatabaseWrapper:
    """Return a connection that is not of the pool, and that ends when it says nothing for long."""
    own = connections.create_connection(DEFAULT_DB_ALIAS)
    options = {**own.settings_dict["OPTIONS"]}
    options.pop("pool", None)
    quiet = f"-c idle_session_timeout={HOLDS_S}s -c statement_timeout=2s"
    options["options"] = f"{options.get('options', '')} {quiet}".strip()
    own.settings_dict = {**own.settings_dict, "OPTIONS": options}
    own.inc_thread_sharing()  # taken by the starting thread, renewed by another
    return own
