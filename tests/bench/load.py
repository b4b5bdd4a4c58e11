"""The load: so many sources at two steps a second, their viewers, and a clock. Its own process.

Prints "measure" and "measured" where that begins and ends, "slice" at the end of each part of it,
then a line of JSON: latencies from a step's sending to its arrival at each viewer, how many were
lost, and how busy this process was itself.
"""

from __future__ import annotations

import argparse
import asyncio
import json
import random
import re
import resource
import time
from array import array
from collections.abc import Sequence
from typing import Any

import uvloop
from websockets.asyncio.client import ClientConnection, connect

NUMBERS = re.compile(r'"kind":"step",(?:"live":true,)?"number":(\d+)|"type":"step","number":(\d+)')
CONFIRM_EVERY = 8
now = time.perf_counter


class Load:
    """All sources and viewers of one run."""

    def __init__(self, options: argparse.Namespace, rows: list[dict[str, Any]]) -> None:
        self.options = options
        self.rows = rows
        self.sent: list[dict[int, float]] = [{} for _ in rows]
        self.acked = [0] * len(rows)
        self.delays = [array("f") for _ in range(options.slices)]  # by when a step was sent
        self.ack_delays: list[float] = []
        self.arrived = 0
        self.measuring = (0.0, 0.0)
        self.slice_s = options.seconds / options.slices
        self.tasks: list[asyncio.Task[None]] = []

    async def open(self, path: str, token: str = "", cookie: str = "") -> ClientConnection:
        base = f"ws://127.0.0.1:{self.options.port}"
        headers = {"Authorization": f"Bearer {token}"} if token else {}
        if cookie:
            headers = {"Cookie": f"sessionid={cookie}", "Origin": base.replace("ws", "http")}
        return await connect(
            base + path,
            additional_headers=headers,
            compression=None,
            open_timeout=120,
            ping_interval=None,
            max_queue=None,
        )

    async def view(self, index: int, socket: ClientConnection, confirm: bool) -> None:
        frames = 0
        async for frame in socket:
            text, at = str(frame), now()
            for first, second in NUMBERS.findall(text):
                began = self.sent[index].get(int(first or second))
                if began is not None and self.measuring[0] <= began < self.measuring[1]:
                    self.arrived += 1
                    self.delays[int((began - self.measuring[0]) / self.slice_s)].append(at - began)
            if confirm and '"frame":' in text[:40]:
                frames = int(text[: text.index("[")].split('"frame":')[1].split(",", maxsplit=1)[0])
                if frames % CONFIRM_EVERY == 0:  # as pages do (session_socket.js)
                    await socket.send(f'{{"type":"seen","frame":{frames}}}')

    async def hear_acks(self, index: int, socket: ClientConnection) -> None:
        async for frame in socket:
            text = str(frame)
            if text.startswith('{"type":"ack"'):
                at, number = now(), json.loads(text)["number"]
                for one in range(self.acked[index] + 1, number + 1):
                    began = self.sent[index].get(one)
                    if began is not None and self.measuring[0] <= began < self.measuring[1]:
                        self.ack_delays.append(at - began)
                self.acked[index] = number

    async def start(self, index: int) -> ClientConnection:
        row, relay = self.rows[index], self.options.mode == "relay"
        for place in range(self.options.viewers):
            if relay:
                socket, confirm = await self.open(f"/viewer/{row['session']}"), False
            elif place == 0:
                socket = await self.open(f"/ws/session/{row['session']}/patient/", row["tablet"])
                confirm = True
            elif place == 1:
                socket = await self.open(
                    f"/ws/session/{row['session']}/monitor/", cookie=row["cookie"]
                )
                confirm = True
            else:
                socket, confirm = await self.open("/ws/robot/", row["robot"]), False
                await socket.send('{"type":"hello","version":1,"base":"null"}')
            self.tasks.append(asyncio.create_task(self.view(index, socket, confirm)))
        source = await self.open(
            f"/source/{row['session']}" if relay else "/ws/source/", "" if relay else row["source"]
        )
        if not relay:
            await source.send('{"type":"hello","version":1,"run":"load","last":0}')
            welcome = json.loads(await source.recv())
            assert welcome["state"] == "running", welcome
            self.tasks.append(asyncio.create_task(self.hear_acks(index, source)))
        return source

    async def walk(self, index: int, source: ClientConnection, began: float, until: float) -> None:
        period = 1 / self.options.rate
        due, number = began + random.random() * period, 0
        extra = ',"extra":{"step_length_m":0.57,"swing_s":0.37}'
        while due < until:
            await asyncio.sleep(max(0.0, due - now()))
            number += 1
            value = 2.5 + random.random() * 2
            frame = (
                f'{{"type":"step","number":{number},"time_s":{number * period:.3f},'
                f'"kind":"step","side":"left","value":{value:.4f}{extra}}}'
            )
            self.sent[index][number] = now()
            await source.send(frame)
            due += period

    async def run(self) -> dict[str, Any]:
        sources = []
        for first in range(0, len(self.rows), 20):
            indices = range(first, min(first + 20, len(self.rows)))
            sources += await asyncio.gather(*(self.start(index) for index in indices))
        began = now() + 0.5
        self.measuring = (
            began + self.options.warmup,
            began + self.options.warmup + self.options.seconds,
        )
        until = self.measuring[1] + 0.2
        walks = [
            asyncio.create_task(self.walk(index, source, began, until))
            for index, source in enumerate(sources)
        ]
        await asyncio.sleep(self.measuring[0] - now())
        print("measure", flush=True)
        busy = cpu()
        for place in range(self.options.slices):
            await asyncio.sleep(self.measuring[0] + (place + 1) * self.slice_s - now())
            print("slice", flush=True)
        print("measured", flush=True)
        busy = cpu() - busy
        await asyncio.gather(*walks)
        await asyncio.sleep(3.0)
        steps = sum(
            self.measuring[0] <= at < self.measuring[1]
            for sent in self.sent
            for at in sent.values()
        )
        for task in self.tasks:
            task.cancel()
        return {
            "steps": steps,
            "expected": steps * self.options.viewers,
            "arrived": self.arrived,
            **percentiles("view", [delay for part in self.delays for delay in part]),
            "slices": [percentiles("view", part) for part in self.delays],
            **percentiles("ack", self.ack_delays),
            "own_cpu": busy / self.options.seconds,
        }


def cpu() -> float:
    usage = resource.getrusage(resource.RUSAGE_SELF)
    return usage.ru_utime + usage.ru_stime


def percentiles(name: str, delays: Sequence[float]) -> dict[str, float]:
    if not delays:
        return {}
    ordered = sorted(delays)
    return {
        f"{name}_p50_ms": 1000 * ordered[len(ordered) // 2],
        f"{name}_p99_ms": 1000 * ordered[int(len(ordered) * 0.99)],
        f"{name}_max_ms": 1000 * ordered[-1],
    }


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("mode", choices=("garry", "relay"))
    parser.add_argument("port", type=int)
    parser.add_argument("rows")
    parser.add_argument("--viewers", type=int, default=1)
    parser.add_argument("--rate", type=float, default=2.0)
    parser.add_argument("--warmup", type=float, default=3.0)
    parser.add_argument("--seconds", type=float, default=6.0)
    parser.add_argument("--slices", type=int, default=1)
    chosen = parser.parse_args()
    with open(chosen.rows) as file:  # noqa: PTH123
        made = json.load(file)
    print(json.dumps(uvloop.run(Load(chosen, made).run())), flush=True)
