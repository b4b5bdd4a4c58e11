"""A source against a server that obeys the protocol, hangs up, pauses, restarts and refuses."""

import asyncio
import json

import pytest

from rehab.sources.client import StepsLost
from robot.link import LinkRefused
from tests.sources.client_harness import even_walk, make_client, run
from tests.sources.fake_garry import serve_garry
from tests.support.running_client import running, until


async def test_a_walk_is_stored_whole_and_in_order(garry):
    acks = []
    async with serve_garry(garry):
        client = make_client(
            garry, even_walk(1000), run="b7c1", on_ack=lambda *ack: acks.append(ack)
        )
        await run(client)

    assert garry.numbers == list(range(1, 1001))
    assert {step["side"] for step in garry.log} == {"right"}  # the leg that the session trains
    assert garry.hellos == [
        {
            "type": "hello",
            "version": 1,
            "run": "b7c1",
            "last": 0,
            "speed": None,
            "clock_pauses": True,
        }
    ]
    assert acks[-1] == (7, 1000)
    assert (client.acknowledged, client.unacknowledged, client.lost) == (1000, 0, 0)
    assert len(garry.frames) < 200  # strides that wait together travel together


@pytest.mark.parametrize("stay", [False, True])
async def test_the_end_of_a_recording_is_told_once_all_is_stored(garry, stay):
    async with serve_garry(garry):
        client = make_client(garry, even_walk(3), stay=stay)
        async with running(client) as task:
            await until(lambda: {"type": "sensor", "trouble": "ended"} in garry.frames)
            assert garry.numbers == [1, 2, 3]
            assert client.unacknowledged == 0
            if stay:
                await garry.change("stop")
                await garry.open(8)
                await until(lambda: garry.frames[-1]["type"] == "sensor" and garry.numbers)
            else:
                await asyncio.wait_for(task, 5)
    told = [frame for frame in garry.frames if frame["type"] == "sensor"]
    assert len(told) == (2 if stay else 1)


async def test_another_content_under_the_same_number_stops_it_with_the_servers_words(garry):
    garry.close_after = {3: 4012}
    async with serve_garry(garry):
        client = make_client(garry, even_walk(3))
        async with running(client) as task:
            await until(lambda: len(garry.log) == 3)
            garry.log[2]["value"] = 9.9
            with pytest.raises(LinkRefused, match="Step 3 is stored with other content") as refused:
                await asyncio.wait_for(task, 5)

    assert refused.value.code == 4400


async def test_a_server_that_lost_acknowledged_steps_is_found_out(garry):
    async with serve_garry(garry):
        client = make_client(garry, even_walk(), speed=1.0, stay=True)
        async with running(client) as task:
            await until(lambda: client.acknowledged == 1)
            garry.log.clear()
            await garry.sockets[-1].close(4012)
            with pytest.raises(StepsLost, match="older copy"):
                await asyncio.wait_for(task, 5)


@pytest.mark.parametrize(
    "message",
    [
        {"type": "welcome", "session": 7, "state": "running"},
        {"type": "welcome", "session": "7", "state": "running", "next": 1},
        {"type": "welcome", "session": 7, "next": 1},
        {"type": "welcome", "session": 7, "next": 1, "state": "running", "trained_side": "third"},
        {"type": "ack"},
    ],
)
async def test_a_server_that_does_not_speak_the_protocol_is_refused(garry, message):
    async def welcome(socket):
        await socket.send(json.dumps(message))

    garry._welcome = welcome
    async with serve_garry(garry):
        with pytest.raises(LinkRefused, match="Use the version that fits"):
            await run(make_client(garry, even_walk()))


async def test_a_walk_is_told_what_its_session_measures(garry):
    garry.measure = "step_length"
    told = []

    def open_walk(side):
        walk = even_walk(3)(side)

        def stride(display):
            told.append(display.measure)
            return walk(display)

        return stride

    async with serve_garry(garry):
        await run(make_client(garry, open_walk))
    assert set(told) == {"step_length"}


async def test_words_that_it_does_not_know_are_no_reason_to_stop(garry):
    garry.state = "ready"
    async with serve_garry(garry), running(make_client(garry, even_walk(5))) as task:
        await until(lambda: garry.hellos)
        await garry.tell(type="weather", sun=True)
        await garry.tell(type="goal", goal=4.2)
        await garry.tell(type="goal", goal=None)
        await garry.change("start")
        await asyncio.wait_for(task, 5)

    assert len(garry.log) == 5


async def test_it_says_how_it_goes(garry):
    notices: list[str] = []
    async with serve_garry(garry):
        client = make_client(garry, even_walk(5), notify=notices.append, stay=True)
        assert client.describe() == "Waiting for the server."
        async with running(client):
            await until(lambda: client.acknowledged == 5)
            assert client.describe() == (
                "Session 7 running: 5 strides, 0 not acknowledged, 0% unusable, goal 3.9 W/kg"
            )

    assert notices == ["Joined session 7.", "Session 7 is running."]
