"""A server that obeys docs/protocol.md for one robot, in memory, and can be told to misbehave."""

import asyncio
import json
from contextlib import asynccontextmanager
from typing import Any

from websockets.asyncio.server import ServerConnection, serve
from websockets.exceptions import ConnectionClosed

from tests.support import robot_stage

TOKEN = "t-1"
CUE = robot_stage.CUE | {"below": None}

Message = dict[str, Any]


class FakeGarry:
    """One station with one session. ``reports`` and ``incidents`` hold what the robot said."""

    def __init__(self) -> None:
        self.url = ""
        self.welcome: Message = {"type": "welcome", "session": 7, "state": "running"}
        self.welcome |= {"cue": CUE, "stopped": False}
        self.hellos: list[Message] = []
        self.reports: list[Message] = []
        self.incidents: list[Message] = []
        self.sockets: list[ServerConnection] = []
        self.beats = True
        self._reported = asyncio.Event()
        self._dialed_in = asyncio.Event()

    async def serve_robot(self, socket: ServerConnection) -> None:
        if socket.request.headers.get("Authorization") != f"Bearer {TOKEN}":
            error = {"type": "error", "code": "token", "message": "Unknown token. Make a new one."}
            await socket.send(json.dumps(error))
            await socket.close(4001)
            return
        beating = asyncio.create_task(self._beat(socket))
        try:
            self.hellos.append(json.loads(await socket.recv()))
            self.sockets.append(socket)
            await socket.send(json.dumps(self.welcome))
            self._dialed_in.set()
            async for text in socket:
                message = json.loads(text)
                if message["type"] == "report":
                    self.reports.append(message["report"])
                else:
                    self.incidents.append(message)
                self._reported.set()
        except ConnectionClosed:
            pass
        finally:
            beating.cancel()

    async def _beat(self, socket: ServerConnection) -> None:
        while True:
            await asyncio.sleep(0.1)
            if self.beats:
                await socket.send('{"type":"heartbeat"}')

    async def tell(self, text: str = "", **message) -> None:
        """Tell the robot that is connected now."""
        await self.sockets[-1].send(text or json.dumps(message))

    async def walk(self, *times_s: float, performance: float = 1.0) -> None:
        """Send steps."""
        for time_s in times_s:
            await self.tell(type="step", number=1, time_s=time_s, performance=performance)

    async def until(self, fits, within_s: float = 10) -> Message:
        """Wait for a report that fits; return it."""
        async with asyncio.timeout(within_s):
            while True:
                for report in self.reports:
                    if fits(report):
                        return report
                self._reported.clear()
                await self._reported.wait()

    async def until_hello(self, count: int) -> None:
        """Wait until the robot has dialed in so many times."""
        async with asyncio.timeout(10):
            while len(self.sockets) < count:
                self._dialed_in.clear()
                await self._dialed_in.wait()


@asynccontextmanager
async def serve_garry(garry: FakeGarry, port: int = 0):
    """Let it be reached; hangs up with 1001 at the end."""
    async with serve(garry.serve_robot, "127.0.0.1", port) as server:
        garry.url = f"ws://127.0.0.1:{server.sockets[0].getsockname()[1]}/ws/robot/"
        yield server
