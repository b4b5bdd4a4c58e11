"""Ends tasks of the event loop for certain."""

from __future__ import annotations

import asyncio
from collections.abc import Collection
from typing import Any

AGAIN_S = 0.2


async def end_tasks(tasks: Collection[asyncio.Task[Any]]) -> None:
    """Cancel tasks, again and again until all have ended; their errors are dropped.

    A task may lose a cancellation: ``asyncio.wait_for`` of Python 3.11, by which redis-py sends,
    does where what it waits for is done in the same turn of the event loop.
    """
    while pending := [task for task in tasks if not task.done()]:
        for task in pending:
            task.cancel()
        await asyncio.wait(pending, timeout=AGAIN_S)
    await asyncio.gather(*tasks, return_exceptions=True)
