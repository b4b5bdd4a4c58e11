"""Sources that run beside a test, without waiting."""

import asyncio
from contextlib import asynccontextmanager

from robot.link import Timing

QUICK = Timing(retry_first_s=0.005, retry_longest_s=0.02, close_within_s=0.1)


async def until(condition):
    """Wait until something holds that nobody will tell us of."""
    async with asyncio.timeout(5):
        while not condition():  # noqa: ASYNC110
            await asyncio.sleep(0.002)


@asynccontextmanager
async def running(client):
    """Run a client beside the test."""
    task = asyncio.create_task(client.run())
    try:
        yield task
    finally:
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)
