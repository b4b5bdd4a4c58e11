"""The gate between a session's subscribers and its steps: while one subscribes, steps wait."""

from __future__ import annotations

import asyncio
from collections.abc import Iterator
from contextlib import contextmanager


class SubscriptionGate:
    """Closed while somebody subscribes; those who wait pass in the order in which they came."""

    def __init__(self) -> None:
        self._subscribing = 0
        self._nobody_subscribes = asyncio.Event()
        self._turn = asyncio.Lock()  # first come, first served
        self._waiting = 0  # for their turn

    @property
    def is_open(self) -> bool:
        """Whether nobody subscribes, and nobody waits for that."""
        return not (self._subscribing or self._waiting)

    @contextmanager
    def closed(self) -> Iterator[None]:
        """Keep the gate closed in this block."""
        self._subscribing += 1
        self._nobody_subscribes.clear()
        try:
            yield
        finally:
            self._subscribing -= 1
            if not self._subscribing:
                self._nobody_subscribes.set()

    async def wait(self) -> None:
        """Wait while it is closed; to be called before recording steps or changes."""
        if self.is_open:
            return
        self._waiting += 1
        try:
            async with self._turn:
                while self._subscribing:
                    await self._nobody_subscribes.wait()
        finally:
            self._waiting -= 1
