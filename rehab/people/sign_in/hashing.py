"""Password hashing that cannot stall live training.

A hash takes 100 MB and a core for a good part of a second. So hashes are made by a few threads of
their own, which the operating system runs after all others, and no more than a few may wait.
"""

from __future__ import annotations

import os
import sys
import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

from django.contrib.auth.hashers import Argon2PasswordHasher

WORKERS = max(1, (os.cpu_count() or 1) // 2)
MAX_WAITING = 16
NICENESS = 10
BUSY_S = 5  # after which it is worth trying again

T = TypeVar("T")


class HashingBusy(Exception):
    """Too many passwords wait to be checked. Try again in some seconds."""


class HashingPool:
    """Threads that hash, and a bounded queue before them."""

    def __init__(self, workers: int, waiting: int) -> None:
        self._threads = ThreadPoolExecutor(workers, "hashing", _yield_to_others)
        self._places = threading.BoundedSemaphore(workers + waiting)

    def run(self, work: Callable[[], T]) -> T:
        """Run ``work`` in one of the threads and return its result. Raises HashingBusy."""
        if not self._places.acquire(blocking=False):
            raise HashingBusy
        try:
            return self._threads.submit(work).result()
        finally:
            self._places.release()


def _yield_to_others() -> None:
    """Lower the priority of this thread; those that argon2 starts in it inherit that."""
    if sys.platform == "linux":  # elsewhere it would be that of the whole process
        os.setpriority(os.PRIO_PROCESS, threading.get_native_id(), NICENESS)


pool = HashingPool(WORKERS, MAX_WAITING)


class PooledArgon2PasswordHasher(Argon2PasswordHasher):
    """Django's hasher with argon2id, in the pool. Raises HashingBusy where that is full."""

    def encode(self, password: str, salt: str) -> str:
        """Return the hash to store."""
        return pool.run(lambda: super(PooledArgon2PasswordHasher, self).encode(password, salt))

    def verify(self, password: str, encoded: str) -> bool:
        """Return whether this is the password of a hash."""
        return pool.run(lambda: super(PooledArgon2PasswordHasher, self).verify(password, encoded))
