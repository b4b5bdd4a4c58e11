"""The socket of a source: steps in, acks out."""

from __future__ import annotations

import time
from datetime import UTC, datetime

from django.utils import timezone

from rehab.sessions.events.event import source_goal_event
from rehab.sessions.live.consumers.base import CloseSocket
from rehab.sessions.live.consumers.device import DeviceSocket
from rehab.sessions.live.protocol.messages import (
    Hello,
    read_clock,
    read_contact,
    read_hello,
    read_plain,
    read_sensor,
)
from rehab.sessions.live.protocol.resent_steps import check_same
from rehab.sessions.live.protocol.step_frames import read_single_step, read_steps
from rehab.sessions.live.session.delayed_steps import SourceClock
from rehab.sessions.live.session.live_session import LiveSession
from rehab.sessions.state_messages import Message, describe_source_phase
from rehab.stations.models import Device
from rehab.training.changes import ENDED_STATES, State
from rehab.training.measures import InvalidSetting, check_worn
from rehab.training.steps import Measurement, Side
from robot.wire.close_codes import CloseCode
from robot.wire.frames import BadFrame
from robot.wire.limits import MAX_STEPS

STEPPING = {State.RUNNING, State.PAUSED}  # states that take steps
OUR_CLOCK_S = time.time() - time.monotonic()  # Unix time, which steps of the wall clock leave alone
PLAIN_HELLO = Hello(run="text", last=0, session=None, clock_s=None, speed=1.0)


class SourceConsumer(DeviceSocket):
    """Receives the steps of one source."""

    kind = Device.Kind.SOURCE
    slot = "source"
    clock: SourceClock
    side: Side | None = None  # of a worn sensor
    plain_s: float | None = None  # plain text's time when our clock shows 0

    async def on_frame(self, text: str | None) -> None:
        """Handle a frame of the protocol, or with the original's plain text."""
        if text is not None and self.device is not None and (plain := read_plain(text)):
            await self._handle_plain(*plain)
        else:
            await super().on_frame(text)

    def handle_now(self, text: str) -> bool:
        """Record the next step, as most frames bring it; all else takes its turn."""
        live = self.live
        if live is None or not self.hello_received or not live.gate.is_open or self._is_companion:
            return False
        step = read_single_step(text)
        if step is None or step.number != live.next_number:
            return False
        if live.aggregate.fold.state not in STEPPING:
            return False
        self._record(live, step, datetime.now(UTC), is_marked=False)
        return True

    def _record(
        self, live: LiveSession, step: Measurement, received_at: datetime, *, is_marked: bool
    ) -> None:
        _check_open_steps(live)
        _check_worn(step, live)
        # What a source calls late is no measure of its clock, which may be another one by now.
        late = is_marked or self.clock.is_late(step.time_s, time.monotonic())
        plays = self.simulated or bool(live.source_state and live.source_state.plays)
        if plays and not live.is_simulated and live.next_number > 1:
            raise BadFrame(
                "A person has walked in this session, and a simulated source cannot go on with it. "
                "Begin another session for it.",
                "simulated",
            )
        live.record_step(step, received_at, late=late, simulated=plays)

    async def on_message(self, message: Message, text: str) -> None:
        """Handle hello and steps."""
        kind = message.get("type")
        if kind == "hello":
            await self._handle_hello(read_hello(message))
        elif kind in ("step", "steps"):
            await self._handle_steps(read_steps(message))
        elif kind == "clock":
            asked_s, now_s = read_clock(message), OUR_CLOCK_S + time.monotonic()
            await self.send_message({"type": "clock", "asked_s": asked_s, "at_s": now_s})
        elif kind == "sensor":
            self._note_sensor(message)
        elif kind == "contact":
            contact = read_contact(message)
            if self._is_companion and self.live is not None and self.live.source is not None:
                answer = {"type": "contact", "at_s": contact.at_s, "error_s": contact.error_s}
                self.live.source.outbox.queue(answer)
        elif kind is not None or "token" not in message:
            raise BadFrame('A source sends "hello", "step", "steps", "sensor", "clock", "contact".')

    @property
    def _is_companion(self) -> bool:
        """Whether it is worn on the leg that is not trained, and brings contacts alone."""
        return self.slot == "companion"

    def choose_slot(self, live: LiveSession) -> str:
        """Return "companion" for a sensor on the leg that is not trained."""
        is_other = self.side is not None and self.side != live.aggregate.fold.plan.trained_side
        return "companion" if is_other else "source"

    def _note_sensor(self, message: Message) -> None:
        state, live = read_sensor(message), self.live
        if live is None:
            return
        if self._is_companion:
            live.companion_state = state
        else:
            live.source_state = state
        live.announce_presence(timezone.now())

    async def _handle_hello(self, hello: Hello) -> None:
        self.side, self.plugin, self.simulated = hello.side, hello.plugin, hello.simulated
        self.clock = SourceClock(
            hello.run,
            time.monotonic(),
            hello.clock_s,
            hello.speed,
            clock_pauses=hello.clock_pauses,
        )
        await self.join_station(hello.session)

    async def on_attach(self, live: LiveSession) -> None:
        """Send the session's state and the number of the next step."""
        fold = live.aggregate.fold
        if self._is_companion:
            state = {"state": fold.state.value, "next": 1, "is_companion": True}
            await self.send_message({"type": "welcome", "session": live.id, **state})
            return
        # A clock that pauses and is not in hello stands: what was known of it is out of date.
        is_unknown = not (self.clock.is_known or self.clock.clock_pauses)
        clock = live.source_clock
        if is_unknown and clock is not None and clock.run == self.clock.run:
            self.clock = clock
        live.source_clock = self.clock
        live.source_state = None  # a sensor says so again
        await self.send_message(
            {
                "type": "welcome",
                "session": live.id,
                "state": fold.state.value,
                "next": live.next_number,
                "goal": fold.goal,
                "trained_side": fold.plan.trained_side,
                "measure": fold.plan.measure.slug,
                "unit": fold.plan.measure.unit,
                "phase": describe_source_phase(fold),
            }
        )
        if live.committed:
            self.outbox.acknowledge(live.committed)

    async def _handle_steps(self, steps: list[tuple[Measurement, bool]]) -> None:
        if not self.hello_received:
            raise BadFrame("Send hello first.", "no_hello")
        live = self.live
        if self._is_companion:
            raise BadFrame("A sensor on the other leg sends contacts, no steps.", "other_leg")
        if live is None:
            await self._send_error(
                "no_session", "This station has no open session. Wait for welcome."
            )
            return
        await live.gate.wait()
        received_at = timezone.now()
        for measurement, is_marked in steps:
            if measurement.number < live.next_number:
                if measurement.number > live.committed:
                    await live.wait_until_committed()
                plan = live.aggregate.fold.plan
                await check_same(live.id, measurement, plan.measure, live.next_number)
                self.outbox.acknowledge(live.committed)
            elif measurement.number > live.next_number:
                raise BadFrame(
                    f"Step {measurement.number} leaves a gap: send {live.next_number} next.", "gap"
                )
            elif live.aggregate.fold.state in ENDED_STATES:
                raise CloseSocket(
                    CloseCode.ENDED, "ended", "The session has ended; it accepts no more steps."
                )
            elif live.aggregate.fold.state is State.READY:
                await self._send_error(
                    "not_running", "The session has not started. Wait for start."
                )
                return
            else:
                self._record(live, measurement, received_at, is_marked=is_marked)

    async def _handle_plain(self, value: float | None, goal: float | None) -> None:
        """Record a plain-text step: the server numbers and times it; the PT's goal counts."""
        if not self.hello_received:
            await self._handle_hello(PLAIN_HELLO)
        live = self.live
        if live is not None:
            await live.gate.wait()
        if live is None or live.aggregate.fold.state in (State.READY, *ENDED_STATES):
            await self._send_error("not_running", "No session is running at this station.")
            return
        fold = live.aggregate.fold
        if goal is not None and goal != fold.goal:
            live.feed.publish(source_goal_event(fold, goal))
        _check_open_steps(live)
        side = Side(fold.plan.trained_side)
        time_s = self._time_plain(fold.last_time_s)
        live.record_step(Measurement(live.next_number, time_s, side, value), timezone.now())

    def _time_plain(self, last_s: float | None) -> float:
        """Return a plain-text step's time: Unix time at the first one, then a monotonic clock.

        Never before the last step of the log, which another run of the server or another source
        may have timed: phases, windows and rest continue from there.
        """
        now_s = time.monotonic()
        if self.plain_s is None:
            self.plain_s = time.time() - now_s
        if last_s is not None:
            self.plain_s = max(self.plain_s, last_s - now_s)
        return self.plain_s + now_s

    async def _send_error(self, code: str, message: str) -> None:
        await self.send_message({"type": "error", "code": code, "message": message})


def _check_open_steps(live: LiveSession) -> None:
    """Check that a source waits for its steps to be stored. Raises CloseSocket."""
    if live.next_number - live.committed > MAX_STEPS:
        raise CloseSocket(
            CloseCode.TOO_MANY,
            "flood",
            f"Wait for acks: at most {MAX_STEPS} steps may be unacknowledged.",
        )


def _check_worn(step: Measurement, live: LiveSession) -> None:
    """Refuse a worn sensor's stride in a session of another measure. Raises BadFrame."""
    try:
        check_worn(step.extra, live.aggregate.fold.plan.measure)
    except InvalidSetting as problem:
        raise BadFrame(str(problem), "not_measured") from None
