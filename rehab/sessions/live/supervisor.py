"""Processes that run beside the server and end with it: simulated patients, recordings, robots.

A child's standard input is a pipe that nobody writes to. When the server ends, however it ends, the
pipe closes; children that GARRY brings along take that as their end.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import logging
import os
from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

log = logging.getLogger(__name__)

FIRST_PAUSE_S = 0.5
LONGEST_PAUSE_S = 30.0
STEADY_S = 60.0  # a child that ran so long failed for a new reason: its pauses begin anew
STOP_S = 5.0
CHUNK = 64 * 1024
LONGEST_LINE = 1200  # bytes of a line that are kept until it ends
LONGEST_WORDS = 300  # characters of it


@dataclass
class Child:
    """One supervised process."""

    name: str
    command: Sequence[str]
    state: str = "starting"
    pid: int | None = None
    restarts: int = 0
    last_words: deque[str] = field(default_factory=lambda: deque(maxlen=20))
    task: asyncio.Task[None] | None = None

    def describe(self) -> dict[str, Any]:
        """Give what an operator wants to know."""
        return {
            "name": self.name,
            "command": list(self.command),
            "state": self.state,
            "pid": self.pid,
            "restarts": self.restarts,
            "last_words": list(self.last_words)[-3:],
        }


class Children:
    """Starts children again when they fail, and leaves none behind.

    ``report`` is a file that always says how they are, for `manage.py doctor`.
    """

    def __init__(self, report: Path, first_pause_s: float = FIRST_PAUSE_S) -> None:
        self.report = report
        self.first_pause_s = first_pause_s
        self.all: dict[str, Child] = {}
        self._is_told = True
        self._telling: asyncio.Task[None] | None = None

    def start(
        self,
        name: str,
        command: Sequence[str],
        variables: Mapping[str, str] | None = None,
        *,
        once: bool = False,
    ) -> Child:
        """Start a child; one of the same name must have been stopped before.

        ``once`` forgets it as soon as it has done its work.
        """
        if name in self.all:
            raise ValueError(f"There is a child {name!r} already. Stop it first.")
        child = self.all[name] = Child(name, command)
        environment = os.environ | dict(variables or {})
        child.task = asyncio.get_running_loop().create_task(self._keep_up(child, environment, once))
        return child

    async def stop(self, name: str) -> None:
        """End a child: politely, then for certain."""
        child = self.all.pop(name, None)
        if child is None:
            return
        if child.task is not None:
            child.task.cancel()
            await asyncio.wait([child.task])
        self._tell()

    async def stop_all(self) -> None:
        """End all children. Trouble with one keeps no other, nor the server, from ending."""
        ended = await asyncio.gather(
            *(self.stop(name) for name in list(self.all)), return_exceptions=True
        )
        for problem in ended:
            if isinstance(problem, Exception):
                log.error("A child did not end cleanly", exc_info=problem)
        if self._telling is not None:
            await self._telling

    async def _keep_up(self, child: Child, environment: Mapping[str, str], once: bool) -> None:
        pause_s = self.first_pause_s
        loop = asyncio.get_running_loop()
        while True:
            began = loop.time()
            status: int | str
            try:
                status = await self._run(child, environment)
            except Exception as problem:  # of ours: it is supervised all the same
                log.exception("%s could not be looked after", child.name)
                status = repr(problem)
            if status == 0:
                child.state = "done"
                if once:
                    self.all.pop(child.name, None)
                self._tell()
                return
            if loop.time() - began > STEADY_S:
                pause_s = self.first_pause_s
            child.state = "failed"
            child.restarts += 1
            log.warning("%s ended with %s; again in %.1f s", child.name, status, pause_s)
            self._tell()
            await asyncio.sleep(pause_s)
            pause_s = min(2 * pause_s, LONGEST_PAUSE_S)

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
            child.last_words.append(str(problem))
            return 127
        child.state, child.pid = "running", process.pid
        self._tell()
        try:
            if process.stdout is not None:
                await _listen(process.stdout, child.last_words)
            return await process.wait()
        finally:
            child.pid = None
            if process.returncode is None:
                await _end(process)

    def _tell(self) -> None:
        """Have the report written; the event loop waits for no disk."""
        self._is_told = False
        if self._telling is None or self._telling.done():
            self._telling = asyncio.get_running_loop().create_task(self._write_report())

    async def _write_report(self) -> None:
        while not self._is_told:
            self._is_told = True
            children = [child.describe() for child in self.all.values()]
            text = json.dumps({"server": os.getpid(), "children": children})
            try:
                await asyncio.to_thread(self._replace_report, text)
            except OSError as problem:  # they live on; only `doctor` knows less
                log.warning("%s could not be written: %s", self.report, problem)

    def _replace_report(self, text: str) -> None:
        fresh = self.report.with_suffix(".new")
        fresh.write_text(text)
        fresh.replace(self.report)


async def _listen(output: asyncio.StreamReader, words: deque[str]) -> None:
    """Keep the last lines of what a child says until it says no more, however long they are."""
    line = b""
    while chunk := await output.read(CHUNK):
        *ended, line = (line + chunk).split(b"\n")
        words.extend(_decode(one) for one in ended)
        line = line[:LONGEST_LINE]
    if line:
        words.append(_decode(line))


def _decode(line: bytes) -> str:
    return line.decode(errors="replace").rstrip()[:LONGEST_WORDS]


async def _end(process: asyncio.subprocess.Process) -> None:
    with contextlib.suppress(ProcessLookupError):
        process.terminate()
        try:
            await asyncio.wait_for(process.wait(), STOP_S)
        except TimeoutError:
            process.kill()
            await process.wait()
