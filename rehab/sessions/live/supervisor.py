"""Supervises child processes that end with the server: simulated patients, recordings, robots.

A child's standard input is a pipe that stays empty. When the server ends, however it ends, the pipe
closes; children that GARRY brings along take that as their end.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import logging
import os
import sys
from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from asgiref.sync import sync_to_async

from rehab.sessions.models import TrainingSession
from rehab.stations.builtin import issue_builtin_token
from rehab.stations.models import Device

log = logging.getLogger(__name__)

FIRST_BACKOFF_S = 0.5
MAX_BACKOFF_S = 30.0
STABLE_S = 60.0  # after so long without a failure the backoff starts again
STOP_S = 5.0
CHUNK = 64 * 1024
MAX_LINE_BYTES = 1200  # stored of a line
# What a source is not given: it may read a recording from a stranger.
SECRETS = (
    "GARRY_SECRET_KEY",
    "GARRY_SECRET_KEY_FALLBACKS",
    "GARRY_DATABASE_URL",
    "GARRY_METRICS_TOKEN",
    "GARRY_OIDC_CLIENT_SECRET",
    "NOTIFY_SOCKET",
)
MAX_LINE_CHARS = 300  # of a line in the report


@dataclass
class Child:
    """One supervised process."""

    name: str
    command: Sequence[str]
    state: str = "starting"
    pid: int | None = None
    restarts: int = 0
    last_output: deque[str] = field(default_factory=lambda: deque(maxlen=20))
    task: asyncio.Task[None] | None = None

    def describe(self) -> dict[str, Any]:
        """Return the child as the report has it."""
        return {
            "name": self.name,
            "command": list(self.command),
            "state": self.state,
            "pid": self.pid,
            "restarts": self.restarts,
            "last_output": list(self.last_output)[-3:],
        }


class Supervisor:
    """Restarts child processes that fail, with backoff, and ends all with the server.

    ``report``: a file with their current state, for `manage.py doctor`.
    """

    def __init__(self, report: Path, first_backoff_s: float = FIRST_BACKOFF_S) -> None:
        self.report = report
        self.first_backoff_s = first_backoff_s
        self.children: dict[str, Child] = {}
        self._report_is_current = True
        self._report_task: asyncio.Task[None] | None = None

    def start(
        self,
        name: str,
        command: Sequence[str],
        variables: Mapping[str, str] | None = None,
        *,
        once: bool = False,
    ) -> Child:
        """Start a child process. Raises ValueError if one of that name exists.

        ``once``: forget it when it has ended without an error.
        """
        if name in self.children:
            raise ValueError(f"There is a child {name!r} already. Stop it first.")
        child = self.children[name] = Child(name, command)
        environment = os.environ | dict(variables or {})
        child.task = asyncio.get_running_loop().create_task(
            self._supervise(child, environment, once)
        )
        return child

    async def stop(self, name: str) -> None:
        """End a child: by SIGTERM, then by SIGKILL."""
        child = self.children.pop(name, None)
        if child is None:
            return
        if child.task is not None:
            child.task.cancel()  # once: then it ends the process
            await asyncio.wait([child.task])
        self._schedule_report()

    async def stop_all(self) -> None:
        """End all children; errors are logged."""
        ended = await asyncio.gather(
            *(self.stop(name) for name in list(self.children)), return_exceptions=True
        )
        for problem in ended:
            if isinstance(problem, Exception):
                log.error("A child did not end cleanly", exc_info=problem)
        if self._report_task is not None:
            await self._report_task

    async def _supervise(self, child: Child, environment: Mapping[str, str], once: bool) -> None:
        backoff_s = self.first_backoff_s
        loop = asyncio.get_running_loop()
        while True:
            began = loop.time()
            status: int | str
            try:
                status = await self._run(child, environment)
            except Exception as problem:  # an error of ours: go on supervising
                log.exception("%s could not be supervised", child.name)
                status = repr(problem)
            if status == 0:
                child.state = "done"
                if once:
                    self.children.pop(child.name, None)
                self._schedule_report()
                return
            if loop.time() - began > STABLE_S:
                backoff_s = self.first_backoff_s
            child.state = "failed"
            child.restarts += 1
            log.warning("%s ended with %s; again in %.1f s", child.name, status, backoff_s)
            self._schedule_report()
            await asyncio.sleep(backoff_s)
            backoff_s = min(2 * backoff_s, MAX_BACKOFF_S)

    async def _run(self, child: Child, environment: Mapping[str, str]) -> int:
        try:
            process = await asyncio.create_subprocess_exec(
                *child.command,
                env=environment,
                stdin=asyncio.subprocess.PIPE,
                stdout=asyncio.subprocess.PIPE,
                stderr=asyncio.subprocess.STDOUT,
            )
        except OSError as problem:
            child.last_output.append(str(problem))
            return 127
        child.state, child.pid = "running", process.pid
        self._schedule_report()
        try:
            if process.stdout is not None:
                await _read_output(process.stdout, child.last_output)
            return await process.wait()
        finally:
            child.pid = None
            if process.returncode is None:
                await _end(process)

    def _schedule_report(self) -> None:
        """Write the report in a thread; the event loop never waits for the disk."""
        self._report_is_current = False
        if self._report_task is None or self._report_task.done():
            self._report_task = asyncio.get_running_loop().create_task(self._write_report())

    async def _write_report(self) -> None:
        while not self._report_is_current:
            self._report_is_current = True
            children = [child.describe() for child in self.children.values()]
            text = json.dumps({"server": os.getpid(), "children": children})
            try:
                await asyncio.to_thread(self._replace_report, text)
            except OSError as problem:  # only `doctor` needs it
                log.warning("%s could not be written: %s", self.report, problem)

    def _replace_report(self, text: str) -> None:
        fresh = self.report.with_suffix(".new")
        fresh.write_text(text)
        fresh.replace(self.report)


async def _read_output(output: asyncio.StreamReader, words: deque[str]) -> None:
    """Read a child's output to its end and store the beginnings of its last lines."""
    line = b""
    while chunk := await output.read(CHUNK):
        *ended, line = (line + chunk).split(b"\n")
        words.extend(_decode(one) for one in ended)
        line = line[:MAX_LINE_BYTES]
    if line:
        words.append(_decode(line))


def _decode(line: bytes) -> str:
    return line.decode(errors="replace").rstrip()[:MAX_LINE_CHARS]


async def _end(process: asyncio.subprocess.Process) -> None:
    with contextlib.suppress(ProcessLookupError):
        process.terminate()
        # Not by asyncio.timeout: in a task that was cancelled Python 3.11.2 (Debian 12) loses it.
        ended = asyncio.ensure_future(process.wait())
        await asyncio.wait([ended], timeout=STOP_S)
        if not ended.done():
            process.kill()
        await ended


def local_address(host: str, port: int) -> str:
    """Return the address by which this machine reaches a server that listens at ``host``."""
    if host in {"0.0.0.0", "::"}:  # noqa: S104 (only compared)
        host = "127.0.0.1"
    return f"http://[{host}]:{port}" if ":" in host else f"http://{host}:{port}"


def source_name(session_id: int) -> str:
    """Return the name of a session's source among the child processes."""
    return f"source of session {session_id}"


async def run_source(supervisor: Supervisor, session: TrainingSession, server: str) -> None:
    """Start the source of ``session.source_args``, unless there is none or it runs already.

    ``server``: the address of this server.
    """
    name = source_name(session.pk)
    if not session.source_args or session.station is None or name in supervisor.children:
        return
    token = await sync_to_async(issue_builtin_token)(session.station, Device.Kind.SOURCE)
    command = [sys.executable, "-m", "rehab.sources", *session.source_args, "--child", "--resume"]
    place = ["--server", server, "--session", str(session.pk)]
    variables = dict.fromkeys(SECRETS, "") | {"GARRY_TOKEN": token}
    supervisor.start(name, [*command, *place], variables, once=True)
