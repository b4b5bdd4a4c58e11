"""The socket of a robot: its cue and the steps to answer, and what it reports."""

from __future__ import annotations

import asyncio
import logging
from datetime import datetime, timedelta

from channels.db import database_sync_to_async
from django.db import DatabaseError
from django.utils import timezone

from rehab.sessions.alarms import UNASKED
from rehab.sessions.live.consumers.device import DeviceSocket
from rehab.sessions.live.protocol.fields import read_fields
from rehab.sessions.live.protocol.messages import (
    Incident,
    RobotHello,
    read_incident,
    read_report,
)
from rehab.sessions.live.session.live_session import LiveSession
from rehab.sessions.live.session.subscribers import Lagged, Subscriber
from rehab.sessions.robot_incidents import store_incident
from rehab.sessions.state_messages import Message, describe_cue
from rehab.stations.models import Device
from rehab.training.controls import Audience
from robot.wire.frames import BadFrame
from robot.wire.incident import MOTION

log = logging.getLogger(__name__)

MAX_REPORT_CHARS = 8 * 1024
# What a robot that is off may feel all the same, and a person has to look at.
FELT = frozenset({"bump", "cliff", "wheel_drop", "unordered_motion"})
INCIDENTS_WAITING = 4  # of one robot, for the disk


class RobotConsumer(DeviceSocket):
    """Sends a robot its cue and the valid steps of feedback phases that are not late."""

    kind = Device.Kind.ROBOT
    slot = "robot"
    subscriber: Subscriber | None = None
    _pumping: asyncio.Task[None] | None = None
    _incidents_waiting = 0

    async def on_message(self, message: Message, text: str) -> None:
        """Handle hello and reports."""
        match message.get("type"):
            case "hello":
                self.plugin = read_fields(message, RobotHello).plugin
                await self.join_station(None)
            case "report":
                self._handle_report(message, text)
            case "incident":
                self._queue_incident(read_incident(message))
            case _:
                raise BadFrame('A robot sends "hello", "report" and "incident".')

    def takes_part(self, live: LiveSession) -> bool:
        """Return whether the session's plan has a part for it."""
        return live.aggregate.fold.plan.has_robot

    async def on_attach(self, live: LiveSession) -> None:
        """Send this session's events, and no more of the previous one's."""
        if self._pumping is not None:
            self._pumping.cancel()
        self._pumping = self.start(self._pump(live))

    async def _pump(self, live: LiveSession) -> None:
        """Send the cue and then steps. Steps that a robot missed are not sent again."""
        while self.live is live:
            _, subscriber = await live.subscribe(
                Audience.ROBOT, self.send, timezone.now(), self.write
            )
            self.subscriber = subscriber
            fold = live.aggregate.fold
            cue, state = describe_cue(fold), live.state_for_robot
            stopped, watched = live.robot_orders.is_stopped, live.is_watched
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
            is_alarm = describe_cue(self.live.aggregate.fold)["intensity"] > 0
            why = "reason" if is_alarm or report["reason"] in FELT else UNASKED
            details = {"device": self.device_id, why: report["reason"]}
            self.runtime.robots.stop(self.live, None, details)
        else:
            self.live.robot_orders.record_report(report, timezone.now())

    def _queue_incident(self, incident: Incident) -> None:
        """Have an incident stored, if it is of the present session; nothing waits for it."""
        if self.live is None or self.live.id != incident.session:
            return
        if self._incidents_waiting >= INCIDENTS_WAITING:
            log.warning("An incident of session %s was dropped: others wait.", incident.session)
            return  # the robot's own disk has it
        self._incidents_waiting += 1
        self.start(self._store_incident(self.live, incident, timezone.now()))

    async def _store_incident(self, live: LiveSession, incident: Incident, now: datetime) -> None:
        """Store what a robot recorded around a stop, and announce it to the pages."""
        at = now - timedelta(seconds=incident.ago_s)
        try:
            stored = await database_sync_to_async(store_incident)(
                incident.session, at, incident.reason, incident.recording
            )
        except DatabaseError:  # the robot's own disk has it; its stops must go on
            log.exception("An incident of session %s could not be stored.", incident.session)
            return
        finally:
            self._incidents_waiting -= 1
        if stored is not None and incident.reason != MOTION:
            live.robot_orders.record_report({"kind": "incident", "incident": stored}, now)

    def on_disconnect(self) -> None:
        """Unsubscribe, and free the session's slot."""
        if self.live is not None and self.subscriber is not None:
            self.live.feed.subscribers.discard(self.subscriber)
        super().on_disconnect()
