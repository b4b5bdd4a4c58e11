"""The floor: a bare websocket relay, one viewer (or more) for each source, nothing stored."""

from __future__ import annotations

import asyncio
import logging
import sys

import uvloop
from websockets.asyncio.server import ServerConnection, serve

viewers: dict[str, list[ServerConnection]] = {}


async def handle(socket: ServerConnection) -> None:
    """Send what a source says to its viewers."""
    assert socket.request is not None
    _, role, key = socket.request.path.split("/")
    if role == "viewer":
        viewers.setdefault(key, []).append(socket)
        await socket.wait_closed()
        return
    async for text in socket:
        for viewer in viewers.get(key, ()):
            await viewer.send(text)


async def main(port: int) -> None:
    """Serve until killed."""
    logging.getLogger("websockets").setLevel(logging.CRITICAL)  # clients just hang up
    async with serve(handle, "127.0.0.1", port, compression=None):
        print("Ready", flush=True)
        await asyncio.Future()


if __name__ == "__main__":
    uvloop.run(main(int(sys.argv[1])))
