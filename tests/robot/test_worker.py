"""The worker on a real socket: it answers, it stops when it should, it dials in again."""

import asyncio
import time
from contextlib import asynccontextmanager
from functools import partial

import pytest

from robot.bases import BASES, BaseLost
from robot.black_box import recorder
from robot.black_box.recorder import BlackBox
from robot.link import REFUSALS, Link, LinkRefused, Timing
from robot.motion.pose import HOME
from robot.motion.twist import STILL
from robot.wire.close_codes import CloseCode
from robot.wire.incident import unpack
from robot.worker import Worker
from tests.support.fake_robot_server import TOKEN, FakeGarry, serve_garry
from tests.support.robot_stage import IdealBase, RealBase

FAST = Timing(retry_first_s=0.02, retry_longest_s=0.1)
ENDING = REFUSALS.keys() - {CloseCode.NOT_PROTOCOL}  # of the close codes, those that end the work


@pytest.fixture
async def garry():
    garry = FakeGarry()
    async with serve_garry(garry):
        yield garry


@asynccontextmanager
async def working(garry, base=None, token=TOKEN, said=None, box=None):
    base = base or IdealBase(time.monotonic)
    notice = (lambda _: None) if said is None else said.append
    dial = partial(Link, garry.url, token, timing=FAST)
    worker = Worker(dial, base, notice=notice, black_box=box)
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


@pytest.mark.realtime
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


@pytest.mark.realtime
async def test_it_greets_rests_and_takes_leave_as_the_state_changes(garry):
    garry.welcome |= {"state": "ready", "watched": True}
    base = IdealBase(time.monotonic)
    async with working(garry, base):
        await garry.until_hello(1)
        await garry.until(is_kind("status", state="idle"))
        for state, moment in (
            ("running", "greeting"),
            ("paused", "rest"),
            ("running", None),
            ("finished", "farewell"),
        ):
            await garry.tell(type="state", state=state, gesture=moment)
            if moment is not None:
                begun = await garry.until(is_kind("gesture", phase="started", pool=moment))
                assert begun["name"].startswith(moment)
                await garry.until(is_kind("gesture", name=begun["name"], outcome="done"))
                assert base.read().pose.distance_m(HOME) < 0.02


@pytest.mark.essential
@pytest.mark.realtime
async def test_a_stop_is_at_the_base_within_a_tenth_of_a_second(garry):
    base = IdealBase(time.monotonic)
    async with working(garry, base):
        await garry.until_hello(1)
        await garry.walk(0, 1, 2, 3, 4, 5)
        await garry.until(is_kind("status", state="performing"))
        await asyncio.sleep(0.4)
        assert not base.read().twist.is_still
        await garry.tell(type="stop")
        await until_still(base, 0.1)
        await garry.until(is_kind("gesture", phase="ended", outcome="stopped"))


@pytest.mark.essential
@pytest.mark.realtime
async def test_silence_stops_it_and_what_was_on_its_way_counts_no_more(garry):
    base = IdealBase(time.monotonic)
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


@pytest.mark.realtime
async def test_after_a_hang_a_stop_that_waited_counts_and_a_step_does_not(garry):
    async with working(garry) as worker:
        await garry.until_hello(1)
        await garry.until(is_kind("status", state="idle", reason=""))
        await garry.tell(type="stop")
        time.sleep(0.4)  # noqa: ASYNC251 (its loop stands, and the stop waits in its socket)
        await garry.until(is_kind("status", state="stopped", reason="stopped"))
        await asyncio.sleep(0.1)
        await garry.tell(type="arm")
        await garry.walk(0, 1, 2, 3, 4)
        await asyncio.sleep(0.1)
        await garry.walk(5)
        time.sleep(0.4)  # noqa: ASYNC251
        await asyncio.sleep(0.1)
        assert worker.performer.decision is None
        await garry.walk(6, 7, 8, 9, 10, 11)
        await garry.until(is_kind("decision", gesture="celebrate"))
        assert len(garry.sockets) == 1


@pytest.mark.realtime
async def test_a_server_that_goes_stops_it_and_is_found_again():
    garry, base = FakeGarry(), IdealBase(time.monotonic)
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


# Every end of a connection: those of the standard, those of docs/protocol.md, and some of nobody.
STANDARD = [1000, 1001, 1002, 1003, 1007, 1008, 1009, 1010, 1011, 1012, 1013, 1014, 3000]
OURS = [4000, 4001, 4004, 4008, 4009, 4011, 4012, 4029, 4400, 4409, 4410, 4421, 4999]


@pytest.mark.realtime
@pytest.mark.parametrize("code", [None, *STANDARD, *OURS])
async def test_however_the_server_hangs_up_it_stands_still_until_somebody_orders(garry, code):
    garry.welcome |= {"watched": True}
    base = RealBase(time.monotonic)
    said: list[str] = []
    async with working(garry, base, said=said) as worker:
        await garry.until_hello(1)
        await garry.tell(type="arm")
        await garry.walk(0, 1, 2, 3, 4, 5)
        async with asyncio.timeout(5):
            while base.read().twist.is_still:  # noqa: ASYNC110 (a base tells nobody)
                await asyncio.sleep(0.002)
        socket = garry.sockets[-1]
        if code is None:
            socket.transport.abort()
        else:
            await socket.close(code)
        await until_still(base, 0.1)
        assert not worker.performer.body.safety.is_armed or code in ENDING
        if code not in ENDING:
            await garry.until_hello(2)
            assert "dialing in again" in " ".join(said)
            await garry.until(is_kind("gesture", phase="ended", outcome="no_link"))
            await garry.walk(6, 7, 8, 9, 10, 11)
        for _ in range(20):
            await asyncio.sleep(0.01)
            assert base.read().twist.is_still


async def test_a_server_that_refuses_every_report_is_not_hammered(garry):
    pauses_s: list[float] = []

    async def sleep(pause_s):
        pauses_s.append(pause_s)
        await asyncio.sleep(0)

    dial = partial(Link, garry.url, TOKEN, timing=FAST, jitter=lambda: 0.0, sleep=sleep)
    worker = Worker(dial, IdealBase(time.monotonic))
    task = asyncio.create_task(worker.run())
    for count in range(1, 5):
        await garry.until_hello(count)
        async with asyncio.timeout(5):
            while not worker.performer.is_linked:  # noqa: ASYNC110
                await asyncio.sleep(0.002)
        await garry.sockets[-1].close(4400)
    await garry.until_hello(5)
    assert pauses_s == [0.02, 0.04, 0.08, 0.1]
    task.cancel()
    await asyncio.gather(task, return_exceptions=True)


@pytest.mark.parametrize("junk", ["not json", "[1]", '{"type":', "\x00", '"step"', "7", "NaN"])
async def test_a_broken_frame_is_counted_and_the_work_goes_on(garry, junk):
    async with working(garry):
        await garry.until_hello(1)
        await garry.tell(junk)
        await garry.until(is_kind("status", bad_messages=1))
        await garry.walk(0, 1, 2, 3, 4, 5)
        await garry.until(is_kind("decision", gesture="celebrate"))
        assert len(garry.sockets) == 1


@pytest.mark.parametrize(
    ("token", "welcome", "words"),
    [(TOKEN, {"no": "type"}, "no GARRY server"), ("wrong", {}, "Unknown token")],
)
async def test_a_stranger_or_a_refusal_ends_it(garry, token, welcome, words):
    garry.welcome = welcome
    worker = Worker(partial(Link, garry.url, token), BASES["null"](time.monotonic))
    with pytest.raises(LinkRefused, match=words):
        async with asyncio.timeout(5):
            await worker.run()


async def test_a_base_that_is_lost_ends_it(garry):
    class Unplugged(IdealBase):
        def read(self):
            raise BaseLost("The base is unplugged.")

        def stop(self):
            pass

    worker = Worker(partial(Link, garry.url, TOKEN), Unplugged(time.monotonic))
    with pytest.raises(BaseLost, match="unplugged"):
        async with asyncio.timeout(5):
            await worker.run()


@pytest.mark.realtime
async def test_what_was_recorded_around_a_stop_is_sent_once_to_its_own_session(
    garry, tmp_path, monkeypatch
):
    monkeypatch.setattr(recorder, "AFTER_S", 0.3)
    monkeypatch.setattr(recorder, "WRITE_EVERY_S", 0.05)
    with BlackBox(tmp_path) as box:
        async with working(garry, box=box):
            await garry.until_hello(1)
            await garry.walk(0, 1, 2, 3, 4, 5)
            await garry.until(is_kind("status", state="performing"))
            await asyncio.sleep(0.8)
            await garry.tell(type="stop")
            async with asyncio.timeout(10):
                while not garry.incidents:  # noqa: ASYNC110
                    await asyncio.sleep(0.01)
            await asyncio.sleep(0.3)
    (incident,) = garry.incidents
    assert (incident["session"], incident["reason"]) == (7, "stopped")
    assert 0.3 <= incident["ago_s"] < 5
    records = unpack(incident["recording"])
    assert {"type": "stop"} in [one.get("received") for one in records]
    assert any(any(one["tick"][:2]) for one in records if "tick" in one)


@pytest.mark.realtime
async def test_another_session_gets_nothing_of_the_one_before(garry, tmp_path, monkeypatch):
    monkeypatch.setattr(recorder, "AFTER_S", 0.3)
    monkeypatch.setattr(recorder, "WRITE_EVERY_S", 0.05)
    with BlackBox(tmp_path) as box:
        async with working(garry, box=box):
            await garry.until_hello(1)
            await garry.tell(type="stop")
            await garry.tell(**garry.welcome | {"session": 8})
            async with asyncio.timeout(10):
                while not list(tmp_path.glob("incident-*")):  # noqa: ASYNC110
                    await asyncio.sleep(0.01)
            await asyncio.sleep(0.3)
        assert not box.incidents
    assert garry.incidents == []
