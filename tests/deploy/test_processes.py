"""`manage.py serve --processes 2` behind HAProxy, as in deploy/: restarts, and one that hangs."""

from __future__ import annotations

import asyncio
import signal
import socket
import subprocess
import sys
from contextlib import suppress
from pathlib import Path

import psutil
import pytest

from tests.support.hosted import find_missing, run_haproxy, run_postgres
from tests.support.pair import Message, Pair
from tests.support.servers import ROOT, clean_environment, free_port
from tests.support.torture import Entrance, Walk

pytestmark = [
    pytest.mark.server,
    pytest.mark.long,
    pytest.mark.timeout(400),
    pytest.mark.skipif(bool(find_missing()), reason=f"two servers: {find_missing()}"),
]


class Served(Pair):
    """Two servers as children of one command."""

    command: subprocess.Popen[bytes]

    def begin(self, place: int) -> None:
        """Start both with the first."""
        if place == 0:
            words = ["serve", "--port", str(self.ports[0])]
            with self.log.open("w") as log:
                self.command = subprocess.Popen(
                    [sys.executable, "manage.py", *words, "--processes", "2"],
                    cwd=ROOT,
                    env=self.environment,
                    stdout=log,
                    stderr=log,
                )

    def find_process(self, place: int) -> psutil.Process:
        """Return a server's process."""
        port = str(self.ports[place])
        children = psutil.Process(self.command.pid).children()
        return next(child for child in children if child.cmdline()[-1] == port)

    async def until_said(self, words: str, times: int) -> None:
        """Wait until the servers have said something so often."""
        async with asyncio.timeout(150):
            while self.log.read_text().count(words) < times:  # noqa: ASYNC110
                await asyncio.sleep(0.1)


def two_free_ports() -> list[int]:
    for _ in range(100):
        port = free_port()
        with socket.socket() as probe, suppress(OSError, OverflowError):
            probe.bind(("127.0.0.1", port + 1))
            return [port, port + 1]
    raise AssertionError


async def story(served: Served, entrance: Entrance) -> tuple[list[Walk], list[Message]]:
    try:
        async with served:
            rows = served.seed(3)
            walks = [Walk(row, entrance, 10.0) for row in rows]
            senders = [asyncio.create_task(walk.send()) for walk in walks]
            watchers = [asyncio.create_task(walk.watch()) for walk in walks]
            async with asyncio.timeout(60):
                while not all(walk.acknowledged for walk in walks):  # noqa: ASYNC110
                    await asyncio.sleep(0.05)
            served.command.send_signal(signal.SIGHUP)
            await served.until_said("Ready", 4)
            await asyncio.sleep(2)
            for walk in walks:
                walk.stopping = True
            await asyncio.wait_for(asyncio.gather(*senders), 60)
            await asyncio.sleep(2)
            for watcher in watchers:
                watcher.cancel()
            logs = [served.read_log(row) for row in rows]
    finally:
        served.command.send_signal(signal.SIGTERM)
        status = await asyncio.to_thread(served.command.wait, 60)
    assert status == 0
    return walks, logs


def test_a_walk_goes_on_while_one_server_after_the_other_restarts(tmp_path: Path) -> None:
    (tmp_path / "garry").mkdir()
    with run_postgres() as database:
        served = Served(tmp_path / "garry", database)
        served.ports = two_free_ports()
        with run_haproxy(tmp_path / "haproxy", *served.ports) as (_, secure, tls):
            walks, logs = asyncio.run(story(served, Entrance(secure, tls)))
    for walk, log in zip(walks, logs, strict=True):
        whole = list(range(1, walk.made + 1))
        assert (log["numbers"], walk.seen, log["paused"]) == (whole, whole, 0)
        assert log["refolds"]
        assert walk.made > 15


def test_half_a_configuration_is_refused_with_the_cure(tmp_path):
    refused = subprocess.run(
        [sys.executable, "manage.py", "serve", "--processes", "2"],
        cwd=ROOT,
        env=clean_environment(tmp_path, free_port()),
        capture_output=True,
        text=True,
        check=False,
    )
    assert refused.returncode != 0
    assert "GARRY_HOSTED=1" in refused.stderr
