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
from collections.abc import Awaitable, Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from typing import Protocol
from urllib.parse import urlsplit

from websockets.asyncio.client import ClientConnection
from websockets.exceptions import ConnectionClosed, WebSocketException

from robot.link import BackOff, Timing, dial
from robot.motion.limits import TICK_S
from robot.ros.frames import MAX_FRAME_BYTES, BadRosFrame, Frame, Incoming, read_frame, to_text

DEFAULT_URL = "ws://127.0.0.1:9090"

# Quicker than to a server: a base that was moving has to be stopped.
TIMING = Timing(
    retry_first_s=0.05,
    retry_longest_s=1.0,
    connect_within_s=3.0,
    ping_every_s=1.0,
    pong_within_s=1.0,
    close_within_s=0.5,
)
SEND_WITHIN_S = 0.5  # a bridge that accepts nothing for this long is lost
END_S = 2.0


class TopicClient(Protocol):
    """What publishes and subscribes at a bridge; every call gets the time."""

    def open(self, now_s: float) -> Iterable[Frame]:
        """Return the first frames of a new connection."""

    def due(self, now_s: float) -> Iterable[Frame]:
        """Return the frames to send now."""

    def handle(self, incoming: Incoming, now_s: float) -> None:
        """Handle a received frame.

        Parameters
        ----------
        incoming
            The frame.
        now_s
            When it came, on the bridge's clock [s].

        Raises
        ------
        BadRosFrame
            Where it is not understood.
        """

    def disconnect(self, now_s: float) -> None:
        """Handle the loss of the connection."""

    def end(self, now_s: float) -> Iterable[Frame]:
        """Return the last frames."""


class Bridge:
    """A connection to a rosbridge that reconnects by itself.

    Parameters
    ----------
    client
        What publishes and subscribes.
    monotonic
        The clock [s] of those calls.
    sleep, jitter
        How to pause between attempts, and where chance comes from, in [0, 1).

    Attributes
    ----------
    lock
        Held during each call of the client, here on the bridge's thread.
    problem
        Why there is no connection; empty while there is one, and before it is opened.
    counters
        How often a connection was made (``bridge_openings``), and how many frames were not
        understood (``bridge_bad``).
    """

    def __init__(
        self,
        client: TopicClient,
        monotonic: Callable[[], float] = time.monotonic,
        *,
        sleep: Callable[[float], Awaitable[object]] = asyncio.sleep,
        jitter: Callable[[], float] = random.random,
    ) -> None:
        self._client = client
        self.lock = threading.Lock()
        self._monotonic = monotonic
        self._sleep = sleep
        self._back_off = BackOff(TIMING, jitter)
        self.url = self.problem = ""
        self.counters: Counter[str] = Counter(bridge_openings=0, bridge_bad=0)
        self._loop: asyncio.AbstractEventLoop | None = None
        self._wanted, self._closing = asyncio.Event(), asyncio.Event()
        self._thread: threading.Thread | None = None

    @property
    def is_dead(self) -> bool:
        """Whether its thread has ended, so that nothing is sent any more."""
        return self._thread is not None and not self._thread.is_alive()

    def open(self, url: str) -> None:
        """Start to connect to ws://host:9090, and to reconnect."""
        self.url, self.problem = url, f"No connection to the rosbridge at {url} yet."
        loop = self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._run, args=(loop,), daemon=True)
        self._thread.start()

    @contextmanager
    def sending(self) -> Iterator[None]:
        """Hold the lock while the client is called; then send at once what is due. Never waits."""
        with self.lock:
            yield
        self._call(self._wanted.set)

    def close(self) -> None:
        """Send the last frames and close. Never raises."""
        self._call(self._closing.set)
        if self._thread is not None:
            self._thread.join(END_S)

    def _call(self, callback: Callable[[], None]) -> None:
        if self._loop is not None:
            with suppress(RuntimeError):  # it has been closed
                self._loop.call_soon_threadsafe(callback)

    def _run(self, loop: asyncio.AbstractEventLoop) -> None:
        with asyncio.Runner(loop_factory=lambda: loop) as runner:
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
        try:
            socket = await dial(self.url, TIMING, MAX_FRAME_BYTES)
        except (OSError, WebSocketException) as problem:
            self.problem = f"No rosbridge answers at {self.url} ({_explain(problem)})."
        else:
            self.counters["bridge_openings"] += 1
            self.problem = ""
            try:
                await self._exchange_frames(socket)
            finally:
                with self.lock:
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
        with self.lock:
            frames = list(next_frames(self._monotonic()))
        for frame in frames:
            async with asyncio.timeout(SEND_WITHIN_S):
                await socket.send(to_text(frame))

    async def _receive(self, socket: ClientConnection) -> None:
        with suppress(ConnectionClosed):
            async for text in socket:
                try:
                    incoming = read_frame(text)
                    with self.lock:
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
