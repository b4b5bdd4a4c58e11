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
from rehab.training.changes import ENDED as ENDED_STATES
from rehab.training.changes import State
from rehab.training.measures import InvalidSetting
from rehab.training.phases import Phase, make_phase
from rehab.training.steps import Measurement, Side
from robot.link import ENDED, NOT_PROTOCOL, Link, LinkRefused, Message

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
        self.acknowledged = 0
        self.lost = 0  # strides that their session ended without
        self._link = dial(greet=self._greet, on_lost=self._lose)
        self._wanted_session = session
        self._stay = stay
        self._on_ack = on_ack
        self._notice = notice
        self._sleep = sleep
        self._player = player
        self._outbox = Outbox()
        self._changed = asyncio.Event()
        if isinstance(player, LiveFeed):
            player.on_change = self._tell

        self._state: str | None = None
        self._is_welcome = False  # on this connection
        self._is_over = False
        self._goal: float | None = None
        self._unit = ""
        self._strides = self._unusable = 0

    @property
    def unacknowledged(self) -> int:
        """How many strides the server may not have."""
        return self._outbox.unacknowledged

    async def run(self) -> None:
        """Walk until the strides are over and acknowledged, or the session is.

        Raises LinkRefused where the server will not have this source, OutOfStep where it has lost
        steps and UnsendableStride for a stride that the protocol has no room for.
        """
        doing = [self._listen(), self._walk(), self._send(), self._until(self._is_done)]
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
        session = self._outbox.session
        if session is None:
            return "Waiting for a session." if self._is_welcome else "Waiting for the server."
        share = self._unusable / self._strides if self._strides else 0.0
        goal = "" if self._goal is None else f", goal {self._goal:g} {self._unit}".rstrip()
        away = "" if self._is_welcome else ", server out of reach"
        return (
            f"Session {session} {self._state}{away}: {self._strides} strides, "
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
        self._is_welcome = False
        self._notice(f"{reason}; dialing in again in {pause_s:.1f} s.")

    # --- What the server says ---

    async def _listen(self) -> None:
        while True:
            try:
                async for message in self._link:
                    self._handle(message)
                    self._tell()
            except LinkRefused as refusal:
                if refusal.code != ENDED or self._outbox.session is None:
                    raise
                # Somebody finished the session while steps were on their way.
                self._is_welcome = False
                self._leave()
                if not self._stay:
                    return
                await self._sleep(RETURN_S)
            else:
                return

    def _handle(self, message: Message) -> None:
        match message["type"]:
            case "welcome":
                self._join(message)
            case "ack":
                self._acknowledge(_read(message, "number", int))
            case "start" | "resume":
                self._enter(State.RUNNING)
            case "pause":
                self._enter(State.PAUSED)
            case "stop":
                self._leave()
            case "goal":
                self._goal = _read_goal(message)
            case "phase":
                self._player.phase = self._read_phase(message)
            case "error":
                self._notice(str(message.get("message", "The server reports an error.")))
                if message.get("code") == "not_running" and self._state == State.RUNNING:
                    self._outbox.rewind()
                    self._enter(State.READY)

    def _join(self, message: Message) -> None:
        self._is_welcome = True
        session = message.get("session")
        is_open = session is not None and message.get("state") not in ENDED_STATES
        if self._outbox.session is not None and not (is_open and session == self._outbox.session):
            self._leave()  # it ended while the server was out of reach
        if self._is_over:
            return
        if not is_open:
            self._notice("No session is open at this station. Waiting for one.")
            return
        is_new = session != self._outbox.session
        self._outbox.join(_read(message, "session", int), _read(message, "next", int))
        self._goal = _read_goal(message)
        self._unit = str(message.get("unit", ""))
        self._player.phase = self._read_phase(message)
        if is_new:
            self._begin_walk(message)
        self._enter(_read(message, "state", str))

    def _begin_walk(self, message: Message) -> None:
        try:
            side = Side(message.get("trained_side", Side.LEFT))
        except ValueError:
            raise _misunderstood(message) from None
        self._player.begin(side, _read(message, "next", int) - 1)
        self._notice(f"Joined session {self._outbox.session}.")

    def _enter(self, state: str) -> None:
        if self._outbox.session is None:
            return
        if state != self._state:
            self._notice(f"Session {self._outbox.session} is {state}.")
        self._state = state
        if state == State.RUNNING:
            self._player.walk()
        else:
            self._player.stand()

    def _leave(self) -> None:
        session, lost = self._outbox.session, self._outbox.leave()
        self._state = None
        self._player.end()
        self.lost += lost
        self._is_over = not self._stay
        if session is not None:
            rest = f" without the last {lost} strides" if lost else ""
            self._notice(f"Session {session} has ended{rest}.")

    def _acknowledge(self, number: int) -> None:
        before = self._outbox.unacknowledged
        self._outbox.acknowledge(number)
        self.acknowledged += before - self._outbox.unacknowledged
        if self._outbox.session is not None:
            self._on_ack(self._outbox.session, number)

    def _read_phase(self, message: Message) -> Phase:
        """Give the phase that a message tells; a server that tells none is always training."""
        told = message.get("phase")
        if not isinstance(told, dict):
            return make_phase("training")
        try:
            return make_phase(
                told["kind"],
                str(told.get("name", "")),
                feedback=told.get("feedback"),
                gain=float(told.get("gain", 1.0)),
            )
        except (InvalidSetting, KeyError, TypeError, ValueError) as problem:
            self._notice(f"The server told a phase that is not known here ({problem}).")
            return self._player.phase

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
            await self._until(self._may_send)
            frame = self._outbox.take()
            if frame is not None:
                await self._link.send(frame)

    def _may_send(self) -> bool:
        if not self._is_welcome or not self._outbox.has_more:
            return False
        # What was walked before a pause waits for its end: a paused session would not count it.
        during_pause = self._state == State.PAUSED and self._outbox.next_is_paused
        return self._state == State.RUNNING or during_pause

    # --- Waiting ---

    def _is_done(self) -> bool:
        has_walked = self._outbox.session is not None and self._player.is_over
        all_stored = has_walked and not self._outbox.unacknowledged
        return self._is_over or (all_stored and not self._stay)

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


def _read(message: Message, name: str, kind: type[Any]) -> Any:
    """Give a field of a message. Raises LinkRefused where the server left it out."""
    value = message.get(name)
    if not isinstance(value, kind):
        raise _misunderstood(message)
    return value


def _read_goal(message: Message) -> float | None:
    """Give the goal; None where it is not known yet."""
    goal = message.get("goal")
    return goal if isinstance(goal, int | float) else None


def _misunderstood(message: Message) -> LinkRefused:
    return LinkRefused(
        NOT_PROTOCOL,
        f"The server sent a {str(message['type'])[:40]!r} that this client does not understand. "
        "Use the version that fits the server.",
    )
