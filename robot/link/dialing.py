"""Dials a websocket: how long that may take, and the pauses between attempts."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any
from urllib.parse import urlsplit

from websockets.asyncio.client import ClientConnection, connect


@dataclass(frozen=True, slots=True)
class Timing:
    """How long a connection waits [s].

    A half-open one is noticed after at most ``ping_every_s + pong_within_s + close_within_s``.
    """

    retry_first_s: float = 0.2
    retry_longest_s: float = 5.0
    connect_within_s: float = 5.0
    ping_every_s: float = 4.0
    pong_within_s: float = 4.0
    close_within_s: float = 1.0


TIMING = Timing()


class BackOff:
    """The pauses [s] between attempts: each twice as long as the one before, up to a longest.

    Parameters
    ----------
    timing
        The first and the longest pause.
    jitter
        Returns numbers in [0, 1). It shortens a pause by up to half, so that a thousand clients of
        a server that restarts do not reconnect at once.
    """

    def __init__(self, timing: Timing, jitter: Callable[[], float]) -> None:
        self._timing, self._jitter = timing, jitter
        self._pause_s = timing.retry_first_s

    def next_s(self) -> float:
        """Return the pause before the next attempt [s]."""
        pause_s = self._pause_s
        self._pause_s = min(2 * pause_s, self._timing.retry_longest_s)
        return pause_s * (1 - self._jitter() / 2)

    def reset(self) -> None:
        """Start again with the shortest pause."""
        self._pause_s = self._timing.retry_first_s


async def dial(url: str, timing: Timing, max_bytes: int, **options: Any) -> ClientConnection:
    """Return a new connection. Raises OSError and WebSocketException.

    Parameters
    ----------
    url
        ws://… or wss://…; a proxy of the environment is used but for this computer itself.
    timing
        How long it waits [s].
    max_bytes
        The largest frame that is received [bytes].
    options
        Others of ``websockets.asyncio.client.connect``.
    """
    is_loopback = urlsplit(url).hostname in {"localhost", "127.0.0.1", "::1"}
    return await connect(
        url,
        compression=None,  # frames are small; compression would only cost time
        proxy=None if is_loopback else True,
        max_size=max_bytes,
        open_timeout=timing.connect_within_s,
        ping_interval=timing.ping_every_s,
        ping_timeout=timing.pong_within_s,
        close_timeout=timing.close_within_s,
        **options,
    )
