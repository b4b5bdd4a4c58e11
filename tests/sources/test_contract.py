"""What every source has to do, whichever it is: tests/sources/labs.py has a lab for each."""

import asyncio
import math
import re
from contextlib import asynccontextmanager
from functools import partial

import pytest

from rehab.sources import SOURCES
from rehab.sources.__main__ import run_client, run_live_source
from rehab.sources.client import LiveFeed, SourceClient, StridePlayback
from rehab.sources.intake import Intake
from rehab.sources.source import LiveSource, PlayedSource
from robot.link import Link, Timing
from tests.sources.fake_garry import TOKEN, FakeGarry, serve_garry
from tests.sources.labs import LABS

QUICK = Timing(retry_first_s=0.005, retry_longest_s=0.02, close_within_s=0.1)
NAME = re.compile(r"[A-Za-z0-9_.:-]{1,64}")

every_lab = pytest.mark.parametrize("make_lab", LABS, ids=lambda lab: lab.__name__)
every_sending_lab = pytest.mark.parametrize(
    "make_lab", [lab for lab in LABS if lab.sends], ids=lambda lab: lab.__name__
)


def test_every_source_has_a_lab():
    assert {lab.name for lab in LABS} == set(SOURCES)


@asynccontextmanager
async def running(source, garry, said):
    """Run a source as the command does, until the block ends."""
    dial = partial(Link, garry.url, TOKEN, timing=QUICK)
    if isinstance(source, LiveSource):
        feed = LiveFeed()
        client = SourceClient(dial, feed)
        doing = run_live_source(source, Intake(feed, source.settings, said.append), client)
    else:
        client = SourceClient(
            dial, StridePlayback(source.open_walk, None, source.max_unacknowledged)
        )
        doing = run_client(client, client.describe)
    task = asyncio.create_task(doing)
    try:
        yield client, task
    finally:
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)


async def until(condition):
    async with asyncio.timeout(10):
        while not condition():  # noqa: ASYNC110
            await asyncio.sleep(0.005)


async def until_joined(garry):
    await until(lambda: garry.hellos)
    await asyncio.sleep(0.02)


def values_of(garry):
    return [step["value"] for step in garry.log]


@every_lab
async def test_strides_arrive_in_order_and_as_the_protocol_has_them(make_lab, tmp_path):
    lab, garry = make_lab(tmp_path), FakeGarry()
    async with serve_garry(garry), lab.open():
        source = lab.make()
        assert isinstance(source, LiveSource if lab.sends else PlayedSource)
        async with running(source, garry, lab.said):
            await until_joined(garry)
            await lab.send(source, [3.0 + n / 100 for n in range(15)])
            await until(lambda: len(garry.log) >= 15)

    assert garry.numbers == list(range(1, len(garry.log) + 1))
    times = [step["time_s"] for step in garry.log]
    assert times == sorted(times)
    assert all(math.isfinite(t) for t in times)
    assert {step["side"] for step in garry.log} <= {"left", "right"}
    for step in garry.log:
        assert step["value"] is None or math.isfinite(step["value"])
        for name, number in step.get("extra", {}).items():
            assert NAME.fullmatch(name)
            assert math.isfinite(number)
    if lab.sends:
        assert values_of(garry) == pytest.approx([3.0 + n / 100 for n in range(15)])


@every_lab
async def test_connections_that_break_lose_nothing(make_lab, tmp_path):
    lab, garry = make_lab(tmp_path), FakeGarry()
    garry.close_after = {3: 1001, 4: 4012, 11: 4011}
    async with serve_garry(garry), lab.open():
        source = lab.make()
        async with running(source, garry, lab.said) as (client, _):
            await until_joined(garry)
            await lab.send(source, [3.0 + n / 100 for n in range(15)])
            await until(lambda: len(garry.log) >= 15 and not client.unacknowledged)

    assert garry.numbers == list(range(1, len(garry.log) + 1))
    assert len(garry.hellos) == 4
    assert client.lost == 0


@every_sending_lab
async def test_strides_walked_while_the_server_is_away_come_when_it_is_back(make_lab, tmp_path):
    lab, garry = make_lab(tmp_path), FakeGarry()
    async with lab.open(), serve_garry(garry) as server:
        port = server.sockets[0].getsockname()[1]
        source = lab.make()
        async with running(source, garry, lab.said) as (client, _):
            await until_joined(garry)
            await lab.send(source, [3.0, 3.1])
            await until(lambda: len(garry.log) == 2)
            server.close()
            await server.wait_closed()
            await lab.send(source, [3.2, 3.3, 3.4])
            await asyncio.sleep(0.2)
            async with serve_garry(garry, port):
                await until(lambda: len(garry.hellos) == 2)
                await lab.send(source, [3.5])
                await until(lambda: len(garry.log) == 6 and not client.unacknowledged)

    assert values_of(garry) == pytest.approx([3.0, 3.1, 3.2, 3.3, 3.4, 3.5])
    assert [step.get("reasons") for step in garry.log] == [None] * 6
    assert garry.hellos[1]["clock_s"] > garry.log[1]["time_s"]  # so that the late are known as such


@every_sending_lab
async def test_garbage_is_told_with_the_cure_and_harms_nothing(make_lab, tmp_path):
    lab, garry = make_lab(tmp_path), FakeGarry()
    async with serve_garry(garry), lab.open():
        source = lab.make()
        async with running(source, garry, lab.said):
            await until_joined(garry)
            await lab.send(source, [3.0])
            await lab.garble(source)
            await lab.send(source, [3.1, 3.2])
            await until(lambda: len(garry.log) >= 3)
            await asyncio.sleep(0.05)

    assert [value for value in values_of(garry) if value is not None] == [3.0, 3.1, 3.2]
    assert any(word in text for text in lab.said for word in ("Send", "Let it", "Use a"))


@every_sending_lab
async def test_strides_of_a_pause_do_not_count_and_those_before_the_start_are_none(
    make_lab, tmp_path
):
    lab, garry = make_lab(tmp_path), FakeGarry()
    garry.state = "ready"
    async with serve_garry(garry), lab.open():
        source = lab.make()
        async with running(source, garry, lab.said) as (client, _):
            await until_joined(garry)
            if lab.name != "matlab":  # which is not asked before the start
                await lab.send(source, [1.0, 1.1])
                await asyncio.sleep(0.3)
            await garry.change("start")
            await until(lambda: "running" in client.describe())
            await lab.send(source, [3.0])
            await until(lambda: len(garry.log) == 1)
            await garry.change("pause")
            await until(lambda: "paused" in client.describe())
            await lab.send(source, [3.1])
            await until(lambda: len(garry.log) == 2)
            await garry.change("resume")
            await until(lambda: "running" in client.describe())
            await lab.send(source, [3.2])
            await until(lambda: len(garry.log) == 3)

    assert values_of(garry) == pytest.approx([3.0, 3.1, 3.2])
    assert [step.get("reasons") for step in garry.log] == [None, ["paused"], None]
