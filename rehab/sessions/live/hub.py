"""From committed events to screens: a ring for each session, a pump for each viewer.

Nothing that a viewer does or fails to do holds up the session or another viewer. A slow one gets
fewer and larger frames; one that confirms nothing is let go. Memory is bounded by the ring.
"""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Awaitable, Callable

from rehab.sessions.events import LiveEvent
from rehab.training.controls import Audience

RING = 512  # events a session; at two steps a second four minutes
MAX_UNSEEN = 32  # frames that may be on their way to a page
MAX_UNSEEN_PAST = 4  # of these, frames of past steps: whoever reads faster is fed faster
UNSEEN_S = 15.0  # how long a page may take to confirm one
ABSENT_S = 5.0  # after so long nobody can be said to look at it


class Lagged(Exception):
    """A viewer missed more than the ring holds; it needs a new snapshot."""


class Unseen(Exception):
    """A viewer confirms nothing any more."""


class Channel:
    """A session's latest events, and who listens to them."""

    def __init__(self) -> None:
        self.head = 0  # how many events there have ever been
        self.viewers: set[Viewer] = set()
        self._ring: deque[LiveEvent] = deque(maxlen=RING)

    def publish(self, event: LiveEvent) -> None:
        """Add a committed event and wake the viewers."""
        self._ring.append(event)
        self.head += 1
        for viewer in self.viewers:
            viewer.wake()

    def since(self, position: int) -> list[LiveEvent]:
        """Give the events after a position. Raises Lagged where some are gone."""
        missing = self.head - position
        if missing > len(self._ring):
            raise Lagged
        if missing == 1:
            return [self._ring[-1]]
        return list(self._ring)[len(self._ring) - missing :]


class Viewer:
    """One page or robot: sends what it has not had, as fast as it confirms."""

    def __init__(
        self, channel: Channel, audience: Audience, send: Callable[[str], Awaitable[None]]
    ) -> None:
        self.channel = channel
        self.audience = audience
        self.frame = 0
        self._send = send
        self._seen = 0
        self._position = channel.head
        self._waiting_s = 0.0  # since when frames have been unconfirmed
        self._beat: str | None = None
        self._awake = asyncio.Event()
        self._confirmed = asyncio.Event()

    def wake(self) -> None:
        """Say that there is something to send."""
        self._awake.set()

    def beat(self, text: str) -> None:
        """Send a sign of life before anything else."""
        self._beat = text
        self._awake.set()

    def seen(self, frame: int) -> None:
        """Note that the page has dealt with frames up to this one."""
        if self._seen < frame <= self.frame:
            self._seen, self._waiting_s = frame, asyncio.get_running_loop().time()
            self._confirmed.set()

    @property
    def is_attentive(self) -> bool:
        """Whether the page deals with what it is sent."""
        waited_s = asyncio.get_running_loop().time() - self._waiting_s
        return self._seen == self.frame or waited_s < ABSENT_S

    async def send_frame(self, kind: str, texts: list[str]) -> None:
        """Send texts as one numbered frame."""
        if self._seen == self.frame:
            self._waiting_s = asyncio.get_running_loop().time()
        self.frame += 1
        await self._send(f'{{"type":"{kind}","frame":{self.frame},"{kind}":[{",".join(texts)}]}}')

    async def send_past(self, texts: list[str]) -> None:
        """Send past steps as a frame, once the page has dealt with most of those before.

        Raises Unseen where it confirms nothing.
        """
        while self.frame - self._seen >= MAX_UNSEEN_PAST:
            await self._wait_until_seen()
        await self.send_frame("steps", texts)

    async def pump(self) -> None:
        """Send until cancelled. Raises Lagged or Unseen where the viewer must begin anew."""
        while True:
            await self._awake.wait()
            self._awake.clear()
            if self._beat is not None:
                beat, self._beat = self._beat, None
                await self._send(beat)
            while self._position < self.channel.head:
                if self.audience is not Audience.ROBOT and self.frame - self._seen >= MAX_UNSEEN:
                    await self._wait_until_seen()
                await self._send_pending()

    async def _send_pending(self) -> None:
        events = self.channel.since(self._position)
        self._position = self.channel.head
        texts = [text for event in events if (text := event.text(self.audience)) is not None]
        if self.audience is Audience.ROBOT:
            for text in texts:
                await self._send(text)
        elif texts:
            await self.send_frame("events", texts)

    async def _wait_until_seen(self) -> None:
        self._confirmed.clear()
        try:
            await asyncio.wait_for(self._confirmed.wait(), UNSEEN_S)
        except TimeoutError:
            raise Unseen from None
