"""Loads sessions from the database into this process."""

from __future__ import annotations

from typing import NamedTuple

from rehab.sessions.live import owners
from rehab.sessions.live.aggregate import SessionAggregate
from rehab.sessions.live.session import RECENT_STEPS
from rehab.sessions.log import RobotEntry, SessionEvent, Step
from rehab.sessions.models import TrainingSession
from rehab.sessions.replay import check_log
from rehab.training.changes import OPEN_STATES, State


class LoadedSession(NamedTuple):
    """A session as its log has it."""

    aggregate: SessionAggregate
    recent: list[Step]
    robot_stopped: bool
    was_orphaned: bool  # its process died while it was open


def load(session_id: int) -> LoadedSession:
    """Rebuild a session from its log, and become its writer if it is open.

    Raises TrainingSession.DoesNotExist, OwnedElsewhere and DamagedLog.
    """
    session = TrainingSession.everywhere.select_related("patient", "measure", "station").get(
        pk=session_id
    )
    before = owners.claim(session) if State(session.state) in OPEN_STATES else ""
    last = check_log(session)
    if last > session.last_number:  # its owner did not come to note it
        TrainingSession.everywhere.filter(pk=session.pk).update(last_number=last)
    latest = Step.everywhere.filter(session=session).order_by("-number")[:RECENT_STEPS]
    return LoadedSession(
        aggregate=SessionAggregate.load(session),
        recent=list(reversed(latest)),
        robot_stopped=is_robot_stopped(session),
        was_orphaned=before not in ("", owners.HANDED_ON, session.owner),
    )


def is_robot_stopped(session: TrainingSession) -> bool:
    """Return whether the latest order to the station's robot, in any session, was stop."""
    if session.station is not None:
        return session.station.robot_stopped
    orders = SessionEvent.everywhere.filter(
        session=session, kind__in=(RobotEntry.STOP, RobotEntry.ARM)
    )
    last = orders.order_by("-pk").values_list("kind", flat=True).first()
    return last == RobotEntry.STOP


def find_newest_open(station_id: int) -> int | None:
    """Return the newest open session of a station."""
    there = TrainingSession.everywhere.filter(station=station_id, state__in=[*OPEN_STATES])
    return there.order_by("-created_at", "-pk").values_list("pk", flat=True).first()
