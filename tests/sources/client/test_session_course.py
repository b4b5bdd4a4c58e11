"""A session waits, pauses, ends and begins anew, and the source walks accordingly."""

import asyncio

import pytest

from rehab.sources.synthetic import GOOD, SyntheticWalker
from rehab.training.phases import make_phase
from rehab.training.steps import Side
from robot.link import LinkRefused
from tests.sources.client_harness import even_walk, make_client, run
from tests.sources.fake_garry import serve_garry
from tests.support.running_client import running, until


class Time:
    """Passes only while somebody sleeps, or when told to."""

    now_s = 100.0

    def __call__(self):
        return self.now_s

    async def sleep(self, seconds):
        await asyncio.sleep(0.002)
        self.now_s += seconds + 1e-6  # no clock stops for want of digits


async def test_steps_that_were_refused_before_the_start_are_sent_after_it(garry):
    garry.holds_acks = True
    async with serve_garry(garry):
        client = make_client(garry, even_walk(5))
        async with running(client) as task:
            await until(lambda: garry.sockets)
            garry.state = "ready"  # the welcome may still have said something else
            garry.log.clear()
            await garry.tell(type="error", code="not_running", message="Wait for start.")
            await asyncio.sleep(0.02)
            garry.holds_acks = False
            await garry.change("start")
            await asyncio.wait_for(task, 5)

    assert garry.numbers == [1, 2, 3, 4, 5]


async def test_who_is_paused_stands_still_and_so_does_the_clock(garry):
    ours = Time()
    async with serve_garry(garry):
        client = make_client(garry, even_walk(), speed=1.0, monotonic=ours, sleep=ours.sleep)
        async with running(client):
            await until(lambda: len(garry.log) >= 3)
            await garry.change("pause")
            await until(lambda: "paused" in client.describe())
            await asyncio.sleep(0.02)
            stored, ours.now_s = len(garry.log), ours.now_s + 600
            await garry.sockets[-1].close(4012)
            await until(lambda: len(garry.hellos) == 2)
            assert "clock_s" not in garry.hellos[1]  # it stands
            await asyncio.sleep(0.02)
            assert len(garry.log) == stored
            await garry.change("resume")
            await until(lambda: len(garry.log) >= stored + 3)
            await garry.sockets[-1].close(4012)
            await until(lambda: len(garry.hellos) == 3)

    hello = garry.hellos[2]
    assert hello["last"] <= hello["clock_s"] < hello["last"] + 1.1
    assert garry.numbers == list(range(1, len(garry.log) + 1))


async def test_what_was_walked_before_a_crash_waits_until_the_paused_session_goes_on(garry):
    async with serve_garry(garry):
        client = make_client(garry, even_walk(8))
        garry.close_after[3] = 4011
        garry.holds_acks = True
        async with running(client) as task:
            await until(lambda: len(garry.log) >= 3)
            garry.state = "paused"  # as the server comes back
            garry.log.clear()  # and what it had not acknowledged was lost
            garry.holds_acks = False
            await until(lambda: len(garry.hellos) == 2)
            await asyncio.sleep(0.03)
            assert not garry.log
            await garry.change("resume")
            await asyncio.wait_for(task, 5)

    assert garry.numbers == list(range(1, 9))


async def test_out_of_reach_it_walks_on_and_sends_everything_later(garry):
    async with serve_garry(garry) as server:
        port = server.sockets[0].getsockname()[1]
        client = make_client(garry, even_walk(60), speed=500.0)
        task = asyncio.create_task(client.run())
        await until(lambda: len(garry.log) >= 5)
    await until(lambda: client.unacknowledged >= 20)
    garry.frames.clear()
    async with serve_garry(garry, port):
        await asyncio.wait_for(task, 5)

    assert garry.numbers == list(range(1, 61))
    assert len(garry.frames[0]["steps"]) >= 20
    assert garry.hellos[-1]["last"] >= 20


async def test_a_stop_ends_it(garry):
    notices: list[str] = []
    async with serve_garry(garry):
        client = make_client(garry, even_walk(), speed=100.0, notify=notices.append)
        async with running(client) as task:
            await until(lambda: client.acknowledged >= 3)
            await garry.change("stop")
            await asyncio.wait_for(task, 5)

    assert "Session 7 has ended" in notices[-1]


async def test_steps_that_the_end_overtook_are_counted_as_lost(garry):
    garry.holds_acks = True
    async with serve_garry(garry):
        client = make_client(garry, even_walk(300))
        async with running(client) as task:
            await until(lambda: len(garry.log) == 256)
            garry.state = "finished"
            await garry.acknowledge()  # the rest meets a session that has ended
            await asyncio.wait_for(task, 5)

    assert (client.acknowledged, client.lost) == (256, 44)


async def test_a_session_that_ended_while_the_server_was_away_ends_it(garry):
    garry.close_after = {5: 4012}
    async with serve_garry(garry):
        client = make_client(garry, even_walk(5))
        async with running(client) as task:
            await until(lambda: len(garry.log) == 5)
            garry.session = None
            await asyncio.wait_for(task, 5)

    assert client.lost == 5


async def test_a_named_session_that_has_ended_is_an_error(garry):
    garry.state = "finished"

    async def refuse(socket):
        await garry.refuse(socket, 4410, "ended", "Session 7 has ended.")

    garry._welcome = refuse
    async with serve_garry(garry):
        with pytest.raises(LinkRefused, match="Session 7 has ended"):
            await run(make_client(garry, even_walk(), session=7))


async def test_without_a_session_it_waits_for_one(garry):
    garry.session = None
    async with serve_garry(garry):
        client = make_client(garry, even_walk(5))
        async with running(client) as task:
            await until(lambda: garry.hellos)
            assert not garry.frames
            await garry.open(8, "running")
            await asyncio.wait_for(task, 5)

    assert len(garry.steps[8]) == 5


async def test_who_stays_walks_anew_in_every_session(garry):
    async with serve_garry(garry):
        client = make_client(garry, even_walk(5), stay=True)
        async with running(client):
            await until(lambda: client.acknowledged == 5)
            await garry.change("stop")
            await garry.open(None)
            await garry.open(8, "ready")
            await garry.change("start")
            await until(lambda: client.acknowledged == 10)

    assert [step["number"] for step in garry.steps[8]] == [1, 2, 3, 4, 5]
    assert garry.steps[8] == garry.steps[7]


@pytest.mark.parametrize("speed", [None, 1.0])
async def test_a_simulated_patient_walks_in_the_phases_that_the_server_tells(garry, speed):
    """The same walk as without a server in between."""
    garry.phase = {"kind": "baseline", "name": "Baseline", "feedback": False, "gain": 1.0}
    told = {"kind": "training", "name": "Training", "feedback": True, "gain": 0.85}
    garry.phases = {20: told}
    walker = SyntheticWalker(GOOD, 3, Side.RIGHT)
    strides = iter(range(40))

    def open_walk(side):
        return lambda shown: (
            walker.next_stride(shown.phase) if next(strides, None) is not None else None
        )

    ours = Time()

    async def sleep(seconds):
        await until(lambda: not client.unacknowledged)  # here, acks take no time
        await ours.sleep(seconds)

    async with serve_garry(garry):
        client = make_client(
            garry, open_walk, speed=speed, max_unacknowledged=1, monotonic=ours, sleep=sleep
        )
        await run(client)

    other = SyntheticWalker(GOOD, 3, Side.RIGHT)
    phases = [make_phase("baseline")] * 20 + [make_phase("training", gain=0.85)] * 20
    assert [step["time_s"] for step in garry.log] == [other.next_stride(p).time_s for p in phases]


async def test_a_phase_that_nobody_knows_is_no_reason_to_stop(garry):
    garry.phase = {"kind": "levitation"}
    notices: list[str] = []
    async with serve_garry(garry):
        await run(make_client(garry, even_walk(5), notify=notices.append))

    assert garry.numbers == [1, 2, 3, 4, 5]
    assert any("levitation" in notice for notice in notices)
