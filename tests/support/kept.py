"""Rows that tests in a row begin with: built once and restored by savepoints."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager
from copy import deepcopy
from typing import TypeVar

from django.db import transaction

from tests.support import clock

Made = TypeVar("Made")


class KeptRows:
    """A transaction around the tests that begin with the same rows, rolled back after the last.

    pytest-django puts a savepoint around each test. What `build` returned is copied for each test,
    so that no test sees what another changed of it.
    """

    def __init__(self, unblock: Callable[[], AbstractContextManager[None]]) -> None:
        self._unblock = unblock
        self._build: Callable[[], object] | None = None
        self._made: object = None
        self._atomic: transaction.Atomic | None = None

    def begin(self, build: Callable[[], Made]) -> Callable[[], Made]:
        """Store the rows, unless the test before began with the same; return who copies them."""
        if self._build is not build:
            self.end()
            with self._unblock():
                self._atomic = transaction.atomic()
                self._atomic.__enter__()
                with clock.just_before():
                    self._made, self._build = build(), build
        return lambda: deepcopy(self._made)  # type: ignore[return-value]  # `build` made it

    def end(self) -> None:
        """Take the rows back, if there are any."""
        if self._atomic is None:
            return
        atomic, self._atomic, self._build = self._atomic, None, None
        with self._unblock():
            transaction.set_rollback(True)
            atomic.__exit__(None, None, None)
