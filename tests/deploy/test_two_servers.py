"""Two servers on one database: a clinic lives in one of them, and all find it.

Each with either server as the one that a clinic belongs to. PostgreSQL is our own.
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

from tests.support.cable import Cable, run_cables
from tests.support.hosted import find_missing, run_postgres
from tests.support.pair import Dialed, Message, Pair, of_kind, of_type, step

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
def cables() -> list[Cable]:
    """Return each server's cable to the database."""
    return []


@pytest.fixture(scope="module")
def pair(tmp_path_factory: pytest.TempPathFactory, run: Run, cables: list[Cable]) -> Iterator[Pair]:
    folder: Path = tmp_path_factory.mktemp("pair")
    with run_postgres() as database, ExitStack() as stack:
        both = Pair(folder, database)
        for place in range(2):
            urls = {"GARRY_DATABASE_URL": database}
            both.own_environments[place], own = stack.enter_context(run_cables(urls))
            cables.extend(own)
        run(both.__aenter__())
        yield both
        run(both.__aexit__())


@pytest.fixture(scope="module")
def rows(pair: Pair) -> list[Message]:
    """Return sessions that are ready, each in a clinic of its own."""
    return pair.seed(48, "ready")


@pytest.fixture
def row(pair: Pair, rows: list[Message], owner: int) -> Message:
    """Return a session of a clinic that belongs to the owner, and that nobody has yet."""
    found = next(row for row in rows if pair.place_of(row) == owner)
    rows.remove(found)
    return found


async def begin(pair: Pair, owner: int, row: Message, steps: int = 3) -> Dialed:
    """Let a patient walk at the server that the clinic belongs to."""
    source = await moved(lambda: pair.source(owner, row))
    await source.until(of_type("welcome", session=row["session"]))
    monitor = await pair.monitor(owner, row)
    await monitor.say({"type": "change", "kind": "start", "id": "s"})
    await monitor.until(of_type("done", id="s"))
    await monitor.hang_up()
    await walk(source, range(1, steps + 1))
    return source


async def walk(source: Dialed, numbers: range) -> None:
    for number in numbers:
        await source.say(step(number))
    if numbers:
        await source.until(lambda one: one.get("type") == "ack" and one["number"] >= numbers[-1])


async def moved(dial: Callable[[], Coroutine[Any, Any, Dialed]]) -> Dialed:
    """Return a connection that is welcome, as a client gets it that tries again."""
    for _ in range(150):
        dialed = await dial()
        first = await dialed.until(
            lambda one: one.get("type") in ("welcome", "snapshot", "error"), SLOW_S
        )
        if first["type"] != "error":
            return dialed
        assert await dialed.until_closed() == 4421, dialed.heard
        await asyncio.sleep(0.2)
    raise AssertionError("never welcome")


@at_either
def test_1_who_dials_in_to_the_wrong_server_hears_where_the_clinic_lives(pair, run, row, owner):
    async def story() -> None:
        wrong = 1 - owner
        for dial in (pair.source, pair.robot, pair.tablet, pair.monitor):  # nobody has it yet
            told = await (await dial(wrong, row)).until(of_type("error", code="elsewhere"))
            assert told["server"] == f"127.0.0.1:{pair.ports[owner]}"
        source = await begin(pair, owner, row)
        for dial in (pair.source, pair.robot, pair.tablet, pair.monitor):
            dialed = await dial(wrong, row)
            told = await dialed.until(of_type("error", code="elsewhere"))
            assert told["server"] == f"127.0.0.1:{pair.ports[owner]}"
            assert await dialed.until_closed() == 4421
        await walk(source, range(4, 6))  # undisturbed
        tablet = await pair.tablet(owner, row)
        await tablet.until(of_type("snapshot", number=5))

    run(story())


@at_either
def test_2_a_stop_is_heard_at_once_from_every_page(pair, run, row, owner):
    async def story() -> list[float]:
        await begin(pair, owner, row)
        robot = await pair.robot(owner, row)
        await robot.until(of_type("welcome", stopped=False))
        monitor, tablet = await pair.monitor(owner, row), await pair.tablet(owner, row)
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
        return took

    assert max(run(story())) < SLOW_S


@at_either
def test_3_what_changes_something_by_http_is_for_the_clinics_server(pair, run, row, owner):
    async def story() -> None:
        wrong, token = 1 - owner, row["token"]
        path = f"/api/v1/sessions/{row['session']}"
        status, said = await pair.get(wrong, f"{path}/changes", body={"kind": "abort"}, token=token)
        assert status == 307, said  # nobody has it yet
        source = await begin(pair, owner, row)
        status, said = await pair.get(wrong, f"{path}/changes", body={"kind": "pause"}, token=token)
        assert status == 307
        assert pair.redirected.endswith(f"garry_server=127.0.0.1%3A{pair.ports[owner]}")
        status, said = await pair.get(owner, f"{path}/changes", body={"kind": "pause"}, token=token)
        assert (status, json.loads(said)["state"]) == (200, "paused")
        await source.until(of_type("pause"))
        assert (await pair.get(wrong, path, token=token))[0] == 200  # reading works at any

    run(story())


@at_either
def test_4_a_source_that_waits_hears_of_a_new_session(pair, run, row, owner):
    async def story() -> None:
        token = row["token"]
        path = f"/api/v1/sessions/{row['session']}"
        await pair.get(owner, f"{path}/changes", body={"kind": "abort"}, token=token)
        source = await moved(lambda: pair.source(owner, row))
        await source.until(of_type("welcome", session=None))
        body = {**row["place"], "goal": 3.0, "source": "live"}
        status, said = await pair.get(1 - owner, "/api/v1/sessions", token=token, body=body)
        assert status == 307, said  # whose devices wait elsewhere
        status, said = await pair.get(owner, "/api/v1/sessions", token=token, body=body)
        assert status == 201, said
        await source.until(of_type("welcome", session=json.loads(said)["id"]))

    run(story())


@at_either
def test_5_an_orderly_stop_hands_over_what_runs_and_pauses_nobody(pair, run, row, owner):
    async def story() -> None:
        await begin(pair, owner, row)
        tablet = await pair.tablet(owner, row)
        await tablet.until(of_type("snapshot", number=3))
        assert await pair.end(owner, signal.SIGTERM) == 0
        assert await tablet.until_closed() == 4012
        source = await moved(lambda: pair.source(1 - owner, row, last=3))
        assert (await source.until(of_type("welcome")))["state"] == "running"
        await walk(source, range(4, 6))
        pair.begin(owner)
        await pair.until_ready(owner)
        await walk(source, range(6, 8))  # it stays where it runs
        again = await pair.tablet(1 - owner, row, after=3)
        await again.until(of_type("snapshot", number=7, score=7, state="running"))
        assert pair.read_log(row)["paused"] == 0
        # Once no session is open it moves to where it belongs.
        monitor = await pair.monitor(1 - owner, row)
        await monitor.say({"type": "change", "kind": "finish", "id": "f"})
        for one in (source, again, monitor):
            assert await one.until_closed(SLOW_S) == 4012
        tablet = await moved(lambda: pair.tablet(owner, row))
        await tablet.until(of_type("snapshot", number=7, state="finished"))

    run(story())


@at_either
def test_6_a_server_that_hangs_loses_its_clinics_and_moves_no_robot_when_it_wakes_up(
    pair, run, row, owner
):
    async def story() -> None:
        old_source = await begin(pair, owner, row, steps=20)
        old_robot, old_monitor = await pair.robot(owner, row), await pair.monitor(owner, row)
        await old_robot.until(of_type("heartbeat"))
        await old_monitor.until(of_type("snapshot", number=20))
        process = pair.processes[owner]
        assert process is not None
        process.send_signal(signal.SIGSTOP)
        for number in (21, 22):  # on their way when it hung
            await old_source.say(step(number))
        await old_monitor.say({"type": "robot", "order": "drive", "ahead": 1, "left": 0})
        began_s = time.monotonic()
        source = await moved(lambda: pair.source(1 - owner, row, last=20))
        assert time.monotonic() - began_s < LEASE_S + SLOW_S
        welcome = await source.until(of_type("welcome"))
        assert (welcome["state"], welcome["next"]) == ("paused", 21)
        robot = await pair.robot(1 - owner, row)
        await robot.until(of_type("heartbeat"))
        old_robot.forget()
        process.send_signal(signal.SIGCONT)  # it wakes up, and owns nothing
        for one in (old_source, old_robot, old_monitor):
            assert await one.until_closed(SLOW_S) in (4011, 4012)
        moving = {"heartbeat", "drive", "arm", "event", "welcome"}
        assert not [one for one in old_robot.heard if one.get("type") in moving], old_robot.heard
        assert not [one for one in old_source.heard if one.get("number", 0) > 20]
        await walk(source, range(21, 24))
        await pair.until_ready(owner)
        log = pair.read_log(row)
        assert (log["numbers"], log["paused"], log["refolds"]) == (list(range(1, 24)), 1, True)

    run(story())


@at_either
def test_7_a_server_that_is_cut_off_sends_its_clients_to_the_other(pair, run, row, cables, owner):
    async def story() -> None:
        source = await begin(pair, owner, row)
        tablet = await pair.tablet(owner, row)
        await tablet.until(of_type("snapshot", number=3))
        cables[owner].cut()
        began_s = time.monotonic()
        assert await source.until_closed(SLOW_S) == 4012
        assert await tablet.until_closed(SLOW_S) == 4012
        assert await (await pair.tablet(owner, row)).until_closed(SLOW_S) == 4012
        assert (await pair.get(owner, "/start/"))[0] == 504
        source = await moved(lambda: pair.source(1 - owner, row, last=3))
        assert time.monotonic() - began_s < LEASE_S + SLOW_S
        await walk(source, range(4, 7))
        cables[owner].mend()
        await pair.until_ready(owner)
        again = await pair.tablet(owner, row)
        await again.until(of_type("error", code="elsewhere"))
        log = pair.read_log(row)
        assert (log["numbers"], log["refolds"]) == ([1, 2, 3, 4, 5, 6], True)

    run(story())
