"""Publishes committed events: a ring buffer for each session, a pump for each subscriber.

Nothing that a subscriber does or fails to do holds up the session or other subscribers. A slow one
gets fewer and larger frames; one that confirms nothing is let go. The ring bounds the memory.
"""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Awaitable, Callable

from rehab.sessions.events.event import LiveEvent
from rehab.training.controls import Audience

RING = 512  # events a session; at two steps a second four minutes
MAX_UNCONFIRMED = 32  # frames that may be on their way to a page
MAX_UNCONFIRMED_BACKLOG = 4  # of these, frames of past steps
CONFIRM_TIMEOUT_S = 15.0  # how long a page may take to confirm one
INATTENTIVE_S = 5.0  # a page that confirms nothing for so long is not watched


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

    def publish(self, event: LiveEvent) -> None:
        """Add a committed event and wake the subscribers."""
        self._ring.append(event)
        self.head += 1
        for subscriber in self.subscribers:
            subscriber.wake()

    def events_after(self, position: int) -> list[LiveEvent]:
        """Return the events after a position. Raises Lagged if the ring has lost some."""
        missing = self.head - position
        if missing > len(self._ring):
            raise Lagged
        if missing == 1:
            return [self._ring[-1]]
        return list(self._ring)[len(self._ring) - missing :]


class Subscriber:
    """One page or robot: gets the events it has not had, as fast as it confirms them."""

    def __init__(
        self, feed: EventFeed, audience: Audience, send: Callable[[str], Awaitable[None]]
    ) -> None:
        self.feed = feed
        self.audience = audience
        self.frame = 0
        self._send = send
        self._confirmed_frame = 0
        self._position = feed.head
        self._unconfirmed_since_s = 0.0  # when the oldest unconfirmed frame was sent
        self._heartbeat: str | None = None
        self._awake = asyncio.Event()
        self._confirmed = asyncio.Event()

    def wake(self) -> None:
        """Wake the pump: there is something to send."""
        self._awake.set()

    def queue_heartbeat(self, text: str) -> None:
        """Queue a heartbeat, which is sent before anything else."""
        self._heartbeat = text
        self._awake.set()

    def confirm(self, frame: int) -> None:
        """Note that the page has processed the frames up to this one."""
        if self._confirmed_frame < frame <= self.frame:
            self._confirmed_frame = frame
            self._unconfirmed_since_s = asyncio.get_running_loop().time()
            self._confirmed.set()

    @property
    def is_attentive(self) -> bool:
        """Whether the page processes what it is sent."""
        waited_s = asyncio.get_running_loop().time() - self._unconfirmed_since_s
        return self._confirmed_frame == self.frame or waited_s < INATTENTIVE_S

    async def send_frame(self, kind: str, texts: list[str]) -> None:
        """Send texts as one numbered frame."""
        if self._confirmed_frame == self.frame:
            self._unconfirmed_since_s = asyncio.get_running_loop().time()
        self.frame += 1
        await self._send(f'{{"type":"{kind}","frame":{self.frame},"{kind}":[{",".join(texts)}]}}')

    async def send_backlog(self, texts: list[str]) -> None:
        """Send past steps as a frame, once the page has confirmed most of the frames before.

        Raises Stalled if it confirms none in time.
        """
        while self.frame - self._confirmed_frame >= MAX_UNCONFIRMED_BACKLOG:
            await self._wait_for_confirmation()
        await self.send_frame("steps", texts)

    async def pump(self) -> None:
        """Send until cancelled. Raises Lagged or Stalled if the subscriber must start again."""
        while True:
            await self._awake.wait()
            self._awake.clear()
            if self._heartbeat is not None:
                heartbeat, self._heartbeat = self._heartbeat, None
                await self._send(heartbeat)
            while self._position < self.feed.head:
                unconfirmed = self.frame - self._confirmed_frame
                if self.audience is not Audience.ROBOT and unconfirmed >= MAX_UNCONFIRMED:
                    await self._wait_for_confirmation()
                await self._send_pending()

    async def _send_pending(self) -> None:
        events = self.feed.events_after(self._position)
        self._position = self.feed.head
        texts = [text for event in events if (text := event.text(self.audience)) is not None]
        if self.audience is Audience.ROBOT:
            for text in texts:
                await self._send(text)
        elif texts:
            await self.send_frame("events", texts)

    async def _wait_for_confirmation(self) -> None:
        self._confirmed.clear()
        try:
            await asyncio.wait_for(self._confirmed.wait(), CONFIRM_TIMEOUT_S)
        except TimeoutError:
            raise Stalled from None
