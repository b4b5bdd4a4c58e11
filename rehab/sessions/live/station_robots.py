"""The robots of a process's stations: the sessions of one station share its robot."""

from __future__ import annotations

import asyncio
from collections.abc import Mapping

from django.utils import timezone

from rehab.people.models import User
from rehab.sessions.live.session.live_session import LiveSession
from rehab.sessions.live.session.robot_orders import RobotStop
from rehab.sessions.state_messages import Message


class StationRobots:
    """Passes each order on to all sessions of a robot's station.

    Parameters
    ----------
    sessions
        The live sessions of the process, by id, as they are at any time.
    """

    def __init__(self, sessions: Mapping[int, LiveSession]) -> None:
        self._sessions = sessions
        # At locations whose sessions were all dropped.
        self._unlogged_stops: dict[str, RobotStop] = {}

    def stop(self, live: LiveSession, by: User | None, details: Message) -> None:
        """Stop the robot of a session, and of the others at its station.

        ``details``: which device stopped it, if it was no person.
        """
        for session in (live, *self._others_at_location_of(live)):
            session.robot_orders.stop(by, timezone.now(), details)

    def check_arm(self, live: LiveSession) -> None:
        """Raise NotAllowed while a patient at the robot's location lies there after a fall."""
        for one in (live, *self._others_at_location_of(live)):
            one.aggregate.alarms.check_seen_to_fall()

    async def arm(self, live: LiveSession, by: User) -> None:
        """Let the robot of a session move again, once that is committed."""
        there = (live, *self._others_at_location_of(live))
        await asyncio.gather(*(one.robot_orders.arm(by, timezone.now()) for one in there))

    def drive(self, session_id: int, drive: Message) -> None:
        """Pass on that a person holds a button to drive the robot to its mark."""
        live = self._sessions.get(session_id)
        if live is not None and live.robot is not None:
            live.robot.outbox.queue({"type": "drive", **drive})

    def restore_stops(self, live: LiveSession) -> None:
        """Apply robot stops that are not logged yet to a session that was just loaded."""
        stop = self._unlogged_stops.pop(live.location, None)
        if stop is not None:
            live.robot_orders.stop(*stop)
        for other in self._others_at_location_of(live):
            orders = other.robot_orders
            if orders.is_stopped and orders.unlogged_stop is not None:
                live.robot_orders.stop(*orders.unlogged_stop)
            elif orders.is_stopped:  # committed since the log was read
                live.robot_orders.is_stopped = True

    def pass_stop_on(self, live: LiveSession) -> None:
        """Pass the stop of a session on that is dropped before the stop was logged.

        Another session of the location has it from now on, or the next one that is loaded.
        """
        stop, live.robot_orders.unlogged_stop = live.robot_orders.unlogged_stop, None
        if stop is None:
            return
        heirs = self._others_at_location_of(live)
        for heir in heirs:
            heir.robot_orders.stop(*stop)
        if not heirs:
            self._unlogged_stops[live.location] = stop

    def _others_at_location_of(self, live: LiveSession) -> list[LiveSession]:
        there = self._sessions.values()
        return [one for one in there if one.location == live.location and one is not live]
