"""Links for tests: to a server of their own, without waiting."""

import asyncio
from contextlib import asynccontextmanager

from websockets.asyncio.server import serve

from robot.link import Link, Timing

QUICK = Timing(retry_first_s=0.01, retry_longest_s=0.05, close_within_s=0.1)
HELLO = {"type": "hello", "version": 1}


async def until(condition):
    """Wait until something holds that nobody will tell us of."""
    async with asyncio.timeout(5):
        while not condition():  # noqa: ASYNC110
            await asyncio.sleep(0.002)


@asynccontextmanager
async def serving(handler, **settings):
    async with serve(handler, "127.0.0.1", 0, **settings) as server:
        yield f"ws://127.0.0.1:{server.sockets[0].getsockname()[1]}/ws/robot/"


class Losses:
    """Writes down losses and pauses; pauses are not waited for."""

    def __init__(self):
        self.reasons = []
        self.pauses_s = []

    def __call__(self, reason, pause_s):
        self.reasons.append(reason)

    async def sleep(self, pause_s):
        self.pauses_s.append(pause_s)
        await asyncio.sleep(0)


def dial(url, losses=None, *, greet=lambda: HELLO, timing=QUICK, **settings):
    losses = losses or Losses()
    return Link(url, "t-1", greet, on_lost=losses, timing=timing, sleep=losses.sleep, **settings)
