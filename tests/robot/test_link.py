"""The link: addresses, pauses, what is tried again and what is not, servers that go silent."""

import asyncio
import json
import time
from dataclasses import replace

import pytest

from robot.link import (
    REFUSALS,
    BackOff,
    FrameTooLarge,
    Link,
    LinkRefused,
    Timing,
)
from robot.wire.limits import MAX_FRAME_BYTES
from tests.support.running_client import serving, until

QUICK = Timing(retry_first_s=0.01, retry_longest_s=0.05, close_within_s=0.1)
HELLO = {"type": "hello", "version": 1}


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


def closing(*codes, before=None):
    """Close one connection after the other with these codes, after an error if there is one."""
    left = list(codes)

    async def handler(socket):
        await socket.recv()
        if before:
            await socket.send(json.dumps(before))
        if left:
            await socket.close(left.pop(0))
        else:
            await socket.send('{"type": "welcome"}')
            await socket.wait_closed()

    return handler


def test_pauses_grow_to_five_seconds_and_begin_again():
    pauses = BackOff(Timing(), lambda: 0.0)

    assert [pauses.next_s() for _ in range(7)] == pytest.approx([0.2, 0.4, 0.8, 1.6, 3.2, 5, 5])
    for _ in range(5000):
        assert pauses.next_s() == 5.0
    pauses.reset()
    assert pauses.next_s() == 0.2


def test_a_silent_server_is_noticed_within_ten_seconds():
    timing = Timing()

    assert timing.ping_every_s + timing.pong_within_s + timing.close_within_s < 10


async def test_the_link_greets_with_its_token_and_gives_messages():
    heard = []

    async def handler(socket):
        heard.append(socket.request.headers["Authorization"])
        heard.append(json.loads(await socket.recv()))
        await socket.send('{"type": "welcome", "session": 7}')
        heard.append(json.loads(await socket.recv()))
        await socket.send('{"type": "step"}')
        await socket.wait_closed()

    async with serving(handler) as url, dial(url) as link:
        assert not link.is_open
        assert not await link.send({"type": "report"})
        assert await anext(link) == {"type": "welcome", "session": 7}
        assert link.is_open
        assert await link.send({"type": "report", "x": 1.5})
        assert await anext(link) == {"type": "step"}

    assert heard == ["Bearer t-1", HELLO, {"type": "report", "x": 1.5}]
    assert not link.is_open
    assert not await link.send({"type": "report"})


async def test_a_link_names_the_server_that_has_the_session_to_the_proxy():
    named = []

    async def handler(socket):
        await socket.recv()
        named.append(socket.request.headers.get("GARRY-Server"))
        if named[-1] is None:
            error = {"type": "error", "code": "elsewhere", "server": "127.0.0.1:8001"}
            await socket.send(json.dumps(error | {"message": "Try again."}))
            await socket.close(4421)
        else:
            await socket.send('{"type": "welcome"}')
            await socket.wait_closed()

    losses = Losses()
    async with serving(handler) as url, dial(url, losses) as link:
        assert (await anext(link))["code"] == "elsewhere"
        assert await anext(link) == {"type": "welcome"}
    assert named == [None, "127.0.0.1:8001"]
    assert len(losses.pauses_s) == 1


@pytest.mark.parametrize("code", [1000, 1001, 4008, 4011, 4012, 4029, 4421, 4999])
async def test_a_link_that_is_closed_for_a_while_comes_back(code):
    losses = Losses()
    async with serving(closing(code)) as url, dial(url, losses) as link:
        assert await anext(link) == {"type": "welcome"}

    assert len(losses.pauses_s) == 1
    assert str(code) in losses.reasons[0]


@pytest.mark.parametrize("code", [4001, 4004, 4009, 4400, 4409, 4410])
async def test_a_link_that_is_refused_stops_with_the_servers_words(code):
    error = {"type": "error", "code": "x", "message": "Do this first."}
    losses = Losses()
    async with serving(closing(code, before=error)) as url, dial(url, losses) as link:
        assert await anext(link) == error
        with pytest.raises(LinkRefused, match="Do this first.") as refused:
            await anext(link)

    assert refused.value.code == code
    assert not losses.pauses_s


@pytest.mark.parametrize("code", REFUSALS)
async def test_a_refusal_without_words_gets_ours(code):
    async with serving(closing(code)) as url, dial(url) as link:
        with pytest.raises(LinkRefused) as refused:
            await anext(link)

    assert str(refused.value) == REFUSALS[code]


async def test_an_error_that_was_followed_by_more_is_no_reason_to_close():
    async def handler(socket):
        await socket.recv()
        await socket.send('{"type": "error", "message": "Too early."}')
        await socket.send('{"type": "start"}')
        await socket.close(4410)

    async with serving(handler) as url, dial(url) as link:
        await anext(link)
        await anext(link)
        with pytest.raises(LinkRefused, match="The session has ended"):
            await anext(link)


@pytest.mark.parametrize(
    ("status", "code"), [(401, 4001), (403, 4001), (404, 4004), (400, 4400), (200, 4400)]
)
async def test_a_handshake_that_is_refused_is_not_tried_again(status, code):
    def refuse(connection, request):
        return connection.respond(status, "")

    async with serving(closing(), process_request=refuse) as url, dial(url) as link:
        with pytest.raises(LinkRefused, match=f"HTTP {status}") as refused:
            await anext(link)

    assert refused.value.code == code


@pytest.mark.parametrize("status", [429, 500, 502, 503])
async def test_a_server_in_trouble_is_asked_again(status):
    asked = []

    def refuse_once(connection, request):
        asked.append(status)
        return connection.respond(status, "") if len(asked) == 1 else None

    async with serving(closing(), process_request=refuse_once) as url, dial(url) as link:
        assert await anext(link) == {"type": "welcome"}


async def test_a_proxy_whose_server_is_away_is_asked_again_once_there_was_one():
    answers = [None, 404, 403]

    def refuse(connection, request):
        status = answers.pop(0)
        return status and connection.respond(status, "")

    async def handler(socket):
        await socket.recv()
        await socket.send('{"type": "welcome"}')
        await socket.close(4012)

    losses = Losses()
    async with serving(handler, process_request=refuse) as url, dial(url, losses) as link:
        await anext(link)
        with pytest.raises(LinkRefused, match="403"):
            await anext(link)

    assert "404" in losses.reasons[1]


async def test_pauses_stay_bounded_while_there_is_no_server():
    async with serving(closing()) as url:
        pass  # now nobody listens there
    losses = Losses()
    link = dial(url, losses, timing=Timing(), jitter=lambda: 0.5)
    waiting = asyncio.create_task(anext(link))
    await until(lambda: len(losses.pauses_s) >= 9)
    waiting.cancel()
    await asyncio.gather(waiting, return_exceptions=True)
    await link.close()

    assert losses.pauses_s[:3] == pytest.approx([0.15, 0.3, 0.6])
    assert max(losses.pauses_s) == 3.75
    assert all("No server at" in reason for reason in losses.reasons)


async def test_pauses_begin_again_after_a_welcome_and_grow_on_in_trouble():
    codes = [4012, 4012, 4011, 4011, 4029, 4012, 4012]

    async def handler(socket):
        await socket.recv()
        await socket.send('{"type": "welcome"}')
        await socket.close(codes.pop(0) if codes else 4001)

    losses = Losses()
    timing = Timing()
    async with serving(handler) as url:
        link = dial(url, losses, timing=timing, jitter=lambda: 0.0)
        with pytest.raises(LinkRefused):
            async for _ in link:
                pass

    assert losses.pauses_s == pytest.approx([0.2, 0.2, 0.4, 0.8, 1.6, 0.2, 0.2])


async def test_a_server_that_hangs_up_before_a_word_is_not_hammered():
    calls = []

    async def handler(socket):
        calls.append(1)
        socket.transport.abort()
        if len(calls) > 3:
            await serving_over.wait()

    serving_over = asyncio.Event()
    losses = Losses()
    async with serving(handler) as url:
        link = dial(url, losses, jitter=lambda: 0.0, timing=Timing())
        waiting = asyncio.create_task(anext(link))
        await until(lambda: len(losses.pauses_s) >= 4)
        waiting.cancel()
        await asyncio.gather(waiting, return_exceptions=True)
        await link.close()
        serving_over.set()

    assert losses.pauses_s[:4] == pytest.approx([0.2, 0.4, 0.8, 1.6])


@pytest.mark.realtime
@pytest.mark.parametrize("talks", [False, True], ids=["listening", "sending"])
async def test_a_half_open_link_is_noticed(talks):
    greetings = []

    async def handler(socket):
        greetings.append(await socket.recv())
        await socket.send('{"type": "welcome"}')
        if len(greetings) == 1:
            socket.transport.pause_reading()  # from now on nothing is heard, not even pings
        await socket.wait_closed()

    losses = Losses()
    timing = replace(QUICK, ping_every_s=0.1, pong_within_s=0.1)
    async with (
        serving(handler, ping_interval=None, close_timeout=0.1) as url,
        dial(url, losses, timing=timing) as link,
    ):
        await anext(link)
        began = time.monotonic()
        waiting = asyncio.create_task(anext(link))
        if talks:
            # Fills every buffer on the way: then pings cannot even be sent.
            while await link.send({"type": "report", "text": "x" * 60_000}):
                pass
        assert await waiting == {"type": "welcome"}

    assert time.monotonic() - began < 5
    assert losses.reasons[0] in {"The server does not answer", "The connection broke"}
    assert len(greetings) >= 2


async def test_frames_stay_small_and_finite():
    async with serving(closing()) as url, dial(url) as link:
        await anext(link)
        with pytest.raises(FrameTooLarge):
            await link.send({"type": "report", "text": "ä" * (MAX_FRAME_BYTES // 6)})
        with pytest.raises(ValueError, match="JSON"):
            await link.send({"type": "report", "x": float("nan")})
        assert await link.send({"type": "report"})


@pytest.mark.parametrize("text", ["hello", "[1]", '{"no": "type"}', "3", "[" * 10_000, b"\xff\x00"])
async def test_what_is_no_garry_server_is_said_to_be_none(text):
    async def handler(socket):
        await socket.send(text)
        await socket.wait_closed()

    async with serving(handler) as url, dial(url) as link:
        with pytest.raises(LinkRefused, match="no GARRY server"):
            await anext(link)


async def test_a_frame_that_is_too_large_does_not_fill_the_memory():
    async def handler(socket):
        await socket.recv()
        await socket.send('{"type": "welcome"}')
        await socket.send("x" * (MAX_FRAME_BYTES + 1))
        await socket.wait_closed()

    losses = Losses()
    async with serving(handler) as url, dial(url, losses) as link:
        assert await anext(link) == {"type": "welcome"}
        assert await anext(link) == {"type": "welcome"}

    assert len(losses.reasons) == 1


async def test_hanging_up_leaves_what_is_on_its_way_and_dials_in_again():
    dialed = []

    async def flood(socket):
        dialed.append(socket)
        await socket.recv()
        for number in range(10):
            await socket.send(json.dumps({"type": "step", "of": len(dialed), "number": number}))
        await socket.wait_closed()

    losses, heard = Losses(), []
    async with serving(flood) as url, dial(url, losses) as link:
        async for message in link:
            heard.append((message["of"], message["number"]))
            if heard == [(1, 0)]:
                await asyncio.sleep(0.1)  # the rest has arrived
                link.hang_up()
                assert not link.is_open
            if message["of"] == 2:
                break
    assert heard == [(1, 0), (2, 0)]


async def test_closing_ends_the_iteration():
    async with serving(closing()) as url:
        link = dial(url)
        messages = []

        async def listen():
            messages.extend([message async for message in link])

        listening = asyncio.create_task(listen())
        await until(lambda: link.is_open)
        await link.close()
        await asyncio.wait_for(listening, 1)
