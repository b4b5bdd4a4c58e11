"""Two servers behind HAProxy under load, and each part of the set fails in turn.

GARRY_TEST_FAULTS times each (20), by GARRY_TEST_SEED (GARRY_TEST_FAULT: only those so named): no
acknowledged step lost or doubled, no gap at a viewer, orderly restarts pause nobody, and
a stop arrives.

What this machine cannot break (tests/support/faulty_set.py) is left out, and the report says so.
"""

from __future__ import annotations

import asyncio
import os
import random
import signal
import statistics
import time
from collections.abc import Awaitable, Callable
from contextlib import suppress
from itertools import pairwise
from pathlib import Path
from typing import Any

import psycopg
import pytest

from tests.support.faulty_set import FAKE_TIME, FaultySet, run_faulty_set
from tests.support.hosted import REVIVE_POSTGRES, find_missing, run_haproxy
from tests.support.pair import Message, of_type
from tests.support.torture import GONE, Entrance, Walk

pytestmark = pytest.mark.skipif(bool(find_missing()), reason=f"faults: {find_missing()}")
SESSIONS, RATE = 6, 4.0
RECOVERED_S = 90.0
CUT_S = 60.0  # a network without a word
FULL_S = 10.0
JUMPS = ("+3600", "-3600")  # seconds

Heal = Callable[[], Awaitable[None]]


def has_more(walk: Walk, mark: int) -> bool:
    """Return whether a step after this one was acknowledged, and one was seen."""
    return walk.acknowledged > mark and bool(walk.seen) and walk.seen[-1] > mark


class Faults:
    """The set, its load, and what each fault did."""

    def __init__(self, broken: FaultySet, entrance: Entrance, seed: int) -> None:
        self.set, self.pair, self.restarts = broken, broken.pair, broken.restarts
        self.entrance = entrance
        self.began_s = 0.0
        self.random = random.Random(seed)
        self.walks: list[Walk] = []
        self.recovered_s: dict[str, list[float]] = {}
        self.stops_s: list[float] = []
        self.paused_by_order = 0
        self.went_on_without = 0  # sessions, at the other server while one was cut off
        self.kept_back = 0  # acknowledgements, while the disk was full

    @property
    def kinds(self) -> dict[str, Callable[[], Awaitable[Heal | None]]]:
        """The faults, by name. What one returns mends it, after sessions went on without."""
        faults: dict[str, Callable[[], Awaitable[Heal | None]]] = {
            "kill -9 of a server": self.kill_server,
            "its database connections": self.cut_connections,
            "PostgreSQL": lambda: asyncio.to_thread(self.restarts["postgres"]),
            "haproxy": lambda: asyncio.to_thread(self.restarts["haproxy"]),
            "rolling restart": self.restart_each,
            "a server's network": self.cut_network,
            "clock of a server": lambda: self.set_clock(self.random.randrange(2)),
        }
        if self.set.disk is not None:
            faults["disk full"] = self.fill_disk
        if FAKE_TIME is not None:
            faults["clock of the database"] = lambda: self.set_clock(2)
        return faults

    async def kill_server(self) -> None:
        place = await asyncio.to_thread(self.pair.find_busiest)
        await self.pair.end(place)
        self.pair.begin(place)

    async def cut_connections(self) -> None:
        def cut() -> None:
            url = self.pair.environment["GARRY_DATABASE_URL"]
            with psycopg.connect(url, autocommit=True) as connection:
                connection.execute(
                    "SELECT pg_terminate_backend(pid) FROM pg_stat_activity "
                    "WHERE datname = 'garry' AND pid <> pg_backend_pid()"
                )

        await asyncio.to_thread(cut)

    async def restart_each(self) -> None:
        for place in range(2):
            assert await self.pair.end(place, signal.SIGTERM) == 0
            self.pair.begin(place)
            await self.pair.until_ready(place, 120)

    async def cut_network(self) -> Heal:
        """Cut a server off the database; clients still reach it."""
        place = await asyncio.to_thread(self.pair.find_busiest)
        for cable in self.set.cables[place]:
            cable.cut()
        until_s = time.monotonic() + CUT_S

        async def mend() -> None:
            self.went_on_without += time.monotonic() < until_s
            await asyncio.sleep(until_s - time.monotonic())
            for cable in self.set.cables[place]:
                cable.mend()

        return mend

    async def fill_disk(self) -> None:
        """Fill the database's disk; nothing is acknowledged until there is room again."""
        assert self.set.disk is not None
        filler = self.set.disk / "filler"
        with suppress(OSError), filler.open("wb", buffering=0) as file:
            while file.write(bytes(4096)):
                pass
        await asyncio.sleep(FULL_S)
        marks = [walk.acknowledged for walk in self.walks]
        await asyncio.sleep(2)
        self.kept_back += marks == [walk.acknowledged for walk in self.walks]
        filler.unlink()
        self.began_s = time.monotonic()
        await asyncio.to_thread(self.restarts[REVIVE_POSTGRES])

    async def set_clock(self, which: int) -> Heal:
        """Let a clock jump by an hour, and back again when sessions go on."""
        self.set.clocks[which].jump(self.random.choice(JUMPS))
        await asyncio.sleep(3)

        async def put_right() -> None:
            self.set.clocks[which].jump("+0")
            await asyncio.sleep(3)

        return put_right

    async def go_on(self) -> None:
        """Wait until each source is acknowledged and each viewer sees more."""
        marks = [walk.made for walk in self.walks]
        async with asyncio.timeout(RECOVERED_S):
            while not all(map(has_more, self.walks, marks)):  # noqa: ASYNC110
                await asyncio.sleep(0.02)

    async def run_one(self, name: str) -> None:
        """Let one thing fail, and wait until all sessions have gone on."""
        before = self.count_pauses() if name == "rolling restart" else 0
        self.began_s = time.monotonic()
        heal = await self.kinds[name]()
        await self.go_on()
        self.recovered_s.setdefault(name, []).append(time.monotonic() - self.began_s)
        print(f"{name}: {self.recovered_s[name][-1]:.1f} s", flush=True)
        if heal is not None:
            await heal()
            await self.go_on()
        if name == "rolling restart":
            self.paused_by_order += self.count_pauses() - before
        for place in range(2):
            await self.pair.until_ready(place, 120)
        await asyncio.gather(*(self.resume(walk.row) for walk in self.walks))
        await self.stop(self.random.choice(self.walks).row)

    def count_pauses(self) -> int:
        with psycopg.connect(self.pair.environment["GARRY_DATABASE_URL"]) as connection:
            found = connection.execute(
                "SELECT count(*) FROM rehab_sessionevent WHERE kind = 'pause'"
            )
            return int(found.fetchone()[0])

    async def resume(self, row: Message) -> None:
        """Let a session go on that a fault has paused, as a therapist does."""
        said = ""
        for _ in range(100):
            monitor = None
            try:
                monitor = await self.pair.monitor(self.random.randrange(2), row)
                shown = await monitor.until(lambda one: one["type"] in ("snapshot", "error"))
                if shown["type"] == "error":  # the clinic lives in the other server
                    said = str(shown)
                    await asyncio.sleep(0.2)
                    continue
                if shown["state"] == "running":
                    return
                await monitor.say({"type": "change", "kind": "resume", "id": "r"})
                await monitor.until(lambda one: one.get("id") == "r")
            except (AssertionError, *GONE) as problem:
                said = repr(problem)
                await asyncio.sleep(0.2)
            finally:
                if monitor is not None:
                    await monitor.hang_up()
        raise AssertionError(f"never resumed: {said}")

    async def stop(self, row: Message) -> None:
        """Measure how soon a stop reaches the robot."""
        try:
            place, robot = await self.find_robots_place(row)
            monitor = await self.pair.monitor(place, row)
            await monitor.until(of_type("snapshot"))
            for _ in range(5):
                robot.forget()
                monitor.forget()
                said_s = await monitor.say({"type": "robot", "order": "stop"})
                self.stops_s.append(robot.times[await robot.find(of_type("stop"), 2)] - said_s)
                await monitor.say({"type": "robot", "order": "arm"})
                await robot.until(of_type("arm"))
        finally:
            await self.pair.hang_up_all()

    async def find_robots_place(self, row: Message) -> tuple[int, Any]:
        for attempt in range(100):
            robot = await self.pair.robot(attempt % 2, row)
            first = await robot.until(lambda one: one["type"] in ("welcome", "error"))
            if first["type"] == "welcome":
                return attempt % 2, robot
            await asyncio.sleep(0.2)
        raise AssertionError("no server has the session")

    async def run(self, times: int) -> None:
        """Let everything fail so many times, in a random order."""
        rows = self.pair.seed(SESSIONS)
        self.walks = [Walk(row, self.entrance, RATE) for row in rows]
        senders = [asyncio.create_task(walk.send()) for walk in self.walks]
        watchers = [asyncio.create_task(walk.watch()) for walk in self.walks]
        async with asyncio.timeout(RECOVERED_S):
            while not all(walk.acknowledged for walk in self.walks):  # noqa: ASYNC110
                await asyncio.sleep(0.05)
        only = os.environ.get("GARRY_TEST_FAULT", "")
        wanted = [name for name in self.kinds if only in name] * times
        self.random.shuffle(wanted)
        for name in wanted:
            await self.run_one(name)
        for walk in self.walks:
            walk.stopping = True
        await asyncio.wait_for(asyncio.gather(*senders), 60)
        with suppress(TimeoutError):  # what they have not seen is told as a problem
            async with asyncio.timeout(RECOVERED_S):
                while not all(walk.has_seen_all for walk in self.walks):  # noqa: ASYNC110
                    await asyncio.sleep(0.05)
        await asyncio.sleep(1)  # and what they see again
        for watcher in watchers:
            watcher.cancel()


@pytest.mark.timeout(0)
def test_each_part_fails_under_load_and_nothing_is_lost(tmp_path: Path) -> None:
    seed = int(os.environ.get("GARRY_TEST_SEED", "20261122"))
    times = int(os.environ.get("GARRY_TEST_FAULTS", "20"))
    (tmp_path / "garry").mkdir()
    with run_faulty_set(tmp_path / "garry") as broken:
        pair = broken.pair
        proxy = run_haproxy(tmp_path / "haproxy", *pair.ports, restarts=broken.restarts)
        with proxy as (_, secure, tls):
            print(f"\nlog: {pair.log}")
            print(f"seed {seed}, each fault {times} times, {SESSIONS} sessions × {RATE:g}/s")
            faults = Faults(broken, Entrance(secure, tls), seed)
            asyncio.run(run_all(faults, times))
            problems = find_problems(faults)
    report(faults, problems)
    assert problems == []
    assert faults.paused_by_order == 0
    assert faults.went_on_without == len(faults.recovered_s.get("a server's network", ()))
    assert faults.kept_back == len(faults.recovered_s.get("disk full", ()))


async def run_all(faults: Faults, times: int) -> None:
    async with faults.pair:
        await faults.run(times)
        for place in range(2):
            assert await faults.pair.end(place, signal.SIGTERM) == 0


def find_problems(faults: Faults) -> list[str]:
    """Return what was lost or doubled, in the log or at a viewer."""
    problems: list[str] = []
    for walk in faults.walks:
        log = faults.pair.read_log(walk.row)
        if log["numbers"] != list(range(1, walk.made + 1)) or not log["refolds"]:
            problems.append(f"session {walk.row['session']}: {walk.made}, {log}")
        if walk.seen != list(range(1, walk.made + 1)):
            missed = sorted(set(range(1, walk.made + 1)) - set(walk.seen))
            again = [b for a, b in pairwise(walk.seen) if b <= a]
            problems.append(
                f"session {walk.row['session']}: of {walk.made} steps a viewer missed {missed}, "
                f"and saw {again} again"
            )
    return problems


def report(faults: Faults, problems: list[str]) -> None:
    for name, took_s in sorted(faults.recovered_s.items()):
        print(
            f"{name:26} n {len(took_s):2}  recovered: median {statistics.median(took_s):5.1f} s, "
            f"last {max(took_s):5.1f} s"
        )
    if faults.set.disk is None:
        print("disk full: left out, mounting needs root")
    if FAKE_TIME is None:
        print("clock of the database: left out, apt-get install faketime")
    stops = sorted(faults.stops_s)
    print(
        f"stop: n {len(stops)}, median "
        f"{1000 * statistics.median(stops):.0f} ms, "
        f"p99 {1000 * stops[int(0.99 * len(stops))]:.0f} ms, last {1000 * stops[-1]:.0f} ms"
    )
    steps = sum(walk.made for walk in faults.walks)
    print(f"paused by orderly restarts: {faults.paused_by_order}")
    print(f"steps: {steps}; problems: {len(problems)}", *problems, sep="\n")
