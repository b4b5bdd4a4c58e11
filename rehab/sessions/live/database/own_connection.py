"""Connections to the database that a thread of the server has for itself, outside of the pool."""

from __future__ import annotations

import copy

from django.db import DEFAULT_DB_ALIAS, connections
from django.db.backends.base.base import BaseDatabaseWrapper

SQLITE_TIMEOUT_S = 10
IDLE_MS = 5_000  # in a transaction: its server is stuck or gone, and another waits for its locks


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
