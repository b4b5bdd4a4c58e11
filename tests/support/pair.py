"""Two real servers on one PostgreSQL, and those who dial in to either."""

from __future__ import annotations

import asyncio
import json
import signal
import subprocess
import sys
import time
import urllib.error
import urllib.request
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any, Self

import psycopg
from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import ConnectionClosed

from rehab.sessions.live.database.server_lease import Server, find_place
from tests.support.servers import ROOT, clean_environment, free_port, run_python

Message = dict[str, Any]
WITHIN_S = 10.0
HOST = "a-host"  # of both: names of hosts mean nothing


class Dialed:
    """A connection, with all that it heard."""

    def __init__(self, socket: ClientConnection) -> None:
        self.socket = socket
        self.heard: list[Message] = []
        self.times: list[float] = []
        self.code: int | None = None
        self._news = asyncio.Event()
        self._reading = asyncio.create_task(self._read())

    async def _read(self) -> None:
        try:
            async for text in self.socket:
                message = json.loads(text)
                for one in (message, *message.get("events", [])):
                    self.heard.append(one)
                    self.times.append(time.monotonic())
                self._news.set()
                if "frame" in message:
                    await self.say({"type": "seen", "frame": message["frame"]})
        except ConnectionClosed:
            pass
        self.code = self.socket.close_code
        self._news.set()

    def forget(self) -> None:
        """Forget what was heard."""
        self.heard.clear()
        self.times.clear()

    async def say(self, message: Message) -> float:
        """Send a message; return when."""
        with suppress(ConnectionClosed):
            await self.socket.send(json.dumps(message))
        return time.monotonic()

    async def until(
        self, is_wanted: Callable[[Message], bool], within_s: float = WITHIN_S
    ) -> Message:
        """Return the first message that is wanted; fail where none comes."""
        return self.heard[await self.find(is_wanted, within_s)]

    async def find(self, is_wanted: Callable[[Message], bool], within_s: float = WITHIN_S) -> int:
        """Return the place of the first message that is wanted."""
        seen = 0
        with suppress(TimeoutError):
            async with asyncio.timeout(within_s):
                while True:
                    while seen < len(self.heard):
                        if is_wanted(self.heard[seen]):
                            return seen
                        seen += 1
                    assert self.code is None, (self.code, self.heard[-3:])
                    self._news.clear()
                    await self._news.wait()
        raise AssertionError(f"not heard within {within_s} s; the last: {self.heard[-5:]}")

    async def until_closed(self, within_s: float = WITHIN_S) -> int | None:
        """Return the close code."""
        async with asyncio.timeout(within_s):
            await self._reading
        return self.code

    def numbers(self) -> list[int]:
        """Return the numbers of the steps that were told, in their order."""
        kinds = ("step", "missing", "calm")
        told = [one["number"] for one in self.heard if one.get("kind") in kinds]
        frames = [one for one in self.heard if one.get("type") == "steps"]
        missed = [step["number"] for one in frames for step in one["steps"]]
        return [*missed, *told] if missed else told

    async def hang_up(self) -> None:
        """Close it."""
        await self.socket.close()
        self._reading.cancel()


class Pair:
    """Servers 0 and 1, and their database's rows."""

    def __init__(self, folder: Path, database: str, count: int = 2) -> None:
        self.ports = [free_port() for _ in range(count)]
        self.folder, self.log = folder, folder / "log"
        self.environment = clean_environment(folder, self.ports[0]) | {
            "DJANGO_SETTINGS_MODULE": "garry_site.settings",
            "GARRY_HOSTED": "1",
            "GARRY_SECRET_KEY": "0123456789" * 6,
            "GARRY_ALLOWED_HOSTS": "localhost,127.0.0.1",
            "GARRY_METRICS_TOKEN": "a token",
            "GARRY_SESSION_MINUTES": "720",  # a clock that jumps by an hour signs nobody out
            "GARRY_DATABASE_URL": database,
        }
        self.own_environments: list[dict[str, str]] = [{} for _ in range(count)]
        self.programs: list[tuple[str, ...]] = [("manage.py",)] * count
        self.processes: list[subprocess.Popen[bytes] | None] = [None] * count
        self._open: list[Dialed] = []
        self.redirected = ""  # where the last answer sent us

    async def __aenter__(self) -> Self:
        """Make the tables and start both servers."""
        await asyncio.to_thread(self.begin_all)
        return self

    def begin_all(self) -> None:
        """Make the tables, start both servers, and wait until both are ready."""
        self.run_python("manage.py", "migrate", "--verbosity", "0")
        self.run_python("manage.py", "collectstatic", "--no-input", "--verbosity", "0")
        for place in range(len(self.ports)):
            self.begin(place)
        until_s = time.monotonic() + 60
        for place in range(len(self.ports)):
            while self._request(place, "/readyz")[0] != 200:
                assert time.monotonic() < until_s, self.log.read_text()
                time.sleep(0.1)

    async def hang_up_all(self) -> None:
        """Close all connections that were dialed."""
        dialed, self._open = self._open, []
        await asyncio.gather(*(one.hang_up() for one in dialed))

    async def __aexit__(self, *_: object) -> None:
        """Stop both."""
        await self.hang_up_all()
        self.kill_all()

    def kill_all(self) -> None:
        """Kill both, also one that hangs."""
        for process in self.processes:
            if process is not None and process.poll() is None:
                process.send_signal(signal.SIGCONT)
                process.kill()
                process.wait(10)

    def run_python(self, *arguments: str) -> str:
        """Run Python on the database."""
        return run_python(self.folder, *arguments, **self.environment)

    def begin(self, place: int) -> None:
        """Start a server."""
        port = str(self.ports[place])
        command = [*self.programs[place], "serve", "--port", port]
        environment = self.environment | self.own_environments[place]
        with self.log.open("a") as log:
            self.processes[place] = subprocess.Popen(
                [sys.executable, *command], cwd=ROOT, env=environment, stdout=log, stderr=log
            )

    async def until_ready(self, place: int, within_s: float = 60) -> None:
        """Wait until a server says that it is ready."""
        async with asyncio.timeout(within_s):
            while (await self.get(place, "/readyz"))[0] != 200:  # noqa: ASYNC110
                await asyncio.sleep(0.1)

    async def end(self, place: int, how: signal.Signals = signal.SIGKILL) -> int:
        """End a server; return its status."""
        process = self.processes[place]
        assert process is not None
        process.send_signal(how)
        return await asyncio.to_thread(process.wait, 40)

    async def get(self, place: int, path: str, **more: Any) -> tuple[int, str]:
        """Return what a server answers."""
        return await asyncio.to_thread(self._request, place, path, **more)

    def _request(
        self, place: int, path: str, body: Message | None = None, token: str = ""
    ) -> tuple[int, str]:
        headers = {"X-Forwarded-Proto": "https", "Content-Type": "application/json"}
        if token:
            headers["Authorization"] = f"Bearer {token}"
        request = urllib.request.Request(
            f"http://127.0.0.1:{self.ports[place]}{path}",
            headers=headers,
            data=None if body is None else json.dumps(body).encode(),
        )
        try:
            with urllib.request.urlopen(request, timeout=20) as answer:  # noqa: S310 (our own)
                return answer.status, answer.read().decode()
        except urllib.error.HTTPError as answer:
            self.redirected = answer.headers.get("Location", "")
            return answer.code, answer.read().decode()
        except OSError:
            return 0, ""

    def seed(self, count: int, *how: str) -> list[Message]:
        """Make sessions, each in a clinic of its own."""
        arguments = ("-m", "tests.support.live_seed", str(count), "apart", *how)
        rows: list[Message] = json.loads(self.run_python(*arguments))
        return rows

    def place_of(self, row: Message) -> int:
        """Return the server that a session's clinic belongs to while nobody has it."""
        servers = [Server("", f"127.0.0.1:{port}", True) for port in self.ports]
        place = find_place(row["clinic"], servers)
        assert place is not None
        return servers.index(place)

    def find_busiest(self, clinic_id: int | None = None) -> int:
        """Return the server that has most clinics, or one of them."""
        with psycopg.connect(self.environment["GARRY_DATABASE_URL"]) as connection:
            found = connection.execute(
                "SELECT address FROM rehab_server JOIN rehab_clinicowner "
                "ON owner = rehab_server.id WHERE %(one)s::int IS NULL OR clinic_id = %(one)s "
                "GROUP BY address ORDER BY count(*) DESC",
                {"one": clinic_id},
            ).fetchone()
        assert found is not None
        return self.ports.index(int(found[0].rpartition(":")[2]))

    async def dial(self, place: int, path: str, **headers: str) -> Dialed:
        """Dial in to a server."""
        url = f"ws://127.0.0.1:{self.ports[place]}{path}"
        socket = await connect(
            url, additional_headers=headers, open_timeout=10, proxy=None, max_queue=None
        )
        dialed = Dialed(socket)
        self._open.append(dialed)
        return dialed

    async def source(self, place: int, row: Message, last: int = 0) -> Dialed:
        """Dial in as a session's source, and say hello."""
        source = await self.dial(place, "/ws/source/", Authorization=f"Bearer {row['source']}")
        await source.say({"type": "hello", "version": 1, "run": "r", "last": last})
        return source

    async def robot(self, place: int, row: Message) -> Dialed:
        """Dial in as a session's robot, and say hello."""
        robot = await self.dial(place, "/ws/robot/", Authorization=f"Bearer {row['robot']}")
        await robot.say({"type": "hello", "version": 1, "base": "simulated"})
        return robot

    async def tablet(self, place: int, row: Message, after: int | None = None) -> Dialed:
        """Dial in as a session's tablet."""
        query = "" if after is None else f"?after={after}"
        path = f"/ws/session/{row['session']}/patient/{query}"
        return await self.dial(place, path, Authorization=f"Bearer {row['tablet']}")

    async def monitor(self, place: int, row: Message) -> Dialed:
        """Open the PT's page of a session."""
        path = f"/ws/session/{row['session']}/monitor/"
        origin = f"http://127.0.0.1:{self.ports[place]}"
        return await self.dial(place, path, Cookie=f"sessionid={row['cookie']}", Origin=origin)

    def read_log(self, row: Message) -> Message:
        """Return what a session's log holds."""
        key = str(row["session"])
        log: Message = json.loads(self.run_python("-m", "tests.support.live_log", key))[key]
        return log


def step(number: int, value: float = 4.0) -> Message:
    """Return a step as a source sends it."""
    return {
        "type": "step",
        "number": number,
        "time_s": round(1.1 * number, 3),
        "side": "left",
        "value": value,
    }


def of_type(kind: str, **fields: Any) -> Callable[[Message], bool]:
    """Return whether a message has a type and these fields."""
    return lambda one: one.get("type") == kind and fields.items() <= one.items()


def of_kind(kind: str, **fields: Any) -> Callable[[Message], bool]:
    """Return whether an event has a kind and these fields."""
    return lambda one: one.get("kind") == kind and fields.items() <= one.items()
