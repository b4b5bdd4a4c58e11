"""A source's client: plays while the session runs, sends strides until they are stored."""

from __future__ import annotations

import asyncio
import math
import secrets
from collections.abc import Awaitable, Callable
from typing import Any

from rehab.sources.client.follower import SessionFollower
from rehab.sources.client.journal import Journal
from rehab.sources.client.live import LiveFeed
from rehab.sources.client.playback import UNSENT_MAX, StridePlayback
from rehab.sources.client.step_queue import StepQueue
from rehab.training.steps import Measurement
from robot.link import Link, LinkRefused, Message
from robot.plugins import Plugin
from robot.wire.close_codes import CloseCode

# Before asking for the station's next session, where the last one's end closed the connection.
RETURN_S = 1.0


class SourceClient:
    """Plays strides into the sessions of a station.

    Parameters
    ----------
    dial
        Returns the link, given ``greet`` and ``on_lost`` by name.
    feed
        Where the strides come from: a ``StridePlayback`` plays them, a ``LiveFeed`` has them as
        they are measured.
    run
        Name of this run of the source; random by default.
    session
        Which session to join; the station's open one by default.
    stay
        Whether to go on with the station's later sessions.
    journal
        Where a live source's strides are kept over the end of this program.
    on_ack
        Called with session and number of each acknowledgment.
    plugin
        Of which package the source is a part; None for GARRY's own.
    simulated
        Whether nobody walks.
    notify
        Called with lines for the person who runs the source.
    sleep
        How to wait [s].
    """

    def __init__(
        self,
        dial: Callable[..., Link],
        feed: StridePlayback | LiveFeed,
        *,
        run: str = "",
        session: int | None = None,
        stay: bool = False,
        journal: Journal | None = None,
        on_ack: Callable[[int, int], None] = lambda _session, _number: None,
        plugin: Plugin | None = None,
        simulated: bool = False,
        notify: Callable[[str], None] = lambda _text: None,
        sleep: Callable[[float], Awaitable[object]] = asyncio.sleep,
    ) -> None:
        self.run_id = run or secrets.token_hex(8)
        self._link = dial(greet=self._greet, on_lost=self._note_lost_link)
        self._wanted_session = session
        self._stay, self._plugin, self._is_simulated = stay, plugin, simulated
        self._notify = notify
        self._sleep = sleep
        self._feed = feed
        self._journal = journal
        self._queue = StepQueue(journal, marks_late=isinstance(feed, LiveFeed))
        self._follower = SessionFollower(feed, self._queue, stay=stay, on_ack=on_ack, notify=notify)
        self._changed = asyncio.Event()
        if isinstance(feed, LiveFeed):
            feed.on_change = self._wake_waiters
        self._follower.restore()
        self._strides = self._unusable = 0

    @property
    def unacknowledged(self) -> int:
        """How many strides the server may not have stored."""
        return self._queue.unacknowledged

    @property
    def acknowledged(self) -> int:
        """How many strides the server has stored."""
        return self._follower.acknowledged

    @property
    def lost(self) -> int:
        """How many strides were not stored when their session ended."""
        return self._follower.lost

    async def run(self) -> None:
        """Run until the strides are over and acknowledged, or the session is.

        Raises LinkRefused where the server refuses this source, StepsLost where it has lost steps
        and UnsendableStride for a stride that does not fit the protocol.
        """
        doing = [
            self._receive(),
            self._walk(),
            self._send(),
            self._finish(),
        ]
        if self._journal is not None:
            doing.append(self._sync(self._journal))
        tasks = [asyncio.create_task(work) for work in doing]
        try:
            done, _ = await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
            for task in done:
                task.result()
        finally:
            for task in tasks:
                task.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)
            await self._link.close()

    def describe(self) -> str:
        """Return the state of the client in one line."""
        session, follower = self._queue.session, self._follower
        if session is None:
            return "Waiting for a session." if follower.is_welcome else "Waiting for the server."
        share = self._unusable / self._strides if self._strides else 0.0
        goal = "" if follower.goal is None else f", goal {follower.goal:g} {follower.unit}".rstrip()
        away = "" if follower.is_welcome else ", server out of reach"
        return (
            f"Session {session} {follower.state}{away}: {self._strides} strides, "
            f"{self.unacknowledged} not acknowledged, {share:.0%} unusable{goal}{self._losses()}"
        )

    def _losses(self) -> str:
        """Return what of the strides is lost, or would be with this program."""
        refused = self._feed.refused if isinstance(self._feed, LiveFeed) else 0
        words = f"; {refused} strides LOST: {UNSENT_MAX} were waiting already" if refused else ""
        if self._journal is not None and self._journal.trouble:
            words += f"; the journal {self._journal.trouble}, the latest are in memory only"
        return words

    # --- Connecting ---

    def _greet(self) -> Message:
        hello: Message = {
            "type": "hello",
            "version": 1,
            "run": self.run_id,
            "last": self._queue.last,
            "speed": self._feed.speed,
            "clock_pauses": self._feed.clock_pauses,
        }
        if self._feed.clock_s is not None:
            # A stopped clock would make all later strides look late.
            hello["clock_s"] = self._feed.clock_s
        if self._wanted_session is not None:
            hello["session"] = self._wanted_session
        if self._plugin is not None:
            hello["plugin"] = self._plugin.describe()
        if self._is_simulated:
            hello["simulated"] = True
        return hello

    def _note_lost_link(self, reason: str, pause_s: float) -> None:
        self._follower.is_welcome = False
        self._notify(f"{reason}; dialing in again in {pause_s:.1f} s.")

    # --- Receiving ---

    async def _receive(self) -> None:
        while True:
            try:
                async for message in self._link:
                    self._follower.handle(message)
                    self._wake_waiters()
            except LinkRefused as refusal:
                if refusal.code != CloseCode.ENDED or self._queue.session is None:
                    raise
                # Somebody finished the session while steps were on their way.
                self._follower.is_welcome = False
                self._follower.leave()
                if not self._stay:
                    return
                await self._sleep(RETURN_S)
            else:
                return

    # --- Playing and sending ---

    async def _walk(self) -> None:
        while True:
            due = self._feed.poll(self._queue.unacknowledged)
            if isinstance(due, Measurement):
                self._queue.add(due)
                self._strides += 1
                self._unusable += due.value is None or bool(due.reasons)
                self._wake_waiters()
            else:
                if self._feed.is_over:
                    self._wake_waiters()
                await self._wait(due)

    async def _send(self) -> None:
        while True:
            await self._until(lambda: self._follower.may_send)
            frame = self._queue.next_frame()
            if frame is not None:
                await self._link.send(frame)

    async def _finish(self) -> None:
        """Tell the server of the end of each recording; return when nothing more will come."""
        follower = self._follower
        told: int | None = None
        while not follower.is_over:
            await self._until(lambda: follower.is_over or follower.walked not in {None, told})
            if told := follower.walked:
                if isinstance(self._feed, StridePlayback):
                    await self._link.send({"type": "sensor", "trouble": "ended"})
                if not self._stay:
                    return

    async def _sync(self, journal: Journal) -> None:
        while True:
            await self._until(lambda: journal.is_dirty)
            await asyncio.to_thread(journal.sync)

    # --- Waiting ---

    def _wake_waiters(self) -> None:
        """Wake everything that waits for a change."""
        # A new event for each change: the old one stays set for the tasks that wait for it.
        self._changed.set()
        self._changed = asyncio.Event()

    async def _until(self, condition: Callable[[], bool]) -> None:
        while not condition():
            await self._wait(math.inf)

    async def _wait(self, seconds: float) -> None:
        """Wait until something changes, but no longer than this."""
        waits: list[asyncio.Future[Any]] = [asyncio.ensure_future(self._changed.wait())]
        if seconds < math.inf:
            waits.append(asyncio.ensure_future(self._sleep(seconds)))
        try:
            await asyncio.wait(waits, return_when=asyncio.FIRST_COMPLETED)
        finally:
            for wait in waits:
                wait.cancel()
