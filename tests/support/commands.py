"""Commands that run as processes, as a shell runs them."""

from __future__ import annotations

import asyncio
import signal


def hear_sigint() -> None:
    """Undo what a shell does to a command in the background."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


async def finish(process: asyncio.subprocess.Process) -> tuple[int | None, str]:
    """Wait for the end of a process; return its status and what it said."""
    async with asyncio.timeout(20):
        _, text = await process.communicate()
    return process.returncode, text.decode()
