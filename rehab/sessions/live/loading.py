"""What is read of a session before it is live in this process."""

from __future__ import annotations

from typing import NamedTuple

from rehab.sessions.live import owners
from rehab.sessions.live.actor import SessionActor
from rehab.sessions.live.session import RECENT
from rehab.sessions.log import RobotEntry, SessionEvent, Step
from rehab.sessions.models import TrainingSession
from rehab.training.changes import OPEN_STATES, State


class Loaded(NamedTuple):
    """A session as its log has it."""

    actor: SessionActor
    recent: list[Step]
    robot_stopped: bool
    was_left: bool  # by a process that died with it


def load(session_id: int) -> Loaded:
    """Rebuild a session from its log, and become its writer if it is open.

    Raises TrainingSession.DoesNotExist and OwnedElsewhere.
    """
    session = TrainingSession.everywhere.select_related("patient", "measure", "station").get(
        pk=session_id
    )
    before = owners.claim(session) if State(session.state) in OPEN_STATES else ""
    latest = Step.everywhere.filter(session=session).order_by("-number")[:RECENT]
    return Loaded(
        actor=SessionActor.load(session),
        recent=list(reversed(latest)),
        robot_stopped=_is_robot_stopped(session),
        was_left=before not in ("", session.owner),
    )


def _is_robot_stopped(session: TrainingSession) -> bool:
    """Say whether the last word on the station's robot, in this session or before, was stop."""
    there = (
        {"session": session} if session.station is None else {"session__station": session.station}
    )
    words = SessionEvent.everywhere.filter(kind__in=(RobotEntry.STOP, RobotEntry.ARM), **there)
    last = words.order_by("-pk").values_list("kind", flat=True).first()
    return last == RobotEntry.STOP


def find_newest_open(station_id: int) -> int | None:
    """Give the newest open session of a station."""
    there = TrainingSession.everywhere.filter(station=station_id, state__in=[*OPEN_STATES])
    return there.order_by("-created_at", "-pk").values_list("pk", flat=True).first()
