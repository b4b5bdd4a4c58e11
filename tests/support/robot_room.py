"""A clinic's room for tests: a real server, a PT's page, a source, and a robot worker at a Kobuki.

The Kobuki is one of bytes at a pty, which notes every setpoint with its time.
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Any, NamedTuple

from websockets.exceptions import ConnectionClosed
from websockets.sync.client import ClientConnection, connect
from websockets.typing import Origin

from tests.support.fake_kobuki import FakeKobuki
from tests.support.servers import ROOT, Server, clean_environment, serve
from tests.support.wire import Wire


class Late(NamedTuple):
    """How late its Kobuki answers: dead time and lag [s]."""

    dead_s: float = 0.0
    lag_s: float = 0.0


PROMPT = Late()


class Page:
    """A PT's page on a thread: confirms what it gets, keeps the robot's reports."""

    def __init__(self, socket: ClientConnection) -> None:
        self._socket = socket
        self.reports: list[dict[str, Any]] = []
        self._thread = threading.Thread(target=self._listen, daemon=True)
        self._thread.start()

    def order(self, order: str) -> None:
        self._socket.send(json.dumps({"type": "robot", "order": order}))

    @property
    def status(self) -> dict[str, Any]:
        """The robot's latest."""
        statuses = [report for report in self.reports if report["kind"] == "status"]
        return statuses[-1] if statuses else {}

    def _listen(self) -> None:
        with suppress(ConnectionClosed):
            for text in self._socket:
                message = json.loads(text)
                events = message.get("events", [])
                self.reports += [event["report"] for event in events if event["kind"] == "robot"]
                if "frame" in message:
                    self._socket.send(json.dumps({"type": "seen", "frame": message["frame"]}))


class Room:
    """All of it. ``wire`` lies between worker and server."""

    def __init__(
        self, server: Server, row: dict[str, Any], wire: Wire, close: ExitStack, late: Late
    ) -> None:
        self.server, self.row, self.wire = server, row, wire
        self.kobuki = close.enter_context(FakeKobuki(dead_s=late.dead_s, lag_s=late.lag_s))
        self.rolled_s = 0.0  # after the last deed, by its wheels
        self.worker = self.start_worker()
        address = f"ws://127.0.0.1:{server.port}/ws"
        url, header = f"{address}/session/{row['session']}/monitor/", f"sessionid={row['cookie']}"
        page = connect(url, additional_headers={"Cookie": header}, origin=Origin(server.url))
        self.page = Page(close.enter_context(page))
        token = {"Authorization": f"Bearer {row['source']}"}
        source = connect(f"{address}/source/", additional_headers=token)
        self.source = close.enter_context(source)
        hello = {"type": "hello", "version": 1, "run": "r", "last": 0, "speed": None}
        self.source.send(json.dumps(hello))
        self.number = json.loads(self.source.recv())["next"] - 1
        self._source_s = 0.0

    def start_worker(self, port: str = "") -> subprocess.Popen[str]:
        command = [sys.executable, "-W", "error", "-m", "robot", "--base", "kobuki"]
        command += ["--port", port or self.kobuki.url]
        return subprocess.Popen(
            [*command, "--server", f"http://127.0.0.1:{self.wire.port}"],
            cwd=ROOT,
            env=os.environ | {"GARRY_ROBOT_TOKEN": self.row["robot"]},
            stderr=subprocess.PIPE,
            text=True,
        )

    def until(self, holds: Callable[[], Any], within_s: float = 15.0) -> None:
        """Wait until something holds."""
        end_s = time.monotonic() + within_s
        while not holds():
            assert time.monotonic() < end_s, self.page.reports[-5:]
            time.sleep(0.005)

    def arm(self) -> None:
        """Let a person arm it, until it says that it is; the PT may have to wait a second."""
        end_s = time.monotonic() + 15
        while self.page.status.get("state") != "idle" or self.page.status.get("reason"):
            assert time.monotonic() < end_s, self.page.reports[-5:]
            self.page.order("arm")
            self.page.reports.clear()
            with suppress(AssertionError):
                self.until(lambda: self.page.status, 1.2)

    def walk(self) -> None:
        """Walk a window of strong steps, and the step that ends it."""
        self._source_s += 20.0  # the robot has rested
        steps = []
        for second in range(7):
            self.number += 1
            step = {"number": self.number, "time_s": self._source_s + second, "side": "left"}
            steps.append(step | {"value": 3.5})
        self.source.send(json.dumps({"type": "steps", "steps": steps}))
        while json.loads(self.source.recv(10)).get("number", 0) < self.number:
            pass

    def perform(self, further_s: float = 0.3) -> None:
        """Arm it and walk until it moves; then some way into the gesture."""
        self.page.order("arm")  # where it stands is home
        time.sleep(0.1)
        self.arm()
        self.walk()
        self.until(lambda: self.kobuki.is_moving)
        time.sleep(further_s)
        self.until(lambda: self.kobuki.is_moving)  # it may just turn around

    def still_after(self, deed: Callable[[], object], wait_s: float = 1.0) -> float:
        """Do something; give how long the setpoint was still other than zero [s]."""
        began_s = time.monotonic()
        deed()
        time.sleep(wait_s + self.kobuki.dead_s + 6 * self.kobuki.lag_s)
        self.rolled_s = self.kobuki.rolled_after(began_s)
        return self.kobuki.moved_after(began_s)

    def signal_server(self, what: signal.Signals) -> None:
        self.server.process.send_signal(what)

    def end_worker(self) -> str:
        """End the worker; return what it said."""
        self.worker.send_signal(signal.SIGCONT)
        self.worker.terminate()
        _, said = self.worker.communicate(timeout=10)
        return said

    def close(self) -> None:
        self.server.process.send_signal(signal.SIGCONT)
        self.wire.thaw()
        said = self.end_worker() if self.worker.poll() is None else ""
        if self.worker.stderr is not None:
            self.worker.stderr.close()
        assert "Traceback" not in said, said


@contextmanager
def robot_room(folder: Path, late: Late = PROMPT) -> Iterator[Room]:
    """Set it all up, and clear it away."""
    with serve(folder) as server, Wire(server.port) as wire, ExitStack() as close:
        environment = clean_environment(folder, server.port)
        made = subprocess.run(
            [sys.executable, "-m", "tests.support.live_seed", "1"],
            cwd=ROOT,
            env=environment | {"DJANGO_SETTINGS_MODULE": "garry_site.settings"},
            capture_output=True,
            text=True,
            check=True,
        )
        room = Room(server, json.loads(made.stdout)[0], wire, close, late)
        try:
            yield room
        finally:
            room.close()
