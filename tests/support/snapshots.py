"""Whole states of a SQLite test database: taken once, brought back by copying its pages."""

from __future__ import annotations

import sqlite3
import time
from collections.abc import Callable
from copy import deepcopy
from functools import partial
from typing import Any, TypeVar

from django.db import connection

from tests.support import clock

Made = TypeVar("Made")

PATIENCE_S = 30.0


class Snapshot:
    """All rows as they are now, with the numbers that were given to them.

    Django's TransactionTestCase empties all tables instead and makes the rows of `post_migrate`
    anew, at a hundred times the cost.
    """

    def __init__(self) -> None:
        self._pages = sqlite3.connect(":memory:", check_same_thread=False)
        connection.ensure_connection()
        connection.connection.backup(self._pages)

    def restore(self) -> None:
        """Leave nothing but them. Raises TimeoutError while a thread goes on writing."""
        connection.ensure_connection()
        began_s = time.monotonic()

        def wait(status: int, *_: int) -> None:  # else SQLite's driver waits for ever
            if status != sqlite3.SQLITE_DONE and time.monotonic() - began_s > PATIENCE_S:
                raise TimeoutError("A thread of a test before is still writing to the database.")

        self._pages.backup(connection.connection, progress=wait)

    def file(self) -> bytes:
        """Return the database file that has them."""
        return self._pages.serialize()

    def close(self) -> None:
        """Forget them."""
        self._pages.close()


class Snapshots:
    """Rows that tests begin with whose threads see each other's: stored by the first of them."""

    def __init__(self) -> None:
        self._made: dict[Callable[[], Any], tuple[Any, Snapshot]] = {}

    def begin(self, build: Callable[[], Made]) -> Callable[[], Made]:
        """Return what stores the rows in an empty database and tells what was built."""
        return partial(self._bring, build)

    def _bring(self, build: Callable[[], Made]) -> Made:
        if build in self._made:
            self._made[build][1].restore()
        else:
            with clock.just_before():
                made = build()
            self._made[build] = made, Snapshot()
        return deepcopy(self._made[build][0])  # type: ignore[no-any-return]  # `build` made it

    def close(self) -> None:
        """Forget them all."""
        for _, snapshot in self._made.values():
            snapshot.close()
