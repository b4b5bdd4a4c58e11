"""A source that dials in: walks while the session runs, sends strides until they are stored."""

from __future__ import annotations

import asyncio
import math
import secrets
from collections.abc import Awaitable, Callable
from typing import Any

from rehab.sources.client.live import LiveFeed
from rehab.sources.client.outbox import Outbox
from rehab.sources.client.player import Player
from rehab.sources.client.visit import Visit
from rehab.training.steps import Measurement
from robot.link import Link, LinkRefused, Message
from robot.wire.close_codes import CloseCode

# Before asking for the station's next session, where the last one's end closed the connection.
RETURN_S = 1.0


class SourceClient:
    """Plays strides into the sessions of a station.

    Parameters
    ----------
    dial
        Makes the link, given ``greet`` and ``on_lost`` by name.
    player
        Gives the strides: a ``Player`` walks them, a ``LiveFeed`` has them as they are measured.
    run
        Names this run of the source; otherwise chance does.
    session
        Which session to join; otherwise the station's open one.
    stay
        Whether to go on with the station's later sessions.
    on_ack
        Called with session and number of each ack.
    notice
        Called with what somebody who looks on should know.
    sleep
        How to wait [s].
    """

    def __init__(
        self,
        dial: Callable[..., Link],
        player: Player | LiveFeed,
        *,
        run: str = "",
        session: int | None = None,
        stay: bool = False,
        on_ack: Callable[[int, int], None] = lambda _session, _number: None,
        notice: Callable[[str], None] = lambda _text: None,
        sleep: Callable[[float], Awaitable[object]] = asyncio.sleep,
    ) -> None:
        self.run_id = run or secrets.token_hex(8)
        self._link = dial(greet=self._greet, on_lost=self._lose)
        self._wanted_session = session
        self._stay = stay
        self._notice = notice
        self._sleep = sleep
        self._player = player
        self._outbox = Outbox()
        self._visit = Visit(player, self._outbox, stay=stay, on_ack=on_ack, notice=notice)
        self._changed = asyncio.Event()
        if isinstance(player, LiveFeed):
            player.on_change = self._tell
        self._strides = self._unusable = 0

    @property
    def unacknowledged(self) -> int:
        """How many strides the server may not have."""
        return self._outbox.unacknowledged

    @property
    def acknowledged(self) -> int:
        """How many strides the server has stored."""
        return self._visit.acknowledged

    @property
    def lost(self) -> int:
        """How many strides their session ended without."""
        return self._visit.lost

    async def run(self) -> None:
        """Walk until the strides are over and acknowledged, or the session is.

        Raises LinkRefused where the server will not have this source, OutOfStep where it has lost
        steps and UnsendableStride for a stride that the protocol has no room for.
        """
        doing = [
            self._listen(),
            self._walk(),
            self._send(),
            self._until(lambda: self._visit.is_done),
        ]
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
        """Say in one line how it goes."""
        session, visit = self._outbox.session, self._visit
        if session is None:
            return "Waiting for a session." if visit.is_welcome else "Waiting for the server."
        share = self._unusable / self._strides if self._strides else 0.0
        goal = "" if visit.goal is None else f", goal {visit.goal:g} {visit.unit}".rstrip()
        away = "" if visit.is_welcome else ", server out of reach"
        return (
            f"Session {session} {visit.state}{away}: {self._strides} strides, "
            f"{self.unacknowledged} not acknowledged, {share:.0%} unusable{goal}"
        )

    # --- What the server hears first, and when it is gone ---

    def _greet(self) -> Message:
        hello: Message = {
            "type": "hello",
            "version": 1,
            "run": self.run_id,
            "last": self._outbox.last,
            "speed": self._player.speed,
        }
        if self._player.clock_s is not None:
            # A clock that stands would make all that comes after it look late.
            hello["clock_s"] = self._player.clock_s
        if self._wanted_session is not None:
            hello["session"] = self._wanted_session
        return hello

    def _lose(self, reason: str, pause_s: float) -> None:
        self._visit.is_welcome = False
        self._notice(f"{reason}; dialing in again in {pause_s:.1f} s.")

    # --- What the server says ---

    async def _listen(self) -> None:
        while True:
            try:
                async for message in self._link:
                    self._visit.take(message)
                    self._tell()
            except LinkRefused as refusal:
                if refusal.code != CloseCode.ENDED or self._outbox.session is None:
                    raise
                # Somebody finished the session while steps were on their way.
                self._visit.is_welcome = False
                self._visit.leave()
                if not self._stay:
                    return
                await self._sleep(RETURN_S)
            else:
                return

    # --- What is walked and sent ---

    async def _walk(self) -> None:
        while True:
            due = self._player.poll(self._outbox.unacknowledged)
            if isinstance(due, Measurement):
                self._outbox.give(due)
                self._strides += 1
                self._unusable += due.value is None or bool(due.reasons)
                self._tell()
            else:
                if self._player.is_over:
                    self._tell()
                await self._wait(due)

    async def _send(self) -> None:
        while True:
            await self._until(lambda: self._visit.may_send)
            frame = self._outbox.take()
            if frame is not None:
                await self._link.send(frame)

    # --- Waiting ---

    def _tell(self) -> None:
        """Let everyone who waits look again."""
        # One event for each change: what was set stays set for those who have waited for it.
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
