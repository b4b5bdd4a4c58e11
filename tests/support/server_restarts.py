"""Somebody walks on while the server restarts: signals by TCP, one source, one session."""

from __future__ import annotations

import asyncio
import json
import re
import signal
from pathlib import Path

from rehab.sources.synthetic.signals import Sensors
from rehab.sources.synthetic.walker import walk
from tests.support.running_source import NAMES, run_source, send_in_time
from tests.support.synthetic_recordings import make_signals
from tests.support.torture import Torture, Walk

WARM_S = 1.0


async def walk_with_restarts(
    folder: Path, *, seconds: float, restarts: tuple[float, ...], kill: signal.Signals
) -> tuple[int, int, str]:
    """Walk so long, with a server that is ended then and comes back.

    Returns how many strides are not in the log, how many were walked, and what became of them.
    """
    torture = Torture(folder, seed=1)
    server = await torture.start_server()
    (row,) = json.loads(torture.run_python("-m", "tests.support.live_seed", "1"))
    session = Walk(row, torture.entrance, 1.0)
    strides = list(walk(seed=3, strides=int(seconds / 1.05)))
    made = make_signals(strides, 75, Sensors(rate_hz=100), seed=3)
    arguments = ("rows", "--listen", "tcp://127.0.0.1:0", "--mass", "75")
    url = f"http://127.0.0.1:{torture.port}"
    async with run_source(*arguments, token=row["source"], server=url, folder=folder) as source:
        await source.wait_for("is running")
        port = int(re.search(r":(\d+)\.", await source.wait_for("Listening"))[1])
        _, writer = await asyncio.open_connection("127.0.0.1", port)
        writer.write((",".join(["time_s", *NAMES]) + "\n").encode())

        async def write(rows: list[list[float]]) -> None:
            writer.write(b"".join(b",".join(b"%.9g" % c for c in row) + b"\n" for row in rows))
            await writer.drain()

        sending = asyncio.create_task(send_in_time(made, write, 5))
        passed_s = 0.0
        for at_s in restarts:
            await asyncio.sleep(at_s - passed_s)
            server.send_signal(kill)
            await server.wait()
            await asyncio.sleep(WARM_S)
            server = await torture.start_server()
            await torture.resume(session)
            passed_s = at_s
        await sending
        writer.close()
        await source.wait_for("sends no more")
        expected = sum(s.terminal_contact_s + 0.05 < made.t_s[-1] for s in made.strides)
        async with asyncio.timeout(20):
            while not source.acks() or source.acks()[-1]["number"] < expected:  # noqa: ASYNC110
                await asyncio.sleep(0.05)
    server.send_signal(signal.SIGTERM)
    await server.wait()
    log = json.loads(torture.run_python("-m", "tests.support.live_log", str(row["session"])))
    numbers = log[str(row["session"])]["numbers"]
    assert numbers == list(range(1, len(numbers) + 1))
    return expected - len(numbers), expected, f"{len(restarts)} times {kill.name}"
