"""The worker on a real socket: it answers, it stops when it should, it dials in again."""

import asyncio
import time
from contextlib import asynccontextmanager
from functools import partial

import pytest

from robot.bases import BASES, BaseLost
from robot.bases.kinematic import KinematicBase
from robot.link import Link, LinkRefused, Timing
from robot.motion import STILL
from robot.worker import Worker
from tests.robot.fake_garry import TOKEN, FakeGarry, serve_garry

pytestmark = pytest.mark.realtime

FAST = Timing(retry_first_s=0.02, retry_longest_s=0.1)


@pytest.fixture
async def garry():
    garry = FakeGarry()
    async with serve_garry(garry):
        yield garry


@asynccontextmanager
async def working(garry, base=None, token=TOKEN, said=None):
    base = base or BASES["kinematic"](time.monotonic)
    notice = (lambda _: None) if said is None else said.append
    worker = Worker(partial(Link, garry.url, token, timing=FAST), base, notice=notice)
    task = asyncio.create_task(worker.run())
    try:
        yield worker
    finally:
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)
        assert base.read().twist == STILL


async def until_still(base, within_s):
    async with asyncio.timeout(within_s):
        while not base.read().twist.is_still:  # noqa: ASYNC110 (a base tells nobody)
            await asyncio.sleep(0.002)


def is_kind(kind, **parts):
    return lambda report: report["kind"] == kind and parts.items() <= report.items()


async def test_it_says_hello_decides_performs_and_reports(garry):
    async with working(garry):
        await garry.until_hello(1)
        assert garry.hellos == [{"type": "hello", "version": 1, "base": "kinematic"}]
        await garry.until(is_kind("status", state="idle", reason=""))
        await garry.walk(0, 1, 2, 3, 4, 5)
        decision = await garry.until(is_kind("decision"))
        assert (decision["mean"], decision["gesture"]) == (1.0, "celebrate")
        moving = await garry.until(is_kind("status", state="performing"))
        assert moving["gesture"] == "celebrate"
        await garry.until(is_kind("gesture", phase="ended", outcome="done"))


async def test_a_stop_is_at_the_base_within_a_tenth_of_a_second(garry):
    base = BASES["kinematic"](time.monotonic)
    async with working(garry, base):
        await garry.until_hello(1)
        await garry.walk(0, 1, 2, 3, 4, 5)
        await garry.until(is_kind("status", state="performing"))
        await asyncio.sleep(0.4)
        assert not base.read().twist.is_still
        await garry.tell(type="stop")
        await until_still(base, 0.1)
        await garry.until(is_kind("gesture", phase="ended", outcome="stopped"))


async def test_silence_stops_it_and_what_was_on_its_way_counts_no_more(garry):
    base = BASES["kinematic"](time.monotonic)
    said: list[str] = []
    async with working(garry, base, said=said):
        await garry.until_hello(1)
        await garry.walk(0, 1, 2, 3, 4, 5)
        await garry.until(is_kind("status", state="performing"))
        garry.beats = False
        await asyncio.sleep(0.3)
        assert not base.read().twist.is_still
        await until_still(base, 0.45)
        await garry.until_hello(2)
        garry.beats = True
        await garry.until(is_kind("gesture", phase="ended", outcome="no_link"))
        await garry.until(is_kind("status", state="idle", reason=""))
    assert any("silent" in line for line in said)


async def test_a_server_that_goes_stops_it_and_is_found_again():
    garry, base = FakeGarry(), BASES["kinematic"](time.monotonic)
    async with serve_garry(garry) as server:
        port = server.sockets[0].getsockname()[1]
        async with working(garry, base):
            await garry.until_hello(1)
            await garry.walk(0, 1, 2, 3, 4, 5)
            await garry.until(is_kind("status", state="performing"))
            server.close()
            await server.wait_closed()
            await asyncio.sleep(0.05)
            assert base.read().twist == STILL
            async with serve_garry(garry, port):
                await garry.until_hello(2)


@pytest.mark.parametrize("junk", ["not json", "[1]", '{"type":', "\x00", '"step"', "7", "NaN"])
async def test_a_broken_frame_is_counted_and_the_work_goes_on(garry, junk):
    async with working(garry):
        await garry.until_hello(1)
        await garry.tell(junk)
        await garry.until(is_kind("status", bad_messages=1))
        await garry.walk(0, 1, 2, 3, 4, 5)
        await garry.until(is_kind("decision", gesture="celebrate"))
        assert len(garry.sockets) == 1


async def test_a_stranger_on_the_other_end_is_left(garry):
    garry.welcome = {"no": "type"}
    worker = Worker(partial(Link, garry.url, TOKEN), BASES["null"](time.monotonic))
    with pytest.raises(LinkRefused, match="no GARRY server"):
        async with asyncio.timeout(5):
            await worker.run()


async def test_a_refusal_ends_it(garry):
    worker = Worker(partial(Link, garry.url, "wrong"), BASES["null"](time.monotonic))
    with pytest.raises(LinkRefused, match="Unknown token"):
        async with asyncio.timeout(5):
            await worker.run()


async def test_a_base_that_is_lost_ends_it(garry):
    class Unplugged(KinematicBase):
        def read(self):
            raise BaseLost("The base is unplugged.")

        def stop(self):
            pass

    worker = Worker(partial(Link, garry.url, TOKEN), Unplugged(time.monotonic))
    with pytest.raises(BaseLost, match="unplugged"):
        async with asyncio.timeout(5):
            await worker.run()
