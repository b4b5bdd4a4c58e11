"""A client that plays a walk to the fake server of these tests."""

import asyncio
from functools import partial

from rehab.sources.client import SourceClient, StridePlayback
from rehab.training.steps import Measurement
from robot.link import Link
from tests.sources.fake_garry import TOKEN
from tests.support.running_client import QUICK


def even_walk(count=1000, every_s=1.0):
    """Walk evenly; each session from the beginning."""

    def open_walk(side):
        strides = (
            Measurement(number=n, time_s=n * every_s, side=side, value=3.0 + n / 1000)
            for n in range(1, count + 1)
        )
        return lambda _phase: next(strides, None)

    return open_walk


PLAYED = ("speed", "max_unacknowledged", "monotonic")


def make_client(garry, open_walk, token=TOKEN, **settings):
    dial = partial(Link, garry.url, token, timing=QUICK)
    how = {"speed": None} | {name: settings.pop(name) for name in PLAYED if name in settings}
    return SourceClient(dial, StridePlayback(open_walk, **how), **settings)


async def run(client):
    async with asyncio.timeout(5):
        await client.run()
