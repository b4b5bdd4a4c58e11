"""A server that obeys docs/protocol.md for one station, in memory, and can be told to misbehave."""

import json
from collections import defaultdict
from contextlib import asynccontextmanager
from typing import Any

from websockets.asyncio.server import ServerConnection, serve
from websockets.exceptions import ConnectionClosed

TOKEN = "t-1"

Message = dict[str, Any]


class FakeGarry:
    """One station. ``steps`` holds each session's log, ``hellos`` every greeting."""

    def __init__(self) -> None:
        self.url = ""
        self.measure = "a2"
        self.session: int | None = 7
        self.state = "running"
        self.phase = {"kind": "training", "name": "Push", "feedback": True, "gain": 1.0}
        self.phases: dict[int, Message] = {}  # after which step which phase begins
        self.steps: dict[int, list[Message]] = defaultdict(list)
        self.repeated: list[int] = []
        self.hellos: list[Message] = []
        self.frames: list[Message] = []
        self.sockets: list[ServerConnection] = []
        self.holds_acks = False
        self.close_after: dict[int, int] = {}  # step number: close code, before its ack
        self.unacknowledged_max = 0
        self._acknowledged = 0

    @property
    def log(self) -> list[Message]:
        return self.steps[self.session]

    @property
    def numbers(self) -> list[int]:
        return [step["number"] for step in self.log]

    async def tell(self, **message) -> None:
        """Tell the source that is connected now."""
        await self.sockets[-1].send(json.dumps(message))

    async def change(self, kind: str) -> None:
        """Start, pause, resume or stop the session, and say so."""
        self.state = {"pause": "paused", "stop": "finished"}.get(kind, "running")
        await self.tell(type=kind)

    async def open(self, session: int | None, state: str = "running") -> None:
        """Open another session and welcome the source to it."""
        self.session, self.state, self._acknowledged = session, state, 0
        await self._welcome(self.sockets[-1])

    async def acknowledge(self) -> None:
        """Acknowledge all there is."""
        self.holds_acks = False
        self._acknowledged = len(self.log)
        await self.tell(type="ack", number=self._acknowledged)

    async def refuse(self, socket: ServerConnection, close: int, code: str, message: str) -> None:
        """Send what is wrong and close."""
        await socket.send(json.dumps({"type": "error", "code": code, "message": message}))
        await socket.close(close)

    async def serve_source(self, socket: ServerConnection) -> None:
        self.sockets.append(socket)
        if socket.request.headers.get("Authorization") != f"Bearer {TOKEN}":
            await self.refuse(socket, 4001, "unauthorized", "Unknown token. Make a new one.")
            return
        try:
            self.hellos.append(json.loads(await socket.recv()))
            await self._welcome(socket)
            async for text in socket:
                assert len(text) <= 64 * 1024
                await self._take(socket, json.loads(text))
        except ConnectionClosed:
            pass

    async def _welcome(self, socket: ServerConnection) -> None:
        message: Message = {"type": "welcome", "session": self.session}
        if self.session is not None:
            message |= {"state": self.state, "next": len(self.log) + 1, "goal": 3.9}
            message |= {"trained_side": "right", "measure": self.measure, "unit": "W/kg"}
            message |= {"phase": self.phase}
        await socket.send(json.dumps(message))

    async def _take(self, socket: ServerConnection, frame: Message) -> None:
        self.frames.append(frame)
        if frame["type"] == "sensor":
            return
        steps = frame["steps"] if frame["type"] == "steps" else [frame]
        for step in steps:
            step = {name: value for name, value in step.items() if name != "type"}  # noqa: PLW2901
            number = step["number"]
            if self.state == "ready":
                error = {"type": "error", "code": "not_running", "message": "Wait for start."}
                await socket.send(json.dumps(error))
                return
            if self.state not in ("running", "paused"):
                await self.refuse(socket, 4410, "ended", "The session has ended.")
                return
            if number <= len(self.log):
                if self.log[number - 1] != step:
                    message = f"Step {number} is stored with other content."
                    await self.refuse(socket, 4400, "conflict", message)
                    return
                self.repeated.append(number)
            elif number > len(self.log) + 1:
                await self.refuse(socket, 4400, "gap", f"Send step {len(self.log) + 1} first.")
                return
            else:
                self.log.append(step)
            waiting = len(self.log) - self._acknowledged
            self.unacknowledged_max = max(self.unacknowledged_max, waiting)
            if number in self.close_after:
                await socket.close(self.close_after.pop(number))
                return
            if number in self.phases:
                self.phase = self.phases.pop(number)
                await socket.send(json.dumps({"type": "phase", "phase": self.phase}))
        if not self.holds_acks:
            self._acknowledged = len(self.log)
            await socket.send(json.dumps({"type": "ack", "number": steps[-1]["number"]}))


@asynccontextmanager
async def serve_garry(garry: FakeGarry, port: int = 0):
    """Let it be reached; hangs up with 1001 at the end."""
    async with serve(garry.serve_source, "127.0.0.1", port) as server:
        garry.url = f"ws://127.0.0.1:{server.sockets[0].getsockname()[1]}/ws/source/"
        yield server
