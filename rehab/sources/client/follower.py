"""Follows the sessions of a station as the server reports them: no sockets, no waiting."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from rehab.sources.client.live import LiveFeed
from rehab.sources.client.playback import StridePlayback
from rehab.sources.client.step_queue import StepQueue
from rehab.training.changes import ENDED_STATES, State
from rehab.training.measures import InvalidSetting
from rehab.training.phases import Phase, make_phase
from rehab.training.steps import Side
from robot.link import LinkRefused, Message
from robot.wire.close_codes import CloseCode


class SessionFollower:
    """Lets the feed play and the queue send as the session requires.

    Parameters
    ----------
    feed
        Plays while the session runs.
    queue
        Keeps the strides that the server may not have stored.
    stay
        Whether to go on with the station's later sessions.
    on_ack
        Called with session and number of each acknowledgment.
    notify
        Called with lines for the person who runs the source.

    Attributes
    ----------
    state, goal, unit
        Of the session, as last reported.
    is_welcome
        Whether the server has sent its welcome on this connection.
    is_over
        Whether nothing more will come.
    acknowledged, lost
        How many strides are stored, and how many were not when their session ended.
    """

    def __init__(
        self,
        feed: StridePlayback | LiveFeed,
        queue: StepQueue,
        *,
        stay: bool,
        on_ack: Callable[[int, int], None],
        notify: Callable[[str], None],
    ) -> None:
        self.state: str | None = None
        self.goal: float | None = None
        self.unit = ""
        self.is_welcome = self.is_over = False
        self.acknowledged = self.lost = 0
        self._feed, self._queue = feed, queue
        self._stay, self._on_ack, self._notify = stay, on_ack, notify

    def restore(self) -> None:
        """Go on in the session that the queue's journal has, before the server is heard."""
        if self._queue.session is not None:
            self._feed.start_session(Side(self._queue.side), self._queue.last)
            self._enter(self._queue.state)

    @property
    def may_send(self) -> bool:
        """Whether the server accepts the next stride now."""
        if not self.is_welcome or not self._queue.can_send:
            return False
        # Strides from before a pause wait for its end: a paused session would not count them.
        during_pause = self.state == State.PAUSED and self._queue.next_is_paused
        return self.state == State.RUNNING or during_pause

    @property
    def walked(self) -> int | None:
        """The session whose strides are over and stored, None while there is none."""
        is_whole = self._feed.is_over and not self._queue.unacknowledged
        return self._queue.session if is_whole else None

    def handle(self, message: Message) -> None:
        """Handle a message of the server. Raises LinkRefused where it breaks the protocol."""
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
                self.goal = self._feed.goal = _read_goal(message)
            case "phase":
                self._feed.phase = self._read_phase(message)
            case "error":
                self._notify(str(message.get("message", "The server reports an error.")))
                if message.get("code") == "not_running" and self.state == State.RUNNING:
                    self._queue.rewind()
                    self._enter(State.READY)

    def _join(self, message: Message) -> None:
        self.is_welcome = True
        session = message.get("session")
        is_open = session is not None and message.get("state") not in ENDED_STATES
        if self._queue.session is not None and not (is_open and session == self._queue.session):
            self.leave()  # it ended while the server was out of reach
        if self.is_over:
            return
        if not is_open:
            self._notify("No session is open at this station. Waiting for one.")
            return
        is_new = session != self._queue.session
        side, next_number = _read_side(message), _read(message, "next", int)
        self.lost += self._queue.join(_read(message, "session", int), next_number, side)
        self.goal = self._feed.goal = _read_goal(message)
        self.unit = str(message.get("unit", ""))
        self._feed.measure = str(message.get("measure", self._feed.measure))
        self._feed.phase = self._read_phase(message)
        if is_new:
            self._feed.start_session(side, next_number - 1)
            self._notify(f"Joined session {self._queue.session}.")
        self._enter(_read(message, "state", str))

    def _enter(self, state: str) -> None:
        if self._queue.session is None:
            return
        if state != self.state:
            self._notify(f"Session {self._queue.session} is {state}.")
        self.state = state
        self._queue.note_state(state)
        if state == State.RUNNING:
            self._feed.resume()
        else:
            self._feed.pause()

    def leave(self) -> None:
        """Leave a session that has ended, and drop the strides that it does not have."""
        session, lost = self._queue.session, self._queue.leave()
        self.state = None
        self._feed.end_session()
        self.lost += lost
        self.is_over = not self._stay
        if session is not None:
            rest = f" without the last {lost} strides" if lost else ""
            self._notify(f"Session {session} has ended{rest}.")

    def _acknowledge(self, number: int) -> None:
        before = self._queue.unacknowledged
        self._queue.acknowledge(number)
        self.acknowledged += before - self._queue.unacknowledged
        if self._queue.session is not None:
            self._on_ack(self._queue.session, number)

    def _read_phase(self, message: Message) -> Phase:
        """Return the phase in a message; training where the server sends none."""
        phase = message.get("phase")
        if not isinstance(phase, dict):
            return make_phase("training")
        self._feed.valence = str(phase.get("valence", self._feed.valence))
        try:
            return make_phase(
                phase["kind"],
                str(phase.get("name", "")),
                feedback=phase.get("feedback"),
                gain=float(phase.get("gain", 1.0)),
            )
        except (InvalidSetting, KeyError, TypeError, ValueError) as problem:
            self._notify(f"The server announced a phase that is not known here ({problem}).")
            return self._feed.phase


def _read(message: Message, name: str, kind: type[Any]) -> Any:
    """Return a field of a message. Raises LinkRefused where it is missing or of another type."""
    value = message.get(name)
    if not isinstance(value, kind):
        raise _unknown_message(message)
    return value


def _read_side(message: Message) -> Side:
    """Return the leg that the session trains."""
    try:
        return Side(message.get("trained_side", Side.LEFT))
    except ValueError:
        raise _unknown_message(message) from None


def _read_goal(message: Message) -> float | None:
    """Return the goal; None where it is not known yet."""
    goal = message.get("goal")
    return goal if isinstance(goal, int | float) else None


def _unknown_message(message: Message) -> LinkRefused:
    return LinkRefused(
        CloseCode.NOT_PROTOCOL,
        f"The server sent a {str(message['type'])[:40]!r} that this client does not understand. "
        "Use the version that fits the server.",
    )
