"""How the servers on one database talk: messages and questions over the channel layer.

Each server has one channel, named by its lease. Messages may be lost: all that depends on them is
how soon something is known. A question waits for its answer and raises NoAnswer where none comes.

The layer encrypts, so that a neighbor at Redis can neither read nor write. Each message names
its receiver and has a number that only grows, so that a recorded one cannot be replayed.
"""

from __future__ import annotations

import asyncio
import contextlib
import contextvars
import itertools
import logging
import math
import time
from collections import deque
from collections.abc import Awaitable, Callable, Mapping
from typing import Any, NamedTuple

from channels.layers import get_channel_layer

from rehab.sessions.live.process import end_tasks

log = logging.getLogger(__name__)

Data = dict[str, Any]
RECEIPT_S = 0.3  # within which the other server confirms that it has a question
ANSWER_S = 5.0  # within which it answers one that waits for its disk
WAITING = 10_000  # messages; older ones are dropped while Redis does not answer
SILENCE_S = 5.0  # our own echo comes each second; without it the subscription is lost
PAUSE_S = 0.5  # after a failure of the layer
RECEIVED = "received"
ANSWER = "answer"
Handler = Callable[[str, Data], Awaitable[Data | None]]


class NoAnswer(RuntimeError):
    """The other server did not respond; what was asked may not have happened."""


class Queued(NamedTuple):
    """A message that waits to be sent, until when by the monotonic clock."""

    server: str
    message: Data
    until_s: float


class Intercom:
    """This server's channel.

    Parameters
    ----------
    own
        The id of this server's lease.
    handlers
        By kind of message: called with the sender's id and the data; what is returned answers a
        question.
    """

    def __init__(self, own: str, handlers: Mapping[str, Handler]) -> None:
        self.own = own
        self.echoed_s = time.monotonic()  # when a message to ourselves came back last
        self._handlers = handlers
        self._layer: Any = get_channel_layer()
        self._outgoing: deque[Queued] = deque(maxlen=WAITING)
        self._sent = itertools.count(1)
        self._latest: dict[str, int] = {}  # by server: the number of its latest message
        self._awake = asyncio.Event()
        self._questions: dict[int, asyncio.Queue[Data]] = {}
        self._numbers = itertools.count(1)
        self._tasks: set[asyncio.Task[None]] = set()
        self._start(self._send_queued())
        self._start(self._receive())

    def send(self, server: str, kind: str, data: Data, *, within_s: float = math.inf) -> Queued:
        """Queue a message to another server, to be dropped where it waits longer; return it."""
        way = {"from": self.own, "for": server, "sent": next(self._sent)}
        queued = Queued(server, {"type": kind, **way, **data}, time.monotonic() + within_s)
        self._outgoing.append(queued)
        self._awake.set()
        return queued

    async def ask(self, server: str, kind: str, data: Data, answer_s: float = ANSWER_S) -> Data:
        """Return another server's answer. Raises NoAnswer where none comes."""
        number = next(self._numbers)
        answers = self._questions[number] = asyncio.Queue()
        queued = self.send(server, kind, {**data, "question": number})
        try:
            async with asyncio.timeout(RECEIPT_S):
                answer = await answers.get()
            if answer["type"] == RECEIVED:
                async with asyncio.timeout(answer_s):
                    answer = await answers.get()
        except TimeoutError:
            with contextlib.suppress(ValueError):
                self._outgoing.remove(queued)  # its caller gives up
            raise NoAnswer("The server of this session does not answer.") from None
        finally:
            del self._questions[number]
        return answer

    def echo(self) -> None:
        """Send a message to this server itself, to check that messages pass."""
        self.send(self.own, "echo", {})

    async def close(self) -> None:
        """Cancel what is under way."""
        await end_tasks(list(self._tasks))

    def _start(self, work: Any) -> None:
        loop, context = asyncio.get_running_loop(), contextvars.Context()  # not a request's
        task = loop.create_task(work, context=context)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    async def _send_queued(self) -> None:
        failing = False
        while True:
            await self._awake.wait()
            self._awake.clear()
            while self._outgoing:
                server, message, until_s = self._outgoing.popleft()
                if time.monotonic() > until_s:
                    continue
                try:
                    await self._layer.send(_channel(server), message)
                    failing = False
                except Exception as problem:  # whatever the layer's client raises
                    if not failing:
                        log.error("No message reaches other servers: %r", problem)
                    failing = True
                    await asyncio.sleep(PAUSE_S)

    async def _receive(self) -> None:
        while True:
            try:
                async with asyncio.timeout(SILENCE_S):
                    message = await self._layer.receive(_channel(self.own))
            except Exception as problem:
                log.error("No message comes from other servers: %r", problem)
                with contextlib.suppress(Exception):
                    await self._layer.flush()  # it would not subscribe again by itself
                await asyncio.sleep(PAUSE_S)
                continue
            kind, sender = message.pop("type", ""), message.pop("from", "")
            if not self._is_new(sender, message.pop("for", ""), message.pop("sent", 0)):
                log.error("A message of another server came again: who writes to its Redis?")
            elif kind == "echo":
                self.echoed_s = time.monotonic()
            elif kind in (RECEIVED, ANSWER):
                waiting = self._questions.get(message.pop("to", 0))
                if waiting is not None:
                    waiting.put_nowait({**message, "type": kind})
            elif kind in self._handlers:
                self._start(self._handle(kind, sender, message))

    def _is_new(self, sender: str, server: str, number: int) -> bool:
        """Return whether a message is for this server and did not come before."""
        is_new = server == self.own and number > self._latest.get(sender, 0)
        if is_new:
            self._latest[sender] = number
        return is_new

    async def _handle(self, kind: str, sender: str, data: Data) -> None:
        question = data.pop("question", None)
        if question is not None:
            self.send(sender, RECEIVED, {"to": question})
        try:
            answer = await self._handlers[kind](sender, data)
        except Exception:
            log.exception("A message of another server (%s) failed", kind)
            answer = {"problem": "not_stored", "message": "The server failed. Try again."}
        if question is not None:
            self.send(sender, ANSWER, {"to": question, **(answer or {})})


def _channel(server: str) -> str:
    return f"garry.server.{server}"
