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
from tests.support.real_clinic import RealClinic
from tests.support.torture import GONE, Entrance, Walk

pytestmark = pytest.mark.skipif(bool(find_missing()), reason=f"faults: {find_missing()}")
SESSIONS, RATE = 6, 4.0
RECOVERED_S = 90.0
CUT_S = 60.0  # a network without a word
HUNG_S = 30.0  # a server that hangs, and then goes on as if nothing were
GRAY_S = 3.5  # into that, when pages have to know nothing any more
FULL_S = 10.0
UNHEARD_S = 1.0  # 0.5 s, on a machine that does nothing else
JUMPS = ("+3600", "-3600")  # seconds

Heal = Callable[[], Awaitable[None]]


def has_more(walk: Walk, mark: int) -> bool:
    """Return whether a step after this one was acknowledged, and one was seen."""
    return walk.acknowledged > mark and bool(walk.seen) and walk.seen[-1] > mark


class Faults:
    """The set, its load, and what each fault did."""

    def __init__(self, broken: FaultySet, entrance: Entrance, certificate: Path, seed: int) -> None:
        self.certificate = certificate
        self.set, self.pair, self.restarts = broken, broken.pair, broken.restarts
        self.entrance = entrance
        self.began_s = 0.0
        self.random = random.Random(seed)
        self.walks: list[Walk] = []
        self.tasks: list[asyncio.Task[None]] = []  # of the walks: none of them ends by itself
        self.recovered_s: dict[str, list[float]] = {}
        self.stops_s: list[float] = []
        self.paused_by_order = 0
        self.went_on_without = 0  # sessions, at the other server while one was cut off
        self.kept_back = 0  # acknowledgements, while the disk was full
        self.clinic: RealClinic | None = None
        self.false_claims: list[str] = []  # of pages whose server hung
        self.unheard_s: list[float] = []  # after a stop there, until the page said so
        self.pages_s: list[float] = []  # until both pages were fresh, everybody connected

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
            "a server hangs": self.hang_server,
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

    async def hang_server(self) -> Heal:
        """Freeze the server of the real pages, which nobody supervises; it wakes up again."""
        assert self.clinic is not None
        await self.clinic.come_back(RECOVERED_S)
        await self.clinic.resume()  # another fault may have paused it
        await self.clinic.go_on(RECOVERED_S)
        place = await asyncio.to_thread(self.pair.find_busiest, self.clinic.row["clinic"])
        process = self.pair.processes[place]
        assert process is not None
        began_s = self.began_s = time.monotonic()
        hung_at = time.time()
        process.send_signal(signal.SIGSTOP)
        turn = len(self.pages_s) + 1
        await asyncio.sleep(GRAY_S)
        self.false_claims += await self.clinic.find_false_claims()
        self.unheard_s.append(await self.clinic.stop())
        await self.clinic.picture(f"hang-{turn}-silent")
        await self.clinic.come_back(RECOVERED_S)
        self.pages_s.append(time.monotonic() - began_s)
        await self.clinic.picture(f"hang-{turn}-back")
        self.false_claims += await self.clinic.find_celebrated(hung_at + 2.5, time.time())
        print(
            f"pages: back after {self.pages_s[-1]:.1f} s, a stop unheard after "
            f"{self.unheard_s[-1]:.2f} s, {self.false_claims}"
        )
        await self.clinic.resume()
        await self.clinic.go_on(RECOVERED_S)
        await self.clinic.picture(f"hang-{turn}-resumed")

        async def wake_up() -> None:
            assert self.clinic is not None
            await asyncio.sleep(max(0.0, began_s + HUNG_S - time.monotonic()))
            process.send_signal(signal.SIGCONT)
            await self.clinic.go_on(RECOVERED_S)
            await self.clinic.picture(f"hang-{turn}-awake")

        return wake_up

    async def fill_disk(self) -> None:
        """Fill the database's disk; nothing is acknowledged until there is room again."""
        assert self.set.disk is not None
        filler = self.set.disk / "filler"
        until_s = time.monotonic() + FULL_S
        while time.monotonic() < until_s:  # PostgreSQL deletes log files of its own meanwhile
            with suppress(OSError), filler.open("ab", buffering=0) as file:
                while file.write(bytes(4096)):
                    pass
            await asyncio.sleep(0.2)
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
        try:
            async with asyncio.timeout(RECOVERED_S):
                while not all(map(has_more, self.walks, marks)):  # noqa: ASYNC110
                    await asyncio.sleep(0.02)
        except TimeoutError:
            behind = [
                f"session {walk.row['session']}: made {mark}, then {walk.made}, acknowledged "
                f"{walk.acknowledged}, seen {walk.seen[-1:]}, viewer heard {walk.viewer_heard}"
                for walk, mark in zip(self.walks, marks, strict=True)
                if not has_more(walk, mark)
            ]
            ended = [repr(task.exception()) for task in self.tasks if task.done()]
            raise AssertionError("\n".join(behind + ended)) from None

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
        only = os.environ.get("GARRY_TEST_FAULT", "")
        wanted = [name for name in self.kinds if only in name] * times
        self.random.shuffle(wanted)
        *rows, real = self.pair.seed(SESSIONS + 1)
        if "a server hangs" in wanted:
            async with RealClinic(real, self.entrance.url, self.certificate) as self.clinic:
                await self.run_each(rows, wanted)
        else:
            await self.run_each(rows, wanted)

    async def run_each(self, rows: list[Message], wanted: list[str]) -> None:
        """Let these fail while sessions walk."""
        self.walks = [Walk(row, self.entrance, RATE) for row in rows]
        senders = [asyncio.create_task(walk.send()) for walk in self.walks]
        watchers = [asyncio.create_task(walk.watch()) for walk in self.walks]
        self.tasks = senders + watchers
        async with asyncio.timeout(RECOVERED_S):
            while not all(walk.acknowledged for walk in self.walks):  # noqa: ASYNC110
                await asyncio.sleep(0.05)
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
            certificate = tmp_path / "haproxy" / "garry.pem"
            faults = Faults(broken, Entrance(secure, tls), certificate, seed)
            asyncio.run(run_all(faults, times))
            problems = find_problems(faults)
    report(faults, problems)
    assert problems == []
    assert faults.paused_by_order == 0
    assert faults.went_on_without == len(faults.recovered_s.get("a server's network", ()))
    assert faults.false_claims == []
    assert max(faults.unheard_s, default=0) <= UNHEARD_S
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
    if faults.pages_s:
        print(f"real pages after a hang: {sorted(round(one, 1) for one in faults.pages_s)} s")
        print(f"a stop there unheard: {sorted(round(one, 2) for one in faults.unheard_s)} s")
    stops = sorted(faults.stops_s)
    print(
        f"stop: n {len(stops)}, median "
        f"{1000 * statistics.median(stops):.0f} ms, "
        f"p99 {1000 * stops[int(0.99 * len(stops))]:.0f} ms, last {1000 * stops[-1]:.0f} ms"
    )
    steps = sum(walk.made for walk in faults.walks)
    print(f"paused by orderly restarts: {faults.paused_by_order}")
    print(f"steps: {steps}; problems: {len(problems)}", *problems, sep="\n")
