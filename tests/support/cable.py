"""A network cable on loopback that can be cut: ``python -m tests.support.cable LISTEN TARGET``.

Cut (SIGSTOP), it is as silent as a real one: what is sent gets no answer, and nobody hears that a
connection ended. Whole again (SIGCONT), what was under way arrives late.
"""

from __future__ import annotations

import asyncio
import contextlib
import re
import signal
import subprocess
import sys
from asyncio import StreamReader, StreamWriter
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager

from tests.support.hosted import wait_for_port
from tests.support.servers import ROOT, free_port


class Cable:
    """The cable's process, seen from the test."""

    def __init__(self, port: int, process: subprocess.Popen[bytes]) -> None:
        self.port = port
        self._process = process

    def cut(self) -> None:
        self._process.send_signal(signal.SIGSTOP)

    def mend(self) -> None:
        self._process.send_signal(signal.SIGCONT)


@contextmanager
def run_cable(target: int) -> Iterator[Cable]:
    """Run a cable to a port until the block ends."""
    port = free_port()
    command = [sys.executable, "-m", "tests.support.cable", str(port), str(target)]
    process = subprocess.Popen(command, cwd=ROOT)
    try:
        wait_for_port(port)
        yield Cable(port, process)
    finally:
        process.kill()
        process.wait(10)


@contextmanager
def run_cables(urls: dict[str, str]) -> Iterator[tuple[dict[str, str], list[Cable]]]:
    """Run a cable to each service; yield the addresses behind them, by the same names."""
    with ExitStack() as stack:
        behind, cables = {}, []
        for name, url in urls.items():
            port = int(re.search(r"127.0.0.1:(\d+)/", url)[1])
            cables.append(stack.enter_context(run_cable(port)))
            behind[name] = url.replace(f":{port}/", f":{cables[-1].port}/")
        yield behind, cables


async def _copy(reader: StreamReader, writer: StreamWriter) -> None:
    with contextlib.suppress(ConnectionError):
        while received := await reader.read(65536):
            writer.write(received)
            await writer.drain()
    writer.close()


async def _run(port: int, target: int) -> None:
    async def join(reader: StreamReader, writer: StreamWriter) -> None:
        try:
            far_reader, far_writer = await asyncio.open_connection("127.0.0.1", target)
        except OSError:
            writer.close()
            return
        await asyncio.gather(_copy(reader, far_writer), _copy(far_reader, writer))

    server = await asyncio.start_server(join, "127.0.0.1", port)
    await server.serve_forever()


if __name__ == "__main__":
    asyncio.run(_run(*map(int, sys.argv[1:])))
