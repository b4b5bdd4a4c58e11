"""What one socket is to be sent: written at the end of the event loop's turn, or by a task.

To wake a task for each frame would cost as much as the frame does. A commit has messages for
many sockets, and one call of the event loop writes to all of them.
"""

from __future__ import annotations

import asyncio
from abc import ABC, abstractmethod
from collections.abc import Awaitable, Callable
from weakref import WeakKeyDictionary

from rehab.sessions.events.event import to_text
from rehab.sessions.state_messages import Message

# By event loop, those that have something to write at the end of its turn.
_due: WeakKeyDictionary[asyncio.AbstractEventLoop, list[Outgoing]] = WeakKeyDictionary()


def _flush_all(due: list[Outgoing]) -> None:
    waiting = due.copy()
    due.clear()  # first: what is woken from here on has another turn
    for one in waiting:
        one.flush()


class Outgoing(ABC):
    """Writes at once what the socket takes; ``pump`` sends what has to wait.

    Parameters
    ----------
    send, write
        Send a text once the socket takes it; send it now, or return False.
    """

    def __init__(
        self,
        send: Callable[[str], Awaitable[None]],
        write: Callable[[str], bool] = lambda _: False,
    ) -> None:
        self._loop = asyncio.get_running_loop()
        self._send = send
        self._write = write
        self._others = _due.setdefault(self._loop, [])
        self._is_due = False  # to be flushed at the end of this turn
        self._is_waiting = False  # the pump has sent all there was
        self._awake = asyncio.Event()

    def wake(self) -> None:
        """Write what there is at the end of the event loop's turn, all of it at once."""
        if not self._is_due:
            self._is_due = True
            if not self._others:
                self._loop.call_soon(_flush_all, self._others)
            self._others.append(self)

    def flush(self) -> None:
        """Write what there is; wake the pump for what has to wait."""
        self._is_due = False
        try:
            written = self._is_waiting and self._write_pending()
        except Exception:  # whatever it was, the pump meets it too, and its socket reports it
            written = False
        if not written:
            self._awake.set()

    async def pump(self) -> None:
        """Send until cancelled."""
        while True:
            self._is_waiting = True
            try:
                await self._awake.wait()
            finally:
                self._is_waiting = False
            self._awake.clear()
            await self._send_all()

    @abstractmethod
    def _write_pending(self) -> bool:
        """Write what there is; return whether that was all."""

    @abstractmethod
    async def _send_all(self) -> None:
        """Send what there is, waiting for the socket."""


class Outbox(Outgoing):
    """Queued messages of one socket: callers never wait."""

    def __init__(
        self,
        send: Callable[[str], Awaitable[None]],
        write: Callable[[str], bool] = lambda _: False,
    ) -> None:
        super().__init__(send, write)
        self._texts: list[str] = []
        self._ends_with_ack = False

    def queue(self, message: Message) -> None:
        """Queue a message."""
        self.queue_text(to_text(message))

    def queue_text(self, text: str) -> None:
        """Queue a message that is a frame's text already."""
        self._texts.append(text)
        self._ends_with_ack = False
        self.wake()

    def acknowledge(self, number: int) -> None:
        """Queue an ack; a newer one replaces it, since an ack covers all steps before."""
        if self._ends_with_ack:
            self._texts.pop()
        self._texts.append(f'{{"type":"ack","number":{number}}}')
        self._ends_with_ack = True
        self.wake()

    def _write_pending(self) -> bool:
        texts = self._texts
        while texts and self._write(texts[0]):
            del texts[0]
        self._ends_with_ack = self._ends_with_ack and bool(texts)
        return not texts

    async def _send_all(self) -> None:
        texts, self._texts, self._ends_with_ack = self._texts, [], False
        for text in texts:
            await self._send(text)
