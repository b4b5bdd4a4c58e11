"""The socket of a robot: its cue and the steps to answer, and what it reports."""

from __future__ import annotations

import asyncio

from django.utils import timezone

from rehab.sessions.live.consumers.device import DeviceSocket
from rehab.sessions.live.hub import Lagged, Subscriber
from rehab.sessions.live.messages import read_report
from rehab.sessions.live.session import LiveSession
from rehab.sessions.payloads import Message, describe_cue
from rehab.stations.models import Device
from rehab.training.controls import Audience
from robot.wire.frames import BadFrame, read_name
from robot.wire.limits import MAX_REPORT_CHARS


class RobotConsumer(DeviceSocket):
    """A robot hears fresh, valid steps of feedback phases only."""

    kind = Device.Kind.ROBOT
    slot = "robot"
    subscriber: Subscriber | None = None
    _pumping: asyncio.Task[None] | None = None

    async def asked(self, message: Message, text: str) -> None:
        """Deal with hello and reports."""
        match message.get("type"):
            case "hello":
                read_name(message, "base")
                await self.greet(None)
            case "report":
                self._heard_report(message, text)
            case _:
                raise BadFrame('A robot sends "hello" and "report".')

    async def attached(self, live: LiveSession) -> None:
        """Begin to send; nothing more of the session before."""
        if self._pumping is not None:
            self._pumping.cancel()
        self._pumping = self.start(self._pump(live))

    async def _pump(self, live: LiveSession) -> None:
        """Send the order and then steps. What a robot missed is past, and never made up for."""
        while self.live is live:
            _, subscriber = await live.join(Audience.ROBOT, self.send, timezone.now())
            self.subscriber = subscriber
            fold = live.actor.fold
            cue, state = describe_cue(fold), fold.state.value
            stopped, watched = live.robot_stopped, live.is_watched
            welcome = {"type": "welcome", "session": live.id, "state": state, "cue": cue}
            welcome["valence"] = fold.valence.slug
            await self.say(welcome | {"stopped": stopped, "watched": watched})
            try:
                await subscriber.pump()
            except Lagged:
                continue
            finally:
                live.feed.subscribers.discard(subscriber)

    def _heard_report(self, message: Message, text: str) -> None:
        if len(text) > MAX_REPORT_CHARS:
            raise BadFrame(f'"report" is an object of at most {MAX_REPORT_CHARS} characters.')
        report = read_report(message)
        if self.live is None:
            return
        if report.get("kind") == "stop":  # felt, or its button pressed: a person has to see to it
            for session in self.runtime.at_station_of(self.live):
                told = {"device": self.device_id, "reason": report["reason"]}
                session.stop_robot(None, timezone.now(), told)
        else:
            self.live.heard_robot(report, timezone.now())

    def left(self) -> None:
        """Stop listening, and free the session for another robot."""
        if self.live is not None and self.subscriber is not None:
            self.live.feed.subscribers.discard(self.subscriber)
        super().left()
