"""SIGTERM under load: everything is flushed, everyone is told to come back, nothing is left."""

from __future__ import annotations

import asyncio
import json
import os
import signal
import sys
import time
from typing import Any

import pytest
from websockets.asyncio.client import connect

from tests.support.servers import run_python, serve


async def walk_until_closed(
    url: str, rows: list[dict[str, Any]], stop
) -> tuple[list[int], dict[int, int]]:
    """Five viewers for each of ten walking sources; give close codes and what was acknowledged."""
    codes: list[int] = []
    begun = asyncio.Semaphore(0)
    acknowledged: dict[int, int] = {}

    async def watch(row: dict[str, Any]) -> None:
        path = f"{url}/ws/session/{row['session']}/patient/"
        token = {"Authorization": f"Bearer {row['tablet']}"}
        async with connect(path, additional_headers=token, open_timeout=60) as socket:
            begun.release()
            try:
                async for text in socket:
                    frame = json.loads(text).get("frame")
                    if frame:
                        await socket.send(json.dumps({"type": "seen", "frame": frame}))
            except Exception:  # noqa: S110 (however it ended, the code tells)
                pass
            codes.append(socket.close_code)

    async def walk(row: dict[str, Any]) -> None:
        token = {"Authorization": f"Bearer {row['source']}"}
        address = f"{url}/ws/source/"
        async with connect(address, additional_headers=token, open_timeout=60) as socket:
            await socket.send('{"type":"hello","version":1,"run":"x","last":0}')
            await socket.recv()

            async def hear() -> None:
                async for text in socket:
                    message = json.loads(text)
                    if message["type"] == "ack":
                        acknowledged[row["session"]] = message["number"]

            hearing = asyncio.create_task(hear())
            try:
                for number in range(1, 10_000):
                    step = {"type": "step", "number": number, "time_s": number, "side": "left"}
                    await socket.send(json.dumps(step | {"value": 3.5}))
                    await asyncio.sleep(0.02)
                    if number == 10:
                        begun.release()
            except Exception:  # noqa: S110
                pass
            hearing.cancel()
            codes.append(socket.close_code)

    tasks = [asyncio.create_task(watch(row)) for row in rows for _ in range(5)]
    tasks += [asyncio.create_task(walk(row)) for row in rows]
    for _ in tasks:  # however long it takes until all of them watch and walk
        await begun.acquire()
    stop()
    await asyncio.wait_for(asyncio.gather(*tasks), 15)
    return codes, acknowledged


@pytest.mark.essential
@pytest.mark.realtime
def test_sigterm_with_fifty_viewers(tmp_path):
    with serve(tmp_path) as server:
        rows = json.loads(run_python(tmp_path, "-m", "tests.support.live_seed", "10"))
        codes, acknowledged = asyncio.run(
            walk_until_closed(
                f"ws://127.0.0.1:{server.port}",
                rows,
                lambda: os.kill(server.process.pid, signal.SIGTERM),
            )
        )
        assert server.process.wait(15) == 0
        ids = ",".join(str(row["session"]) for row in rows)
        log = json.loads(run_python(tmp_path, "-m", "tests.support.live_log", ids))
    assert codes == [4012] * 60
    assert len(acknowledged) == 10
    for session, number in acknowledged.items():
        held = log[str(session)]
        assert held["numbers"] == list(range(1, len(held["numbers"]) + 1))
        assert number <= len(held["numbers"])
        assert held["refolds"]


@pytest.mark.server
def test_children_end_with_the_server(tmp_path):
    child = f"{sys.executable} -c 'import time; time.sleep(600)'"
    report = tmp_path / "children.json"
    with serve(tmp_path, "--child", child) as server:
        for _ in range(200):
            told = json.loads(report.read_text())["children"] if report.exists() else []
            if told and told[0]["pid"]:
                break
            time.sleep(0.05)
        os.kill(server.process.pid, signal.SIGTERM)
        assert server.process.wait(15) == 0
    try:
        os.kill(told[0]["pid"], 0)
    except ProcessLookupError:
        return
    raise AssertionError("the child is still there")
