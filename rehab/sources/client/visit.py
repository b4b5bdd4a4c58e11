"""A source's part in the sessions of a station, as the server tells it: no sockets, no waiting."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from rehab.sources.client.live import LiveFeed
from rehab.sources.client.outbox import Outbox
from rehab.sources.client.player import Player
from rehab.training.changes import ENDED as ENDED_STATES
from rehab.training.changes import State
from rehab.training.measures import InvalidSetting
from rehab.training.phases import Phase, make_phase
from rehab.training.steps import Side
from robot.link import LinkRefused, Message
from robot.wire.close_codes import CloseCode


class Visit:
    """Has the player walk and the outbox send as the session wants it.

    Parameters
    ----------
    player
        Walks while the session runs.
    outbox
        Keeps the strides that the server may not have.
    stay
        Whether to go on with the station's later sessions.
    on_ack
        Called with session and number of each ack.
    notice
        Called with what somebody who looks on should know.

    Attributes
    ----------
    state, goal, unit
        Of the session, as it was told last.
    is_welcome
        Whether the server has answered on this connection.
    is_over
        Whether there is nothing more to come.
    acknowledged, lost
        How many strides are stored, and how many their session ended without.
    """

    def __init__(
        self,
        player: Player | LiveFeed,
        outbox: Outbox,
        *,
        stay: bool,
        on_ack: Callable[[int, int], None],
        notice: Callable[[str], None],
    ) -> None:
        self.state: str | None = None
        self.goal: float | None = None
        self.unit = ""
        self.is_welcome = self.is_over = False
        self.acknowledged = self.lost = 0
        self._player, self._outbox = player, outbox
        self._stay, self._on_ack, self._notice = stay, on_ack, notice

    @property
    def may_send(self) -> bool:
        """Whether the server would take the next stride."""
        if not self.is_welcome or not self._outbox.has_more:
            return False
        # What was walked before a pause waits for its end: a paused session would not count it.
        during_pause = self.state == State.PAUSED and self._outbox.next_is_paused
        return self.state == State.RUNNING or during_pause

    @property
    def is_done(self) -> bool:
        """Whether the strides are over and stored, or the session is."""
        has_walked = self._outbox.session is not None and self._player.is_over
        all_stored = has_walked and not self._outbox.unacknowledged
        return self.is_over or (all_stored and not self._stay)

    def take(self, message: Message) -> None:
        """Follow what the server says. Raises LinkRefused where that is not the protocol."""
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
                self.leave()
            case "goal":
                self.goal = _read_goal(message)
            case "phase":
                self._player.phase = self._read_phase(message)
            case "error":
                self._notice(str(message.get("message", "The server reports an error.")))
                if message.get("code") == "not_running" and self.state == State.RUNNING:
                    self._outbox.rewind()
                    self._enter(State.READY)

    def _join(self, message: Message) -> None:
        self.is_welcome = True
        session = message.get("session")
        is_open = session is not None and message.get("state") not in ENDED_STATES
        if self._outbox.session is not None and not (is_open and session == self._outbox.session):
            self.leave()  # it ended while the server was out of reach
        if self.is_over:
            return
        if not is_open:
            self._notice("No session is open at this station. Waiting for one.")
            return
        is_new = session != self._outbox.session
        self._outbox.join(_read(message, "session", int), _read(message, "next", int))
        self.goal = _read_goal(message)
        self.unit = str(message.get("unit", ""))
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
        if state != self.state:
            self._notice(f"Session {self._outbox.session} is {state}.")
        self.state = state
        if state == State.RUNNING:
            self._player.walk()
        else:
            self._player.stand()

    def leave(self) -> None:
        """Let a session go that has ended, with the strides that it does not have."""
        session, lost = self._outbox.session, self._outbox.leave()
        self.state = None
        self._player.end()
        self.lost += lost
        self.is_over = not self._stay
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
        CloseCode.NOT_PROTOCOL,
        f"The server sent a {str(message['type'])[:40]!r} that this client does not understand. "
        "Use the version that fits the server.",
    )
