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
    """Sends a robot its cue and the valid steps of feedback phases that are not late."""

    kind = Device.Kind.ROBOT
    slot = "robot"
    subscriber: Subscriber | None = None
    _pumping: asyncio.Task[None] | None = None

    async def on_message(self, message: Message, text: str) -> None:
        """Handle hello and reports."""
        match message.get("type"):
            case "hello":
                read_name(message, "base")
                await self.join_station(None)
            case "report":
                self._handle_report(message, text)
            case _:
                raise BadFrame('A robot sends "hello" and "report".')

    async def on_attach(self, live: LiveSession) -> None:
        """Send this session's events, and no more of the previous one's."""
        if self._pumping is not None:
            self._pumping.cancel()
        self._pumping = self.start(self._pump(live))

    async def _pump(self, live: LiveSession) -> None:
        """Send the cue and then steps. Steps that a robot missed are not sent again."""
        while self.live is live:
            _, subscriber = await live.subscribe(Audience.ROBOT, self.send, timezone.now())
            self.subscriber = subscriber
            fold = live.aggregate.fold
            cue, state = describe_cue(fold), fold.state.value
            stopped, watched = live.robot_stopped, live.is_watched
            welcome = {"type": "welcome", "session": live.id, "state": state, "cue": cue}
            welcome["valence"] = fold.valence.slug
            await self.send_message(welcome | {"stopped": stopped, "watched": watched})
            try:
                await subscriber.pump()
            except Lagged:
                continue
            finally:
                live.feed.subscribers.discard(subscriber)

    def _handle_report(self, message: Message, text: str) -> None:
        if len(text) > MAX_REPORT_CHARS:
            raise BadFrame(f'"report" is an object of at most {MAX_REPORT_CHARS} characters.')
        report = read_report(message)
        if self.live is None:
            return
        if report.get("kind") == "stop":  # a sensor or its button: a person has to check it
            for session in self.runtime.sessions_at_station_of(self.live):
                told = {"device": self.device_id, "reason": report["reason"]}
                session.stop_robot(None, timezone.now(), told)
        else:
            self.live.record_robot_report(report, timezone.now())

    def on_disconnect(self) -> None:
        """Unsubscribe, and free the session's slot."""
        if self.live is not None and self.subscriber is not None:
            self.live.feed.subscribers.discard(self.subscriber)
        super().on_disconnect()
