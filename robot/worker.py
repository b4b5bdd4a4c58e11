"""The live robot: receives the server's messages, drives the base, sends reports."""

from __future__ import annotations

import asyncio
import time
from collections import deque
from collections.abc import Awaitable, Callable, Coroutine
from typing import TYPE_CHECKING, Any

from robot.bases import BASES, BaseLost, MobileBase
from robot.behavior.control_loop import control_loop
from robot.behavior.performer import NO_LINK, Performer
from robot.black_box.capture import Capture
from robot.black_box.recorder import BlackBox, Incident
from robot.link import Link, LinkRefused, Message
from robot.motion.limits import DEFAULT_LIMITS, Limits
from robot.original_connection import OriginalTopics
from robot.wire.close_codes import CloseCode

if TYPE_CHECKING:  # it needs the extra `tag`
    from robot.homing.homing import Homing


class Worker:
    """Runs a base for the sessions of its station.

    Parameters
    ----------
    dial
        Returns the link, given ``greet`` and ``on_lost`` by name.
    base
        An open base.
    limits
        Speeds and accelerations of every gesture.
    originals
        Publishes on the original's topics; open.
    black_box
        Records; open.
    homing
        Drives it home by its tag; None where it has learned none.
    notice
        Called with lines for people who watch.
    monotonic, sleep
        Our clock [s], and how to wait by it.
    """

    def __init__(
        self,
        dial: Callable[..., Link],
        base: MobileBase,
        *,
        limits: Limits = DEFAULT_LIMITS,
        originals: OriginalTopics | None = None,
        black_box: BlackBox | None = None,
        homing: Homing | None = None,
        notice: Callable[[str], None] = lambda _text: None,
        monotonic: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], Awaitable[object]] = asyncio.sleep,
    ) -> None:
        self.performer = Performer(base, limits, homing=homing)
        self._link = dial(greet=self._greet, on_lost=self._handle_lost_link)
        self._base, self._originals, self._black_box = base, originals, black_box
        self._capture = Capture(black_box, self.performer, base)
        self._notice = notice
        self._monotonic = monotonic
        self._sleep = sleep
        self._reported = asyncio.Event()

    async def run(self) -> None:
        """Perform until cancelled. The base stands still afterwards, however it ends.

        Raises LinkRefused where the server refuses this robot, and BaseLost.
        """
        work: list[Coroutine[Any, Any, None]] = [self._listen(), self._drive(), self._report()]
        tasks = [asyncio.create_task(one) for one in work]
        try:
            done, _ = await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
            for task in done:
                task.result()
        except BaseLost:
            self._capture.record_loss("base_lost")
            raise
        finally:
            self._base.stop()
            for task in tasks:
                task.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)
            await self._link.close()

    def _greet(self) -> Message:
        hello: Message = {"type": "hello", "version": 1, "base": self._base.name}
        plugin = BASES.find_plugin(self._base.name)
        return hello if plugin is None else hello | {"plugin": plugin.describe()}

    def _handle_lost_link(self, reason: str, pause_s: float) -> None:
        self.performer.disconnect(NO_LINK)
        self._allow_originals()
        self._notice(f"{reason}; standing still, dialing in again in {pause_s:.1f} s.")

    async def _listen(self) -> None:
        while True:
            try:
                async for message in self._link:
                    self._handle_message(message)
                return
            except LinkRefused as refusal:
                # A server that has welcomed us and then breaks the protocol does not end the work.
                # Where it closed the connection over that, the link is lost like any other.
                if refusal.code != CloseCode.NOT_PROTOCOL or not self.performer.is_linked:
                    raise
                self.performer.count_bad_message(str(refusal))
                if not self._link.is_open:
                    await self._link.pause(str(refusal))

    def _handle_message(self, message: Message) -> None:
        was_linked, bad = self.performer.is_linked, self.performer.bad_messages
        decided = self.performer.decision
        self.performer.handle(message, self._monotonic())
        self._capture.record_message(message)
        if self._originals is not None:
            self._allow_originals()
            self._originals.handle_message(message)
            decision = self.performer.decision
            if decision is not None and decision is not decided:
                self._originals.publish_decision(
                    decision.above, self.performer.decider.cue.window_s
                )
        if self.performer.is_linked and not was_linked:
            self._notice(f"Joined session {message.get('session')}.")
        if self.performer.bad_messages > bad:
            self._notice(f"A message was not understood: {self.performer.last_bad_message}")
        self._reported.set()

    def _allow_originals(self) -> None:
        """Let the original's nodes act where our own robot may, and only there."""
        if self._originals is not None:
            self._originals.allow(self.performer.may_act)

    async def _drive(self) -> None:
        problem = topics_problem = box_problem = ""
        was_linked = False
        for pause_s in control_loop(self.performer, self._monotonic):
            self._capture.record_tick(self._monotonic())
            if was_linked and not self.performer.is_linked:
                # Messages that are still on their way would come too late.
                self._notice("The server is silent; standing still, dialing in again.")
                self._link.hang_up()
            self._allow_originals()
            if self.performer.reports or (
                self._black_box and (self._black_box.incidents or self._black_box.motion)
            ):
                self._reported.set()
            if problem != self._base.problem:
                problem = self._base.problem
                self._notice(problem or "The base answers.")
            if self._originals is not None and topics_problem != self._originals.problem:
                topics_problem = self._originals.problem
                self._notice(topics_problem or "The original's topics are published.")
            if self._black_box is not None and box_problem != self._black_box.problem:
                box_problem = self._black_box.problem
                self._notice(box_problem or "The black box records.")
            await self._sleep(pause_s)
            was_linked = self.performer.is_linked

    async def _report(self) -> None:
        reports = self.performer.reports
        while True:
            await self._reported.wait()
            self._reported.clear()
            while reports:
                report = reports[0]
                sent = await self._link.send({"type": "report", "report": report})
                # A gesture's end is reported once the link is back; an old status is dropped.
                if not sent and report["kind"] != "status":
                    break
                if reports and reports[0] is report:
                    reports.popleft()
            await self._send_incidents()

    async def _send_incidents(self) -> None:
        """Send each incident to the session that it is of; the others stay on this disk."""
        box = self._black_box
        for waiting in () if box is None else (box.incidents, box.motion):
            await self._send_recordings(waiting)

    async def _send_recordings(self, incidents: deque[Incident]) -> None:
        while incidents and self.performer.is_linked:
            incident = incidents[0]
            is_of_this = incident.session is not None and incident.session == self.performer.session
            if is_of_this and not await self._link.send(
                {
                    "type": "incident",
                    "session": incident.session,
                    "reason": incident.reason,
                    "ago_s": round(self._monotonic() - incident.at_s, 3),
                    "recording": incident.recording,
                }
            ):
                return
            if incidents and incidents[0] is incident:
                incidents.popleft()
