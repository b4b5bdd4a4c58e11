"""How GARRY connects to its database: SQLite on one machine, PostgreSQL where it is hosted."""

from typing import Any

import dj_database_url
from django.core.exceptions import ImproperlyConfigured

SQLITE_OPTIONS = {
    "transaction_mode": "IMMEDIATE",
    "timeout": 20,
    "init_command": (
        # FULL keeps acknowledged steps through a power cut, not only through a crash
        # (docs/reference/stack.md#durability).
        "PRAGMA journal_mode=WAL; PRAGMA synchronous=FULL; PRAGMA journal_size_limit=67108864; "
        # What is deleted or overwritten, as by an erasure, is not left in the file's free space.
        "PRAGMA secure_delete=ON; "
        # No memory map: an error of the disk in it would end the process.
        "PRAGMA mmap_size=0; PRAGMA cache_size=-16000; "
        # The live runtime checkpoints between commits (rehab/sessions/live/process.py); left to
        # SQLite, every fiftieth commit would wait for a checkpoint.
        "PRAGMA wal_autocheckpoint=20000;"
    ),
}
# Nobody waits for ever for a lock, or for a database that is gone; and the database does not wait
# for a server that is gone, whose locks would keep others from taking its sessions over. The writer
# of steps has a connection of its own, which gives up sooner
# (rehab/sessions/live/database/own_connection.py).
POSTGRESQL_OPTIONS = {
    "connect_timeout": 5,
    "keepalives_idle": 10,
    "keepalives_interval": 3,
    "keepalives_count": 3,
    "tcp_user_timeout": 10_000,
    "options": "-c lock_timeout=10s -c statement_timeout=60s "
    "-c idle_in_transaction_session_timeout=60s -c tcp_user_timeout=10s "
    "-c tcp_keepalives_idle=10 -c tcp_keepalives_interval=3 -c tcp_keepalives_count=3",
}
POOL = {"min_size": 1, "max_size": 8, "timeout": 10}


def parse_database(url: str) -> dict[str, Any]:
    """Return Django's settings of the database at an address.

    Raises ImproperlyConfigured for text that is none.
    """
    try:
        database: dict[str, Any] = {**dj_database_url.parse(url)}
    except ValueError as problem:
        raise ImproperlyConfigured(
            "GARRY_DATABASE_URL is no database address. Give sqlite:////path/to/file or "
            "postgres://user:password@host/name."
        ) from problem
    if database["ENGINE"].endswith("sqlite3"):
        return database | {"OPTIONS": {**SQLITE_OPTIONS}}
    options = {**POSTGRESQL_OPTIONS, **database.get("OPTIONS", {}), "pool": POOL}
    return database | {"CONN_MAX_AGE": 0, "OPTIONS": options}
