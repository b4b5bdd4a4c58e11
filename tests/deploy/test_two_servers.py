"""Behaviours of two servers on one database: whoever dials in to the wrong one is right, too.

Each with either server as the owner of the session. PostgreSQL and Redis are our own.
"""

from __future__ import annotations

import asyncio
import json
import signal
import time
from collections.abc import Callable, Coroutine, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest
from websockets.exceptions import InvalidStatus

from tests.support.cable import Cable, run_cables
from tests.support.hosted import find_missing, run_postgres, run_redis
from tests.support.pair import Dialed, Message, Pair, of_kind, of_type, step
from tests.support.robot_reports import STATUS

pytestmark = [
    pytest.mark.server,
    pytest.mark.long,
    pytest.mark.timeout(300),
    pytest.mark.skipif(bool(find_missing()), reason=f"two servers: {find_missing()}"),
]
Run = Callable[[Coroutine[Any, Any, Any]], Any]
LEASE_S = 5.0
SLOW_S = 20.0  # on a machine that does much else
at_either = pytest.mark.parametrize("owner", [0, 1])


@pytest.fixture(scope="module")
def run() -> Iterator[Run]:
    with asyncio.Runner() as runner:
        yield runner.run


@pytest.fixture(scope="module")
def cables() -> list[list[Cable]]:
    """Return each server's cables to the database and to Redis."""
    return []


@pytest.fixture(scope="module")
def pair(
    tmp_path_factory: pytest.TempPathFactory, run: Run, cables: list[list[Cable]]
) -> Iterator[Pair]:
    folder: Path = tmp_path_factory.mktemp("pair")
    with run_postgres() as database, run_redis() as redis, ExitStack() as stack:
        both = Pair(folder, database, redis)
        for place in range(2):
            urls = {"GARRY_DATABASE_URL": database, "GARRY_REDIS_URL": redis}
            both.own_environments[place], own = stack.enter_context(run_cables(urls))
            cables.append(own)
        run(both.__aenter__())
        yield both
        run(both.__aexit__())


@pytest.fixture(scope="module")
def rows(pair: Pair) -> list[Message]:
    """Return running sessions, one for each test, taken from the end."""
    return pair.seed(28)


@pytest.fixture(scope="module")
def token(pair: Pair) -> str:
    return pair.run_python("-m", "tests.support.api_seed", "pt").strip()


async def begin(pair: Pair, owner: int, row: Message, steps: int = 3) -> Dialed:
    """Let a source walk at a server, which owns the session from then on."""
    source = await pair.source(owner, row)
    await source.until(of_type("welcome", session=row["session"]))
    await walk(source, range(1, steps + 1))
    return source


async def walk(source: Dialed, numbers: range) -> None:
    for number in numbers:
        await source.say(step(number))
    if numbers:
        await source.until(lambda one: one.get("type") == "ack" and one["number"] >= numbers[-1])


@at_either
def test_1_a_tablet_at_the_other_server_sees_each_step_once_and_in_order(pair, run, rows, owner):
    row = rows.pop()

    async def story() -> None:
        source = await begin(pair, owner, row)
        tablet = await pair.tablet(1 - owner, row)
        await tablet.until(of_type("snapshot", number=3))
        await walk(source, range(4, 31))
        await tablet.until(of_kind("step", number=30))
        assert tablet.numbers() == list(range(4, 31))
        lively = [one["live"] for one in tablet.heard if one.get("kind") == "step"]
        assert lively.count(True) > 20
        await tablet.hang_up()
        await walk(source, range(31, 41))
        again = await pair.tablet(1 - owner, row, after=30)
        await again.until(of_type("snapshot"))
        await walk(source, range(41, 43))
        await again.until(of_kind("step", number=42, score=42))
        assert again.numbers() == list(range(31, 43))

    run(story())


@at_either
def test_2_a_monitor_at_the_other_server_counts_and_hears_who_is_there(pair, run, rows, owner):
    row = rows.pop()

    async def story() -> None:
        source = await begin(pair, owner, row)
        robot = await pair.robot(owner, row)
        await robot.until(of_type("welcome", watched=False))
        monitor = await pair.monitor(1 - owner, row)
        tablet = await pair.tablet(1 - owner, row)
        here = {"source": True, "robot": True, "tablets": 1}
        await monitor.until(lambda one: here.items() <= one.get("presence", {}).items())
        await robot.until(of_type("heartbeat", watched=True))  # it may begin gestures
        status = STATUS | {"battery_share": 0.5}
        await robot.say({"type": "report", "report": status})
        await monitor.until(lambda one: one.get("report", {}).get("battery_share") == 0.5)
        await robot.hang_up()
        await monitor.until(lambda one: one.get("presence", {}).get("robot") is False)
        await tablet.until(lambda one: one.get("presence", {}).get("robot") is False)
        await walk(source, range(4, 6))
        await monitor.until(of_kind("step", number=5, score=5, hits=5))

    run(story())


@at_either
def test_3_what_a_monitor_changes_at_the_other_server_counts_or_is_refused(pair, run, rows, owner):
    row = rows.pop()

    async def story() -> None:
        source = await begin(pair, owner, row)
        here, there = await pair.monitor(owner, row), await pair.monitor(1 - owner, row)
        for monitor in (here, there):
            await monitor.until(of_type("snapshot"))
        await there.say({"type": "change", "kind": "goal", "value": 3.5, "id": "a"})
        await there.until(of_type("done", id="a"))
        for monitor in (here, there):
            await monitor.until(of_kind("goal", goal=3.5))
        await source.until(of_type("goal", goal=3.5))
        await there.say({"type": "change", "kind": "goal", "value": -1, "id": "b"})
        refused = await there.until(of_type("error", id="b", code="refused"))
        assert "-1" in refused["message"]
        await there.say({"type": "remark", "what": "pain", "id": "c"})
        await there.until(of_type("done", id="c"))
        await here.until(of_kind("remark", what="pain"))
        await there.until(of_kind("remark", what="pain"))

    run(story())


@at_either
def test_4_a_change_by_the_api_goes_to_the_owner(pair, run, rows, token, owner):
    row = rows.pop()

    async def story() -> None:
        source = await begin(pair, owner, row)
        path = f"/api/v1/sessions/{row['session']}/changes"
        status, said = await pair.get(1 - owner, path, body={"kind": "pause"}, token=token)
        assert (status, json.loads(said)["state"]) == (200, "paused")
        await source.until(of_type("pause"))
        status, said = await pair.get(1 - owner, path, body={"kind": "pause"}, token=token)
        assert status == 409, said
        status, _ = await pair.get(1 - owner, path, body={"kind": "resume"}, token=token)
        assert status == 200

    run(story())


@at_either
def test_5_a_stop_at_the_other_server_stops_the_robot(pair, run, rows, owner):
    row = rows.pop()

    async def story() -> list[float]:
        await begin(pair, owner, row)
        robot = await pair.robot(owner, row)
        await robot.until(of_type("welcome", stopped=False))
        monitor, tablet = await pair.monitor(1 - owner, row), await pair.tablet(1 - owner, row)
        took: list[float] = []
        for page in (monitor, tablet):
            await page.until(of_type("snapshot"))
        for page in (monitor, tablet):
            for one in (robot, monitor, tablet):
                one.forget()
            said_s = await page.say({"type": "robot", "order": "stop"})
            took.append(robot.times[await robot.find(of_type("stop"))] - said_s)
            await monitor.until(of_kind("robot_stopped", stopped=True))
            await tablet.until(of_kind("robot_stopped", stopped=True))
            await monitor.say({"type": "robot", "order": "arm"})
            await robot.until(of_type("arm"))
            await monitor.until(of_kind("robot_stopped", stopped=False))
            assert not [one for one in page.heard if one.get("code") == "robot_unheard"]
        return took

    took = run(story())
    assert max(took) < SLOW_S


@at_either
def test_6_a_source_at_the_other_server_hears_elsewhere_and_where(pair, run, rows, owner):
    row = rows.pop()

    async def story() -> None:
        source = await begin(pair, owner, row)
        second = await pair.source(1 - owner, row)
        told = await second.until(of_type("error", code="elsewhere"))
        assert told["server"] == f"127.0.0.1:{pair.ports[owner]}"
        assert await second.until_closed() == 4421
        await walk(source, range(4, 6))  # undisturbed
        await source.hang_up()
        # Without a source there, the session goes where its source is; nobody is paused.
        third = await moved(lambda: pair.source(1 - owner, row, last=5))
        assert (await third.until(of_type("welcome")))["next"] == 6
        await walk(third, range(6, 8))
        assert pair.read_log(row)["paused"] == 0

    run(story())


async def moved(dial: Callable[[], Coroutine[Any, Any, Dialed]]) -> Dialed:
    """Return a connection that is welcome, as a client gets it that tries again."""
    for _ in range(100):
        dialed = await dial()
        first = await dialed.until(lambda one: one.get("type") in ("welcome", "error"), SLOW_S)
        if first["type"] == "welcome":
            return dialed
        assert await dialed.until_closed() == 4421, dialed.heard
        await asyncio.sleep(0.2)
    raise AssertionError("never welcome")


@at_either
def test_7_a_robot_at_the_other_server_hears_elsewhere_while_the_source_is_there(
    pair, run, rows, owner
):
    row = rows.pop()

    async def story() -> None:
        source = await begin(pair, owner, row)
        robot = await pair.robot(1 - owner, row)
        assert await robot.until_closed() == 4421
        await source.hang_up()
        robot = await moved(lambda: pair.robot(1 - owner, row))
        # A source that comes back at the first server takes session and robot along.
        source = await moved(lambda: pair.source(owner, row, last=3))
        assert await robot.until_closed() == 4421
        robot = await moved(lambda: pair.robot(owner, row))
        await walk(source, range(4, 6))

    run(story())


@at_either
def test_8_a_source_that_waits_hears_of_a_session_made_at_the_other_server(
    pair, run, rows, token, owner
):
    row = rows.pop()

    async def story() -> None:
        there = 1 - owner
        path = f"/api/v1/sessions/{row['session']}"
        await pair.get(there, f"{path}/changes", body={"kind": "abort"}, token=token)
        source = await pair.source(owner, row)
        await source.until(of_type("welcome", session=None))
        await asyncio.sleep(1.5)  # until both know of each other
        body = {**row["place"], "goal": 3.0, "source": "live"}
        status, said = await pair.get(there, "/api/v1/sessions", token=token, body=body)
        assert status == 201, said
        key = json.loads(said)["id"]
        await source.until(of_type("welcome", session=key))
        monitor = await pair.monitor(there, row | {"session": key})
        await monitor.until(of_type("snapshot", state="ready"))
        await monitor.say({"type": "change", "kind": "start", "id": "s"})
        await monitor.until(of_type("done", id="s"))
        await source.until(of_type("start"))
        await walk(source, range(1, 3))
        await monitor.until(of_kind("step", number=2))

    run(story())


@at_either
def test_9_an_orderly_stop_hands_over_what_runs_and_pauses_nobody(pair, run, rows, owner):
    row = rows.pop()

    async def story() -> None:
        await begin(pair, owner, row)
        tablet = await pair.tablet(1 - owner, row)
        await tablet.until(of_type("snapshot", number=3))
        assert await pair.end(owner, signal.SIGTERM) == 0
        pair.begin(owner)
        source = await moved(lambda: pair.source(1 - owner, row, last=3))
        assert (await source.until(of_type("welcome")))["state"] == "running"
        await walk(source, range(4, 6))
        await pair.until_ready(owner)
        await walk(source, range(6, 8))
        assert await tablet.until_closed() == 4012
        again = await pair.tablet(owner, row, after=3)
        await again.until(of_type("snapshot", number=7, score=7, state="running"))
        assert pair.read_log(row)["paused"] == 0

    run(story())


@at_either
def test_10_a_server_that_is_killed_is_replaced_and_one_that_hangs_is_told_of(
    pair, run, rows, owner
):
    row = rows.pop()

    async def story() -> None:
        await begin(pair, owner, row, steps=20)
        monitor = await pair.monitor(1 - owner, row)
        await monitor.until(of_type("snapshot", number=20))
        process = pair.processes[owner]
        assert process is not None
        process.send_signal(signal.SIGSTOP)
        said_s = await monitor.say({"type": "robot", "order": "stop"})
        unheard = await monitor.find(of_type("error", code="robot_unheard", order="stop"), 3)
        assert monitor.times[unheard] - said_s < 3
        began_s = time.monotonic()
        source = await moved(lambda: pair.source(1 - owner, row, last=20))
        assert time.monotonic() - began_s < LEASE_S + SLOW_S
        welcome = await source.until(of_type("welcome"))
        assert (welcome["state"], welcome["next"]) == ("paused", 21)
        process.send_signal(signal.SIGCONT)  # it wakes up, and owns nothing
        await walk(source, range(21, 24))
        await pair.end(owner)
        pair.begin(owner)
        await pair.until_ready(owner)
        await walk(source, range(24, 26))
        log = pair.read_log(row)
        assert (log["numbers"], log["paused"], log["refolds"]) == (list(range(1, 26)), 1, True)

    run(story())


@pytest.mark.parametrize(("owner", "cut"), [(0, 1), (1, 2)], ids=["database", "database and Redis"])
def test_11_a_server_that_is_cut_off_sends_its_clients_to_the_other(
    pair, run, rows, cables, owner, cut
):
    row = rows.pop()

    async def story() -> None:
        source = await begin(pair, owner, row)
        tablet = await pair.tablet(owner, row)
        await tablet.until(of_type("snapshot", number=3))
        for cable in cables[owner][:cut]:
            cable.cut()
        began_s = time.monotonic()
        assert await source.until_closed(SLOW_S) == 4012
        assert await tablet.until_closed(SLOW_S) == 4012
        with pytest.raises(InvalidStatus) as refused:
            await pair.tablet(owner, row)
        assert refused.value.response.status_code == 403  # the proxy asks another server
        assert (await pair.get(owner, "/start/"))[0] == 504
        source = await moved(lambda: pair.source(1 - owner, row, last=3))
        assert time.monotonic() - began_s < LEASE_S + SLOW_S
        await walk(source, range(4, 7))
        for cable in cables[owner]:
            cable.mend()
        await pair.until_ready(owner)
        again = await pair.tablet(owner, row)  # it follows
        await again.until(of_type("snapshot", number=6))
        log = pair.read_log(row)
        assert (log["numbers"], log["refolds"]) == ([1, 2, 3, 4, 5, 6], True)

    run(story())


@at_either
def test_11_a_server_that_is_cut_off_knows_of_one_that_has_just_begun(
    pair, run, rows, cables, owner
):
    row = rows.pop()

    async def story() -> None:
        source = await begin(pair, owner, row)
        assert await pair.end(1 - owner, signal.SIGTERM) == 0
        await asyncio.sleep(1.5)  # until that is read in the database
        pair.begin(1 - owner)
        await pair.until_ready(1 - owner)
        for cable in cables[owner]:
            cable.cut()
        assert await source.until_closed(SLOW_S) == 4012
        for cable in cables[owner]:
            cable.mend()
        await pair.until_ready(owner)

    run(story())


@at_either
def test_12_a_stop_on_the_page_of_an_ended_session_needs_no_redis(
    pair, run, rows, token, cables, owner
):
    row = rows.pop()

    async def story() -> None:
        there = 1 - owner
        path = f"/api/v1/sessions/{row['session']}/changes"
        await pair.get(owner, path, body={"kind": "abort"}, token=token)
        body = {**row["place"], "goal": 3.0, "source": "live"}
        status, said = await pair.get(there, "/api/v1/sessions", token=token, body=body)
        assert status == 201, said
        source = await pair.source(there, row)
        await source.until(of_type("welcome", session=json.loads(said)["id"]))
        robot = await pair.robot(there, row)
        await robot.until(of_type("welcome", session=json.loads(said)["id"], stopped=False))
        monitor = await pair.monitor(owner, row)  # of the session that has ended
        await monitor.until(of_type("snapshot", state="aborted"))
        _, to_redis = cables[owner]
        to_redis.cut()
        try:
            said_s = await monitor.say({"type": "robot", "order": "stop"})
            stopped = await robot.find(of_type("stop"))
            await monitor.until(of_kind("robot_stopped", stopped=True))
        finally:
            to_redis.mend()
        assert robot.times[stopped] - said_s < 3
        await pair.until_ready(owner)

    run(story())
