"""The websocket to a rosbridge, on a thread of its own: it reconnects by itself and queues nothing.

The client is asked for frames only when they can be sent. What a lost connection could not send is
dropped, so that the next one begins with the present state.
"""

from __future__ import annotations

import asyncio
import os
import random
import threading
import time
from collections import Counter
from collections.abc import Awaitable, Callable, Iterable
from contextlib import suppress
from typing import Protocol
from urllib.parse import urlsplit

from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import ConnectionClosed, WebSocketException

from robot.link import BackOff
from robot.motion.limits import TICK_S
from robot.ros.frames import MAX_FRAME_BYTES, BadRosFrame, Frame, Incoming, read_frame, to_text

DEFAULT_URL = "ws://127.0.0.1:9090"

PING_EVERY_S = PONG_WITHIN_S = 1.0
SEND_WITHIN_S = 0.5  # a bridge that accepts nothing for this long is lost
CONNECT_WITHIN_S = 3.0
CLOSE_WITHIN_S = 0.5
RETRY_FIRST_S, RETRY_LONGEST_S = 0.05, 1.0  # a base that was moving is to be stopped
END_S = 2.0


class TopicClient(Protocol):
    """What publishes and subscribes at a bridge; every call gets the time."""

    def open(self, now_s: float) -> Iterable[Frame]:
        """Return the first frames of a new connection."""

    def due(self, now_s: float) -> Iterable[Frame]:
        """Return the frames to send now."""

    def handle(self, incoming: Incoming, now_s: float) -> None:
        """Handle a received frame. Raises BadRosFrame where it is not understood."""

    def disconnect(self, now_s: float) -> None:
        """Handle the loss of the connection."""

    def end(self, now_s: float) -> Iterable[Frame]:
        """Return the last frames."""


class Bridge:
    """A connection to a rosbridge that reconnects by itself.

    Parameters
    ----------
    url
        ws://host:9090.
    client
        What publishes and subscribes.
    lock
        Held during each call of the client, on the bridge's thread.
    monotonic
        The clock [s] of those calls.
    sleep, jitter
        How to pause between attempts, and where chance comes from, in [0, 1).

    Attributes
    ----------
    problem
        Why there is no connection; empty while there is one.
    counters
        How often a connection was made (``bridge_openings``), and how many frames were not
        understood (``bridge_bad``).
    """

    def __init__(
        self,
        url: str,
        client: TopicClient,
        lock: threading.Lock,
        monotonic: Callable[[], float] = time.monotonic,
        *,
        sleep: Callable[[float], Awaitable[object]] = asyncio.sleep,
        jitter: Callable[[], float] = random.random,
    ) -> None:
        self.url = url
        self._client, self._lock = client, lock
        self._monotonic = monotonic
        self._sleep = sleep
        self._back_off = BackOff(RETRY_FIRST_S, RETRY_LONGEST_S, jitter)
        self.problem = f"No connection to the rosbridge at {url} yet."
        self.counters: Counter[str] = Counter(bridge_openings=0, bridge_bad=0)
        self._loop = asyncio.new_event_loop()
        self._wanted, self._closing = asyncio.Event(), asyncio.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    @property
    def is_dead(self) -> bool:
        """Whether its thread has ended, so that nothing is sent any more."""
        return not self._thread.is_alive()

    def wake(self) -> None:
        """Send at once what is due. Never waits, never raises."""
        with suppress(RuntimeError):  # it has been closed
            self._loop.call_soon_threadsafe(self._wanted.set)

    def close(self) -> None:
        """Send the last frames and close. Never raises."""
        with suppress(RuntimeError):
            self._loop.call_soon_threadsafe(self._closing.set)
        self._thread.join(END_S)

    def _run(self) -> None:
        with asyncio.Runner(loop_factory=lambda: self._loop) as runner:
            runner.run(self._run_until_closed())

    async def _run_until_closed(self) -> None:
        """Connect, again and again, until closed."""
        closing = asyncio.create_task(self._closing.wait())
        while not self._closing.is_set():
            connecting = asyncio.create_task(self._connect())
            await asyncio.wait((connecting, closing), return_when=asyncio.FIRST_COMPLETED)
            connecting.cancel()
            with suppress(asyncio.CancelledError):
                await connecting
        closing.cancel()

    async def _connect(self) -> None:
        """Stay on one connection until it is lost, then pause."""
        loopback = urlsplit(self.url).hostname in {"localhost", "127.0.0.1", "::1"}
        try:
            socket = await connect(
                self.url,
                compression=None,
                proxy=None if loopback else True,
                max_size=MAX_FRAME_BYTES,
                open_timeout=CONNECT_WITHIN_S,
                ping_interval=PING_EVERY_S,
                ping_timeout=PONG_WITHIN_S,
                close_timeout=CLOSE_WITHIN_S,
            )
        except (OSError, WebSocketException) as problem:
            self.problem = f"No rosbridge answers at {self.url} ({_explain(problem)})."
        else:
            self.counters["bridge_openings"] += 1
            self.problem = ""
            try:
                await self._exchange_frames(socket)
            finally:
                with self._lock:
                    self._client.disconnect(self._monotonic())
                self.problem = f"The connection to the rosbridge at {self.url} was lost."
        await self._sleep(self._back_off.next_s())

    async def _exchange_frames(self, socket: ClientConnection) -> None:
        """Send and receive until the connection is lost or the bridge closed."""
        try:
            await self._send(socket, self._client.open)
            receiving = asyncio.create_task(self._receive(socket))
            try:
                while not receiving.done():
                    await self._send(socket, self._client.due)
                    with suppress(TimeoutError):
                        async with asyncio.timeout(TICK_S):
                            await self._wanted.wait()
                    self._wanted.clear()
            finally:
                receiving.cancel()
                with suppress(asyncio.CancelledError):
                    await receiving
        except (ConnectionClosed, TimeoutError):
            socket.transport.abort()
        except asyncio.CancelledError:
            with suppress(ConnectionClosed, TimeoutError):
                await self._send(socket, self._client.end)
            raise
        finally:
            await socket.close()

    async def _send(
        self, socket: ClientConnection, next_frames: Callable[[float], Iterable[Frame]]
    ) -> None:
        with self._lock:
            frames = list(next_frames(self._monotonic()))
        for frame in frames:
            async with asyncio.timeout(SEND_WITHIN_S):
                await socket.send(to_text(frame))

    async def _receive(self, socket: ClientConnection) -> None:
        with suppress(ConnectionClosed):
            async for text in socket:
                try:
                    incoming = read_frame(text)
                    with self._lock:
                        self._client.handle(incoming, self._monotonic())
                except BadRosFrame:
                    self.counters["bridge_bad"] += 1
                else:
                    self._back_off.reset()
                    self._wanted.set()  # an echo may allow the next frame


def find_bridge() -> str:
    """Return the address in GARRY_ROS_URL, or the default one on this computer."""
    return os.environ.get("GARRY_ROS_URL", DEFAULT_URL)


def is_address(url: str) -> bool:
    """Whether a bridge could be there: ws://host:port, or wss://…"""
    try:
        parts = urlsplit(url)
        return parts.scheme in ("ws", "wss") and bool(parts.hostname) and parts.port != 0
    except ValueError:
        return False


def _explain(problem: OSError | WebSocketException) -> str:
    if isinstance(problem, TimeoutError):
        return "in time"
    return (problem.strerror if isinstance(problem, OSError) else None) or str(problem)
