"""A source's client that runs beside a test, and servers for a link."""

import asyncio
from contextlib import asynccontextmanager

from websockets.asyncio.server import serve

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


@asynccontextmanager
async def serving(handler, **settings):
    """Serve websockets, and yield the address of a robot's."""
    async with serve(handler, "127.0.0.1", 0, **settings) as server:
        yield f"ws://127.0.0.1:{server.sockets[0].getsockname()[1]}/ws/robot/"
