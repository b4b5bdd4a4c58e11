"""A session played back: what its pages were sent, when, and what its robot did meanwhile.

The log is folded again by the rules by which the session ran, and each step and event is sent by
the same functions, so that a page that plays it shows what it showed then. What no log has is not
made up: who was connected.
"""

from __future__ import annotations

import json
import logging
from collections.abc import Collection, Iterator
from datetime import datetime
from typing import Any

from rehab.people.models import User
from rehab.sessions.alarms import OpenAlarms
from rehab.sessions.events.course import Before, events_of_change, events_of_step
from rehab.sessions.events.event import (
    LiveEvent,
    alarms_event,
    remark_event,
    robot_report_event,
    robot_stopped_event,
)
from rehab.sessions.events.snapshot import snapshot
from rehab.sessions.log import (
    ALARM_KINDS,
    EVENTS,
    PartEntry,
    Remark,
    RobotEntry,
    RuleEntry,
    SessionEvent,
    Step,
)
from rehab.sessions.log_fold import DamagedLog, log_rows, to_change
from rehab.sessions.models import TrainingSession
from rehab.sessions.noted_conditions import planned_conditions
from rehab.sessions.reports.incident import review_incident
from rehab.sessions.robot_incidents import RobotIncident
from rehab.sessions.state_messages import Message
from rehab.training.controls import CONTROLS, Audience
from rehab.training.fold import SessionFold
from rehab.training.measures import InvalidSetting
from rehab.training.steps import InvalidMeasurement, Measurement
from robot.motion.composed_gestures import parse_gesture
from robot.motion.gesture_errors import BadGesture
from robot.motion.gestures import BUILT_IN
from robot.motion.preview import preview
from robot.wire.frames import BadFrame

log = logging.getLogger(__name__)

AUDIENCES = (Audience.PATIENT, Audience.MONITOR)
# Folding finds again what these record.
KINDS = [kind for kind in map(str, EVENTS) if kind not in [*RuleEntry, *PartEntry]]
# The source is there from the first step on: what a log does not hold is not shown as a fault.
PRESENCE: Message = {
    "source": True,
    "source_trouble": "",
    "robot": False,
    "tablets": 0,
    "storage": "",
}


def play_back(user: User, session: TrainingSession) -> Message:
    """Return a session as it was sent to its pages.

    Returns
    -------
    dict
        ``snapshots``: of each audience, before the session began. ``moments``: lists of the time
        from the start on [s], the last step's number, and what patient's and therapist's page
        were sent (null for nothing), oldest first. ``robot``: where it went, as previews
        (robot/motion/preview.py) with ``at_s`` and ``recorded``: measured, by its black box, or
        as it was ordered. ``took_s``: the time of the last moment.
    """
    fold = SessionFold(session.to_plan())
    rows, alarms = list(_rows(session)), OpenAlarms()
    began = start_of(session)
    presence = PRESENCE | {"robot": any(_is_robot(row) for _, row in rows)}
    about = {
        "session": session.pk,
        "nickname": session.patient.nickname,
        "language": session.patient.language,
        "code": session.patient.code,
    }
    snapshots = {
        audience.value: snapshot(
            audience,
            fold,
            about,
            presence,
            [],
            robot={},
            robot_stopped=False,
            marks=[],
            conditions=planned_conditions(session),
            alarms=alarms,
        )
        for audience in AUDIENCES
    }
    late = set(Step.everywhere.filter(session=session, late=True).values_list("number", flat=True))
    moments: list[list[Any]] = []
    at_s = 0.0
    for at, row in rows:
        # What was noted before the start belongs to it, and a clock may be set back.
        at_s = max(at_s, round((at - began).total_seconds(), 2))
        events = _events(fold, row, late)
        if isinstance(row, SessionEvent):
            alarms.apply(row)
            if row.kind in ALARM_KINDS:
                events.append(alarms_event(fold, alarms))
        for event in events:
            texts = [event.text(audience) for audience in AUDIENCES]
            if any(texts):
                messages = [text and json.loads(text) for text in texts]
                moments.append([at_s, event.number, *messages])
    return {
        "snapshots": snapshots,
        "moments": moments,
        "robot": [*_ordered(session, rows, began), *_recorded(user, session, began)],
        "took_s": at_s,
    }


def start_of(session: TrainingSession) -> datetime:
    """Return the moment from which a played session's seconds count."""
    return session.started_at or session.created_at


Row = Measurement | SessionEvent


def _rows(session: TrainingSession) -> Iterator[tuple[datetime, Row]]:
    """Yield what the log has, up to a hole if it has one."""
    try:
        yield from log_rows(session, KINDS)
    except DamagedLog as problem:
        log.error("%s", problem)


def _is_robot(row: Row) -> bool:
    return isinstance(row, SessionEvent) and row.kind in list(RobotEntry)


def _events(fold: SessionFold, row: Row, late: Collection[int]) -> list[LiveEvent]:
    """Fold an entry of the log and return its events; none where it had no effect.

    ``late``: numbers of the steps that were not shown as live.
    """
    if isinstance(row, SessionEvent) and row.kind not in CONTROLS:
        return [_event_of(fold, row)]
    before = Before.of(fold)
    try:
        if isinstance(row, Measurement):
            is_live = row.number not in late
            return events_of_step(fold, before, fold.step(row), AUDIENCES, live=is_live)
        change = to_change(row)
        fold.change(change)
        return events_of_change(fold, before, change)
    except (InvalidSetting, InvalidMeasurement):
        return []  # as in `fold_log`, which says so


def _event_of(fold: SessionFold, row: SessionEvent) -> LiveEvent:
    match row.kind:
        case RobotEntry.STOP | RobotEntry.ARM:
            return robot_stopped_event(fold, row.kind == RobotEntry.STOP)
        case RobotEntry.DECISION | RobotEntry.GESTURE:
            kind = row.kind.removeprefix("robot_")
            return robot_report_event(fold, {"kind": kind, **row.data})
        case _:
            return remark_event(fold, Remark(row.kind).value, row.value)


def _ordered(
    session: TrainingSession, rows: list[tuple[datetime, Row]], began: datetime
) -> Iterator[Message]:
    """Yield the gestures that its robot began, as they were ordered."""
    known = dict(BUILT_IN)
    for data in session.to_plan().gestures:
        try:
            known[str(data["name"])] = parse_gesture(data)
        except (BadGesture, KeyError):
            continue  # the robot refused it, too
    size = 1.0
    drawn: dict[tuple[str, float], Message] = {}
    for at, row in rows:
        if not isinstance(row, SessionEvent):
            continue
        if row.kind == RobotEntry.DECISION:
            size = row.data.get("intensity") or 1.0
        name = str(row.data.get("name", ""))
        began_one = row.kind == RobotEntry.GESTURE and row.data.get("phase") == "started"
        if began_one and name in known:
            if (name, size) not in drawn:
                drawn[name, size] = preview(known[name].scaled(size))
            at_s = round((at - began).total_seconds(), 2)
            yield {"at_s": at_s, "recorded": False, "name": name, **drawn[name, size]}


def _recorded(user: User, session: TrainingSession, began: datetime) -> Iterator[Message]:
    """Yield what its black box recorded around stops."""
    for incident in RobotIncident.objects.visible_to(user).filter(session=session).order_by("pk"):
        try:
            records = incident.records()
        except BadFrame:
            continue
        replay = review_incident(records).replay
        if replay:
            stops = [one["at_s"] for one in records if one.get("is_first") is True]
            ticks = [one["at_s"] for one in records if "tick" in one]
            before_s = (stops[-1] if stops else ticks[-1]) - ticks[0]
            at_s = (incident.at - began).total_seconds() - before_s
            yield {"at_s": round(at_s, 2), "recorded": True, "name": incident.reason, **replay}
