"""Publishes committed events: a ring buffer for each session, a pump for each subscriber.

Nothing that a subscriber does or fails to do holds up the session or other subscribers. A slow one
gets fewer and larger frames; one that confirms nothing is disconnected. An event is retained
until the slowest has it; the ring bounds the memory.
"""

from __future__ import annotations

import asyncio
import math
from collections import deque
from collections.abc import Awaitable, Callable, Iterator
from contextlib import contextmanager
from operator import attrgetter

from rehab.sessions.events.event import LiveEvent
from rehab.sessions.live.protocol.outgoing import Outgoing
from rehab.training.controls import Audience

RING = 512  # events a session; at two steps a second four minutes
MAX_UNCONFIRMED = 32  # frames that may be on their way to a page
MAX_UNCONFIRMED_BACKLOG = 4  # of these, frames of past steps
CONFIRM_TIMEOUT_S = 15.0  # how long a page may take to confirm one
INATTENTIVE_S = 5.0  # a page that confirms nothing for so long is not watched
_POSITION = attrgetter("position")


class Lagged(Exception):
    """A subscriber missed more events than the ring holds; it needs a new snapshot."""


class Stalled(Exception):
    """A subscriber does not confirm frames any more."""


class EventFeed:
    """A session's latest events and their subscribers."""

    def __init__(self) -> None:
        self.head = 0  # how many events there have ever been
        self.subscribers: set[Subscriber] = set()
        self._ring: deque[LiveEvent] = deque(maxlen=RING)

    @property
    def audiences(self) -> set[Audience]:
        """Who gets events."""
        return {one.audience for one in self.subscribers}

    def publish(self, event: LiveEvent) -> None:
        """Add a committed event and wake the subscribers."""
        self.head += 1
        if not self.subscribers:
            self._ring.clear()
            return
        self._ring.append(event)
        for subscriber in self.subscribers:
            subscriber.wake()

    def trim(self) -> None:
        """Forget the events that every subscriber has been sent."""
        slowest = min(map(_POSITION, self.subscribers), default=self.head)
        while len(self._ring) > self.head - slowest:
            self._ring.popleft()

    def events_after(self, position: int) -> list[LiveEvent]:
        """Return the events after a position. Raises Lagged if the ring has lost some."""
        missing = self.head - position
        if missing > len(self._ring):
            raise Lagged
        if missing == 1:
            return [self._ring[-1]]
        return list(self._ring)[len(self._ring) - missing :]


class Subscriber(Outgoing):
    """One page or robot: gets the events it has not had, as fast as it confirms them.

    Its ``pump`` raises Lagged or Stalled if the subscriber must start again.
    """

    def __init__(
        self,
        feed: EventFeed,
        audience: Audience,
        send: Callable[[str], Awaitable[None]],
        write: Callable[[str], bool] = lambda _: False,
    ) -> None:
        super().__init__(send, write)
        self.feed = feed
        self.audience = audience
        self.frame = 0
        self._confirmed_frame = 0
        self.position = feed.head
        self._unconfirmed_since_s = 0.0  # when the oldest unconfirmed frame was sent
        self._sent_s = -math.inf  # when the last frame was
        self._heartbeat: str | None = None
        self._confirmed = asyncio.Event()

    def queue_heartbeat(self, text: str) -> None:
        """Queue a heartbeat, which is sent before anything else."""
        self._heartbeat = text
        self.wake()

    def confirm(self, frame: int) -> None:
        """Note that the page has processed the frames up to this one."""
        if self._confirmed_frame < frame <= self.frame:
            self._confirmed_frame = frame
            self._unconfirmed_since_s = self._loop.time()
            self._confirmed.set()

    def was_sent_something(self, within_s: float) -> bool:
        """Whether a frame went out lately: it is a sign of life, too."""
        return self._loop.time() - self._sent_s < within_s

    @property
    def is_attentive(self) -> bool:
        """Whether the page processes what it is sent."""
        waited_s = self._loop.time() - self._unconfirmed_since_s
        return self._confirmed_frame == self.frame or waited_s < INATTENTIVE_S

    async def send_frame(self, kind: str, texts: list[str]) -> None:
        """Send texts as one numbered frame."""
        self._count_frame()
        await self._send(_to_frame(kind, self.frame, texts))

    def _count_frame(self) -> None:
        self._sent_s = self._loop.time()
        if self._confirmed_frame == self.frame:
            self._unconfirmed_since_s = self._sent_s
        self.frame += 1

    async def send_backlog(self, texts: list[str]) -> None:
        """Send past steps as a frame, once the page has confirmed most of the frames before.

        Raises Stalled if it confirms none in time.
        """
        while self.frame - self._confirmed_frame >= MAX_UNCONFIRMED_BACKLOG:
            await self._wait_for_confirmation()
        await self.send_frame("steps", texts)

    async def _send_all(self) -> None:
        if self._heartbeat is not None:
            heartbeat, self._heartbeat = self._heartbeat, None
            await self._send(heartbeat)
        while self.position < self.feed.head:
            if self._must_wait:
                await self._wait_for_confirmation()
            await self._send_pending()

    @property
    def _must_wait(self) -> bool:
        """Whether too many frames are on their way; robots confirm none."""
        unconfirmed = self.frame - self._confirmed_frame
        return unconfirmed >= MAX_UNCONFIRMED and self.audience is not Audience.ROBOT

    def _write_pending(self) -> bool:
        if self._heartbeat is not None:
            if not self._write(self._heartbeat):
                return False
            self._heartbeat = None
        if self.position == self.feed.head:
            return True
        if self._must_wait:
            return False
        events, head = self.feed.events_after(self.position), self.feed.head
        texts = self._to_texts(events)
        if self.audience is Audience.ROBOT:
            if len(texts) > 1 or not all(map(self._write, texts)):
                return False  # several could be written in part
        elif texts:
            if not self._write(_to_frame("events", self.frame + 1, texts)):
                return False
            self._count_frame()
        self.position = head
        self.feed.trim()
        return True

    def _to_texts(self, events: list[LiveEvent]) -> list[str]:
        return [text for event in events if (text := event.text(self.audience)) is not None]

    async def _send_pending(self) -> None:
        events = self.feed.events_after(self.position)
        self.position = self.feed.head
        self.feed.trim()
        texts = self._to_texts(events)
        if self.audience is Audience.ROBOT:
            for text in texts:
                await self._send(text)
        elif texts:
            await self.send_frame("events", texts)

    async def _wait_for_confirmation(self) -> None:
        self._confirmed.clear()
        try:
            async with asyncio.timeout(CONFIRM_TIMEOUT_S):
                await self._confirmed.wait()
        except TimeoutError:
            raise Stalled from None


class SubscriptionGate:
    """Holds steps and changes back while a page or robot subscribes.

    Those that wait pass in the order in which they came.
    """

    def __init__(self) -> None:
        self._subscribing = 0
        self._is_idle = asyncio.Event()
        self._turn = asyncio.Lock()  # first come, first served
        self._waiting = 0  # for their turn

    @property
    def is_open(self) -> bool:
        """Whether no subscription is under way, and nothing waits for one."""
        return not (self._subscribing or self._waiting)

    @contextmanager
    def closed(self) -> Iterator[None]:
        """Close the gate for this block."""
        self._subscribing += 1
        self._is_idle.clear()
        try:
            yield
        finally:
            self._subscribing -= 1
            if not self._subscribing:
                self._is_idle.set()

    async def wait(self) -> None:
        """Wait while it is closed; to be called before recording steps or changes."""
        if self.is_open:
            return
        self._waiting += 1
        try:
            async with self._turn:
                while self._subscribing:
                    await self._is_idle.wait()
        finally:
            self._waiting -= 1


def _to_frame(kind: str, number: int, texts: list[str]) -> str:
    return f'{{"type":"{kind}","frame":{number},"{kind}":[{",".join(texts)}]}}'
