"""Raw signals on their way into a real server: sent in time, with when each step was stored."""

from __future__ import annotations

import asyncio
import contextlib
import json
import os
import sys
import time
from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from pathlib import Path

from tests.support.servers import ROOT
from tests.support.synthetic_recordings import SyntheticRecording

NAMES = [
    f"{side}_{name}" for side in ("left", "right") for name in ("force_n", "moment_nm", "angle_rad")
]
Send = Callable[[list[list[float]]], Awaitable[None] | None]


@dataclass
class Source:
    """A running `python -m rehab.sources`."""

    process: asyncio.subprocess.Process
    log: Path
    said: list[str]

    def acks(self) -> list[dict[str, float]]:
        """Return its acknowledgments: session, number and time [s since 1970]."""
        if not self.log.exists():
            return []
        return [json.loads(line) for line in self.log.read_text("utf-8").splitlines()]

    async def wait_for(self, words: str, seconds: float = 30) -> str:
        """Return the line in which it says this."""
        async with asyncio.timeout(seconds):
            while True:
                for line in self.said:
                    if words in line:
                        return line
                await asyncio.sleep(0.02)


@contextlib.asynccontextmanager
async def run_source(*arguments: str, token: str, server: str, folder: Path):
    """Run a source as it is typed, until the block ends."""
    log = folder / "acks.jsonl"
    process = await asyncio.create_subprocess_exec(
        *(sys.executable, "-m", "rehab.sources", *arguments),
        *("--server", server, "--log", str(log)),
        cwd=ROOT,
        env=os.environ | {"GARRY_TOKEN": token},
        stderr=asyncio.subprocess.PIPE,
    )
    source = Source(process, log, [])

    async def listen() -> None:
        async for line in process.stderr:
            source.said.append(line.decode().rstrip())

    listening = asyncio.create_task(listen())
    try:
        yield source
    finally:
        with contextlib.suppress(ProcessLookupError):
            process.terminate()
        await process.wait()
        await listening


async def send_in_time(made: SyntheticRecording, send: Send, chunk: int) -> float:
    """Send samples when their times come; return when their clock was 0 [s since 1970].

    ``send`` gets rows of time and the channels in ``NAMES``.
    """
    legs = (made.left, made.right)
    channels = [c for leg in legs for c in (leg.force_n, leg.moment_nm, leg.angle_rad)]
    began = time.time() - float(made.t_s[0])
    for start in range(0, len(made.t_s), chunk):
        stop = min(start + chunk, len(made.t_s))
        await asyncio.sleep(max(0.0, began + float(made.t_s[stop - 1]) - time.time()))
        rows = zip(made.t_s[start:stop], *(c[start:stop] for c in channels), strict=True)
        sending = send([[float(cell) for cell in row] for row in rows])
        if sending is not None:
            await sending
    return began
