"""Connections to the database that a thread of the server has for itself, outside of the pool."""

from __future__ import annotations

import asyncio
import copy
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import ParamSpec, TypeVar

from django.db import DEFAULT_DB_ALIAS, connection, connections
from django.db.backends.base.base import BaseDatabaseWrapper

SQLITE_TIMEOUT_S = 10
IDLE_MS = 5_000  # in a transaction: its server is stuck or gone, and another waits for its locks
P = ParamSpec("P")
R = TypeVar("R")


def own_connection(lock_timeout_ms: int, statement_timeout_ms: int) -> BaseDatabaseWrapper:
    """Return a connection that waits for no pool, and gives up on a database that is stuck."""
    own = connections.create_connection(DEFAULT_DB_ALIAS)
    # As it is now: a test has another database than the settings say.
    own.settings_dict = copy.deepcopy(connections[DEFAULT_DB_ALIAS].settings_dict)
    options = own.settings_dict["OPTIONS"]
    options.pop("pool", None)
    if own.vendor == "sqlite":
        options["timeout"] = SQLITE_TIMEOUT_S
    else:
        limits = {
            "lock_timeout": lock_timeout_ms,
            "statement_timeout": statement_timeout_ms,
            "idle_in_transaction_session_timeout": IDLE_MS,
        }
        given = " ".join(f"-c {name}={value}" for name, value in limits.items())
        options["options"] = f"{options.get('options', '')} {given}".strip()
    return own


class DatabaseThread:
    """A thread that queries the database again and again by one connection."""

    def __init__(self, name: str, timeout_ms: int) -> None:
        self._timeout_ms = timeout_ms
        self._thread = ThreadPoolExecutor(1, name, initializer=self._connect)

    def _connect(self) -> None:
        connections[DEFAULT_DB_ALIAS] = own_connection(self._timeout_ms, self._timeout_ms)

    async def run(self, work: Callable[P, R], *args: P.args, **kwargs: P.kwargs) -> R:
        """Return what a function returns that reads the database. Raises what it raises."""

        def call() -> R:
            try:
                return work(*args, **kwargs)
            except Exception:
                connection.close()  # it may be broken; the next call opens another
                raise

        return await asyncio.get_running_loop().run_in_executor(self._thread, call)

    def close(self) -> None:
        """End the thread, without waiting for what it does."""
        self._thread.submit(connections.close_all)
        self._thread.shutdown(wait=False)
