"""Stops and arms a session's robot at once; logs and publishes that, and what it reports."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from datetime import datetime
from typing import NamedTuple, Protocol

from rehab.people.models import User
from rehab.sessions.events.event import (
    LiveEvent,
    alarms_event,
    robot_report_event,
    robot_stopped_event,
)
from rehab.sessions.live.devices import ConnectedDevice
from rehab.sessions.live.session.aggregate import SessionAggregate
from rehab.sessions.live.session.subscribers import EventFeed
from rehab.sessions.log import RobotEntry
from rehab.sessions.state_messages import Message

LOGGED_REPORTS = {
    "decision": RobotEntry.DECISION,
    "gesture": RobotEntry.GESTURE,
}  # of a robot's reports


class RobotStop(NamedTuple):
    """A stop of the robot: who stopped it, when, and which device if it was no person."""

    by: User | None
    at: datetime
    data: Message


class WithRobot(Protocol):
    """A session, as far as its robot is concerned."""

    aggregate: SessionAggregate
    feed: EventFeed
    robot: ConnectedDevice | None


class RobotOrders:
    """Stops the robot of a session and arms it again.

    Parameters
    ----------
    submit
        Queues rows for the log; their events are published after the commit.
    """

    def __init__(
        self, live: WithRobot, submit: Callable[..., None], *, is_stopped: bool = False
    ) -> None:
        self.is_stopped = is_stopped  # until a person arms it again
        self.unlogged_stop: RobotStop | None = None  # in force, not committed yet
        self.reports: Message = {"status": None, "decision": None}  # the latest
        self._live = live
        self._submit = submit

    def stop(self, by: User | None, at: datetime, data: Message) -> None:
        """Stop the robot at once, until a person arms it.

        ``data``: which device stopped it, if it was no person.
        """
        if self._live.robot is not None:
            self._live.robot.outbox.queue({"type": "stop"})
        if self.is_stopped:
            if self.unlogged_stop is None:  # a page that asks again is answered
                self._live.feed.publish(robot_stopped_event(self._live.aggregate.fold, True))
            return
        self.is_stopped = True
        self.unlogged_stop = stop = RobotStop(by, at, data)

        def forget() -> None:
            if self.unlogged_stop is stop:
                self.unlogged_stop = None

        row = self._live.aggregate.log_event(RobotEntry.STOP, by, at, data)
        self._submit([row], self._events(), [], on_stored=forget)

    def arm(self, by: User | None, at: datetime) -> asyncio.Future[None]:
        """Let the robot move again once that is committed; then the future is done."""
        stored: asyncio.Future[None] = asyncio.get_running_loop().create_future()
        self.is_stopped = False

        def notify_robot(result: asyncio.Future[None]) -> None:
            failed = result.cancelled() or result.exception() is not None
            if not failed and not self.is_stopped and self._live.robot is not None:
                self._live.robot.outbox.queue({"type": "arm"})

        stored.add_done_callback(notify_robot)
        row = self._live.aggregate.log_event(RobotEntry.ARM, by, at, {})
        self._submit([row], self._events(), [], stored=stored)
        return stored

    def _events(self) -> list[LiveEvent]:
        """Return the events of a stop or an arming."""
        fold, alarms = self._live.aggregate.fold, self._live.aggregate.alarms
        return [robot_stopped_event(fold, self.is_stopped), alarms_event(fold, alarms)]

    def record_report(self, report: Message, at: datetime) -> None:
        """Publish a report of the robot; decisions and gestures are logged first."""
        event = robot_report_event(self._live.aggregate.fold, report)
        kind = report.get("kind")
        if kind in self.reports:
            self.reports[kind] = report
        if kind in LOGGED_REPORTS:
            data = {name: value for name, value in report.items() if name != "kind"}
            row = self._live.aggregate.log_event(LOGGED_REPORTS[kind], None, at, data)
            self._submit([row], [event], [])
        else:
            self._live.feed.publish(event)
