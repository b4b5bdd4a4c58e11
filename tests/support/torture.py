"""Sources and viewers that outlive a server which is killed again and again.

Each source keeps what is not acknowledged and resends it; each viewer connects again with the last
step it has. At the end the log must hold every acknowledged step, once, and every viewer must have
seen every step, once.
"""

from __future__ import annotations

import asyncio
import json
import random
import signal
import ssl
import sys
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import ConnectionClosed, InvalidHandshake

from tests.support.servers import ROOT, clean_environment, free_port, run_python

GONE = (ConnectionClosed, InvalidHandshake, OSError, EOFError, TimeoutError)

STUCK_S = 60.0  # without any progress something hangs; a busy machine is only slow
RETRY_S = 0.25  # less would be a flood, which the proxy refuses
PASSING = {"elsewhere", "not_stored", "server_error"}  # errors after which one dials in again


class Elsewhere(Exception):
    """Another server has the clinic: its address."""


@dataclass(frozen=True)
class Entrance:
    """Where clients find the server: its own port, or a proxy with TLS before it."""

    url: str  # http:// or https://
    tls: ssl.SSLContext | None = None

    def dial(self, path: str, **headers: str) -> connect:
        """Return a connection to a socket, to be awaited or entered."""
        return connect(
            f"ws{self.url.removeprefix('http')}{path}",
            ssl=self.tls,
            additional_headers=headers,
            open_timeout=5,
            max_queue=None,
            proxy=None,
        )


@dataclass
class Walk:
    """One session's source and viewer, and what each of them knows."""

    row: dict[str, Any]
    entrance: Entrance
    rate: float
    made: int = 0
    unacknowledged: dict[int, str] = field(default_factory=dict)
    acknowledged: int = 0
    seen: list[int] = field(default_factory=list)
    stopping: bool = False
    server: str = ""  # of several: the one that has the clinic, as another one said
    viewer_heard: str = ""  # what its viewer heard last, or why it had to dial again

    @property
    def has_seen_all(self) -> bool:
        """Whether the viewer has seen all that the source has made."""
        return bool(self.seen) and self.seen[-1] >= self.made

    def dial(self, path: str, token: str) -> connect:
        chosen = {"GARRY-Server": self.server} if self.server else {}
        return self.entrance.dial(path, Authorization=f"Bearer {token}", **chosen)

    async def send(self) -> None:
        """Walk, and never lose a step that was not acknowledged."""
        while not (self.stopping and not self.unacknowledged):
            try:
                async with self.dial("/ws/source/", self.row["source"]) as socket:
                    await self._send_over(socket)
            except Elsewhere as told:
                self.server = str(told)
                await asyncio.sleep(0.2)
            except GONE:
                self.server = ""
                await asyncio.sleep(RETRY_S)

    async def _send_over(self, socket: ClientConnection) -> None:
        hello = {"type": "hello", "version": 1, "run": "torture", "last": self.made}
        await socket.send(json.dumps(hello))
        welcome = json.loads(await socket.recv())
        if welcome.get("code") in PASSING:
            raise Elsewhere(welcome.get("server", ""))
        assert welcome["type"] == "welcome", welcome
        self._acknowledge(welcome["next"] - 1)
        for text in list(self.unacknowledged.values()):
            await socket.send(text)
        hearing = asyncio.create_task(self._hear(socket))
        try:
            while not (self.stopping and not self.unacknowledged):
                if hearing.done():
                    await hearing
                    return
                if not self.stopping and len(self.unacknowledged) < 200:
                    await socket.send(self._next_step())
                await asyncio.sleep(1 / self.rate)
        finally:
            hearing.cancel()

    def _next_step(self) -> str:
        self.made += 1
        step = {
            "type": "step",
            "number": self.made,
            "time_s": round(self.made * 1.1, 3),
            "side": "left",
            "value": 2.0 + (self.made * 7919 % 200) / 100,
        }
        self.unacknowledged[self.made] = json.dumps(step)
        return self.unacknowledged[self.made]

    async def _hear(self, socket: ClientConnection) -> None:
        async for text in socket:
            message = json.loads(text)
            assert message["type"] != "error" or message["code"] in PASSING, message
            if message["type"] == "ack":
                self._acknowledge(message["number"])

    def _acknowledge(self, number: int) -> None:
        for one in range(self.acknowledged + 1, number + 1):
            self.unacknowledged.pop(one, None)
        self.acknowledged = max(self.acknowledged, number)

    async def watch(self) -> None:
        """See every step, across all deaths of the server."""
        path = f"/ws/session/{self.row['session']}/patient/"
        while True:
            after = self.seen[-1] if self.seen else 0
            try:
                async with self.dial(f"{path}?after={after}", self.row["tablet"]) as socket:
                    async for text in socket:
                        self.viewer_heard = str(text)[:200]
                        message = json.loads(text)
                        self.server = message.get("server", self.server)
                        for step in message.get("steps", []) if "frame" in message else []:
                            self.seen.append(step["number"])
                        for event in message.get("events", []):
                            if event["kind"] in ("step", "missing"):
                                self.seen.append(event["number"])
                        if "frame" in message:
                            await socket.send(
                                json.dumps({"type": "seen", "frame": message["frame"]})
                            )
            except GONE as problem:
                self.viewer_heard = repr(problem)
                await asyncio.sleep(0.05)


class Torture:
    """A server that dies, and those who must not notice."""

    def __init__(
        self,
        folder: Path,
        seed: int,
        rate: float = 40.0,
        database: str = "",
        serve: Sequence[str] = (),
    ) -> None:
        self.folder = folder
        self.random = random.Random(seed)
        self.port = free_port()
        self.entrance = Entrance(f"http://127.0.0.1:{self.port}")
        self.serve = serve
        self.rate = rate
        self.walks: list[Walk] = []
        self.resumed = 0  # sessions, by their PTs
        self._server: asyncio.subprocess.Process | None = None
        self.environment = clean_environment(folder, self.port) | {
            "DJANGO_SETTINGS_MODULE": "garry_site.settings"
        }
        if database:
            self.environment["GARRY_DATABASE_URL"] = database

    def run_python(self, *arguments: str) -> str:
        """Run Python beside the server, on its database."""
        return run_python(self.folder, *arguments, **self.environment)

    async def start_server(self) -> asyncio.subprocess.Process:
        process = await asyncio.create_subprocess_exec(
            sys.executable,
            "manage.py",
            "serve",
            *self.serve,
            cwd=ROOT,
            env=self.environment,
            stdout=asyncio.subprocess.PIPE,
            stderr=asyncio.subprocess.DEVNULL,
        )
        self._server = process
        assert process.stdout is not None
        async for line in process.stdout:
            if line.startswith(b"Ready"):
                break
        return process

    async def resume(self, walk: Walk) -> None:
        """Do what the PT does: a session comes back paused, and a person lets it go on.

        The page dials until a proxy lets it through, as pages do.
        """
        while not await self._resume(walk):  # noqa: ASYNC110
            await asyncio.sleep(RETRY_S)
        self.resumed += 1

    async def _resume(self, walk: Walk) -> bool:
        cookie = f"sessionid={walk.row['cookie']}"
        path = f"/ws/session/{walk.row['session']}/monitor/"
        try:
            async with self.entrance.dial(path, Cookie=cookie, Origin=self.entrance.url) as socket:
                await socket.send('{"type":"change","kind":"resume","id":"r"}')
                async for text in socket:
                    answer = json.loads(text)
                    if answer.get("id") == "r":
                        assert answer["type"] == "done", answer
                        return True
        except GONE:  # not let through, or sent on
            pass
        return False

    async def run(self, sessions: int, rounds: int, orderly: float = 0.0) -> dict[str, Any]:
        """End the server so many times; return what the log and the viewers ended with.

        ``orderly``: the share of ends by SIGTERM, after which sessions go on as they were; after a
        kill they come back paused.
        """
        try:
            return await self._run(sessions, rounds, orderly)
        finally:
            if self._server is not None and self._server.returncode is None:
                self._server.kill()

    async def _run(self, sessions: int, rounds: int, orderly: float) -> dict[str, Any]:
        server = await self.start_server()
        rows = json.loads(self.run_python("-m", "tests.support.live_seed", str(sessions)))
        self.walks = [Walk(row, self.entrance, self.rate) for row in rows]
        senders = [asyncio.create_task(walk.send()) for walk in self.walks]
        watchers = [asyncio.create_task(walk.watch()) for walk in self.walks]
        await self._until(lambda: all(walk.acknowledged for walk in self.walks))
        kills, statuses = 0, []
        for _ in range(rounds):
            await asyncio.sleep(self.random.uniform(0.2, 1.5))
            is_orderly = self.random.random() < orderly
            server.send_signal(signal.SIGTERM if is_orderly else signal.SIGKILL)
            status = await server.wait()  # which ends itself in time (process.end_in_time)
            server = await self.start_server()
            if is_orderly:
                statuses.append(status)
            else:
                kills += 1
                resuming = asyncio.gather(*(self.resume(walk) for walk in self.walks))
                await self._until(resuming.done)
                await resuming
        await asyncio.sleep(1.0)
        for walk in self.walks:
            walk.stopping = True
        sending = asyncio.gather(*senders)
        await self._until(sending.done)
        await sending
        with suppress(TimeoutError):  # what they have not seen is told as a fault
            await self._until(lambda: all(walk.has_seen_all for walk in self.walks))
        for watcher in watchers:
            watcher.cancel()
        server.send_signal(signal.SIGTERM)
        statuses.append(await server.wait())
        ids = ",".join(str(row["session"]) for row in rows)
        log = json.loads(self.run_python("-m", "tests.support.live_log", ids))
        return {"statuses": statuses, "kills": kills, "log": log}

    async def _until(self, is_done: Callable[[], bool]) -> None:
        """Wait until it is done. Raises TimeoutError where nothing happens any more."""
        before, since_s = -1, 0.0
        while not is_done():
            happened = self.resumed + sum(one.acknowledged + len(one.seen) for one in self.walks)
            now_s = asyncio.get_running_loop().time()
            if happened != before:
                before, since_s = happened, now_s
            if now_s - since_s > STUCK_S:
                raise TimeoutError(f"nothing has happened for {STUCK_S:g} s")
            await asyncio.sleep(0.05)

    def find_faults(self, ended: dict[str, Any]) -> list[str]:
        """Return everything that must not have happened."""
        faults = [f"a server ended with {status}" for status in ended["statuses"] if status]
        for walk in self.walks:
            name = f"session {walk.row['session']}"
            log = ended["log"][str(walk.row["session"])]
            if log["numbers"] != list(range(1, walk.made + 1)):
                faults.append(f"{name}: log has {len(log['numbers'])} of {walk.made} steps")
            if walk.acknowledged > len(log["numbers"]):
                faults.append(f"{name}: an acknowledged step is lost")
            if walk.seen != sorted(set(walk.seen)):
                faults.append(f"{name}: a viewer saw a step twice or out of order")
            if set(walk.seen) != set(range(1, walk.made + 1)):
                faults.append(f"{name}: a viewer missed {walk.made - len(set(walk.seen))} steps")
            if log["paused"] != ended["kills"]:
                faults.append(f"{name}: paused {log['paused']} times in {ended['kills']} kills")
            if not log["refolds"]:
                faults.append(f"{name}: a fresh fold differs from the log")
        return faults
