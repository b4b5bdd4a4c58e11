"""Commits rows of sessions: steps, events and figures, with all that must be so before."""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import fields
from datetime import UTC, datetime
from functools import lru_cache
from operator import attrgetter
from typing import Any, NamedTuple

import msgspec
from django.db import connection, transaction

from rehab.outbox.models import Topic, notify
from rehab.sessions.alarms import Alarm, alarm_of
from rehab.sessions.live.session.aggregate import Row, StepRow, Summary
from rehab.sessions.log import (
    RobotEntry,
    SessionEvent,
    SessionMetric,
    figures_stored,
    noted_end,
)
from rehab.sessions.models import TrainingSession
from rehab.stations.models import Station
from rehab.training.changes import ChangeKind
from rehab.training.steps import ScoredStep

log = logging.getLogger(__name__)

# Steps are the one table that is written many times a second. Plain rows spare the ORM's objects,
# compiler and wrappers: a headless run went from 7,400 to 18,800 steps/s with that alone.
SCORED = [f.name for f in fields(ScoredStep) if f.name not in ("side", "reasons", "extra")]
STORED_COLUMNS = ("session_id", "received_at", "late", "side", "reasons", "extra", *SCORED)
_scored_values = attrgetter(*SCORED)
_to_json = msgspec.json.Encoder().encode  # of plain, finite values: both were checked
_from_json = msgspec.json.Decoder(list[tuple[int, int, int | None]]).decode
# SQLite takes 32,766 parameters a statement, PostgreSQL 65,535.
STEPS_A_STATEMENT = 500
COPIED_ROWS = 4  # from so many on PostgreSQL's COPY is quicker than INSERT
# Compared before each commit. Reading a log's end from the steps' index is cheaper than raising a
# number in the session's row, which is wide and is then rewritten whole (docs/performance.md).
LOG_ENDS = (
    "SELECT one.id, epoch, (SELECT MAX(number) FROM rehab_step WHERE session_id = one.id) AS last "
    "FROM rehab_trainingsession AS one JOIN rehab_clinicowner AS its USING (clinic_id) "
    "WHERE one.id IN ({marks})"
)
# From SQLite in one row: its module gives up the interpreter's lock for each, and the event loop
# takes it meanwhile.
IN_ONE_ROW = "SELECT json_group_array(json_array(id, epoch, last)) FROM ({select})"


def _sqlite_time(at: datetime) -> str:
    """Return a time as Django's backend writes it, which asks for the zone with each row."""
    return str(at.astimezone(UTC).replace(tzinfo=None))


def _step_values(row: StepRow, adapt_time: Callable[[datetime], Any]) -> tuple[Any, ...]:
    """Return the values of a row, in the order of ``STORED_COLUMNS``."""
    session_id, step, received_at, late = row
    return (
        session_id,
        adapt_time(received_at),
        late,
        str(step.side),
        _to_json(step.reasons).decode() if step.reasons else "[]",
        _to_json(step.extra).decode() if step.extra else "{}",
        *_scored_values(step),
    )


@lru_cache(maxsize=STEPS_A_STATEMENT)
def _insert_statement(count: int, mark: str) -> str:
    row = f"({', '.join([mark] * len(STORED_COLUMNS))})"
    columns = ", ".join(STORED_COLUMNS)
    return f"INSERT INTO rehab_step ({columns}) VALUES {', '.join([row] * count)}"  # noqa: S608


ALARM_TOPICS = {Alarm.FALL: Topic.FALL, Alarm.ROBOT_STOP: Topic.INCIDENT}
ENDS = (ChangeKind.FINISH, ChangeKind.ABORT)


class Fenced(RuntimeError):
    """Another process has claimed the clinic; this one must not write to its sessions."""


class LogDiffers(RuntimeError):
    """The stored log does not end where this process believes; its steps would leave a hole."""


class EarlierWriteFailed(RuntimeError):
    """An earlier write of the session failed, so this one would leave a gap."""


class Job(NamedTuple):
    """Rows of one session, committed together.

    ``owner``: the object whose rows these are; after a failed job none of its later ones is
    written. ``done`` is called on the event loop with the error, or None. ``came_s``: when a step
    came in (`time.monotonic`), which is timed; 0 for anything else.
    """

    owner: object
    session_id: int
    epoch: int
    rows: Sequence[Row]
    summary: Summary | None
    done: Callable[[Exception | None], None]
    came_s: float = 0.0


def commit(jobs: Sequence[Job]) -> None:
    """Write jobs, in their order, in one transaction.

    Raises Fenced if a session's clinic has another owner, LogDiffers if steps do not follow those
    that are stored, and the database's errors; nothing is written then.
    """
    steps = [row for job in jobs for row in job.rows if isinstance(row, StepRow)]
    epochs = {job.session_id: job.epoch for job in jobs}
    with transaction.atomic():
        _check_logs(epochs, _find_first_numbers(steps))
        _insert_steps(steps)
        events = [row for job in jobs for row in job.rows if isinstance(row, SessionEvent)]
        if events:
            SessionEvent.everywhere.bulk_create(events)
            _note_robot_orders(events)
            _notify_receivers(events)
            # After an end, the log may be sealed to it already. A row that is updated twice would
            # wait for its clinic's (PostgreSQL checks foreign keys again).
            updated = {job.session_id for job in jobs if job.summary is not None}
            after_end = {event.session_id for event in events if event.session.ended_at} - updated
            if after_end:
                TrainingSession.everywhere.filter(pk__in=after_end).update(unsealed=True)
        metrics = [row for job in jobs for row in job.rows if isinstance(row, SessionMetric)]
        if metrics:
            SessionMetric.everywhere.bulk_create(metrics)
        for job in jobs:
            if job.summary is not None:
                TrainingSession.everywhere.filter(pk=job.session_id).update(
                    last_number=noted_end(), unsealed=True, **job.summary
                )
        if metrics:
            _announce_figures({row.session.patient_id for row in metrics})


def _announce_figures(patients: set[int]) -> None:
    """Send `figures_stored`; no step is lost to a receiver that fails."""
    try:
        with transaction.atomic():
            figures_stored.send(SessionMetric, patients=patients)
    except Exception:
        log.exception("Boards miss new figures; they follow within a day.")


def _notify_receivers(events: Sequence[SessionEvent]) -> None:
    """Store what receivers are told of these events; no step is lost where that fails."""
    for event in events:
        alarm = alarm_of(event)
        topic = ALARM_TOPICS[alarm] if alarm else Topic.SESSION
        if alarm is None and event.kind not in ENDS:
            continue
        session = event.session
        about: dict[str, Any] = {"session": session.pk, "station": session.station_id}
        about |= {"how": event.kind} if alarm is None else {"reason": event.data.get("reason", "")}
        about |= {"simulated": True} if session.simulated else {}
        try:
            with transaction.atomic():
                notify(session.clinic_id, topic, about, event.at)
        except Exception:
            log.exception("Receivers of clinic %s miss a message", session.clinic_id)


def _note_robot_orders(events: Sequence[SessionEvent]) -> None:
    """Store the latest order to each robot with its station, where sessions find it at once."""
    orders = {
        event.session.station_id: event.kind == RobotEntry.STOP
        for event in events
        if event.kind in (RobotEntry.STOP, RobotEntry.ARM)
    }
    for station_id, stopped in orders.items():
        if station_id is not None:  # else the session looks into its own log
            Station.everywhere.filter(pk=station_id).update(robot_stopped=stopped)


def _find_first_numbers(rows: Sequence[StepRow]) -> dict[int, int]:
    """Return the number of each session's first step. Raises LogDiffers for a gap."""
    firsts: dict[int, int] = {}
    lasts: dict[int, int] = {}
    for row in rows:
        key, number = row.session_id, row.step.number
        firsts.setdefault(key, number)
        last = lasts.get(key, number - 1)
        if number != last + 1:
            raise LogDiffers(f"Step {number} does not follow step {last}.")
        lasts[key] = number
    return firsts


def _check_logs(epochs: dict[int, int], firsts: dict[int, int]) -> None:
    """Check that this process owns the sessions, and that steps continue what is stored of each.

    A database that fails over to a copy that lagged has lost steps that were acknowledged: what
    comes next must not be stored behind the hole. ``firsts``: of each session's steps the first
    number. Raises Fenced and LogDiffers.
    """
    marks = ", ".join(["%s"] * len(epochs))
    select = LOG_ENDS.format(marks=marks)
    with connection.cursor() as cursor:
        if connection.vendor == "sqlite":
            cursor.execute(IN_ONE_ROW.format(select=select), list(epochs))
            stored = _from_json(cursor.fetchone()[0])
        else:  # other transactions run at the same time: they must not claim it now
            cursor.execute(f"{select} FOR SHARE OF its", list(epochs))
            stored = cursor.fetchall()
    if {key: epoch for key, epoch, _ in stored} != epochs:
        raise Fenced("Another process has taken the clinic over.")
    differing = [
        f"the log of session {key} ends with step {last or 0}, before step {firsts[key]} was to be "
        "stored. The database has lost steps, or was set back"
        for key, _, last in stored
        if key in firsts and firsts[key] != (last or 0) + 1
    ]
    if differing:
        raise LogDiffers("; ".join(differing))


def _insert_steps(rows: Sequence[StepRow]) -> None:
    """Insert rows, many in a statement.

    One statement for each row (``executemany``) releases the interpreter's lock each time and waits
    for the event loop to return it: seconds at 1,000 sessions.
    """
    if not rows:
        return
    is_sqlite = connection.vendor == "sqlite"
    mark = "?" if is_sqlite else "%s"
    adapt_time = _sqlite_time if is_sqlite else connection.ops.adapt_datetimefield_value
    if connection.vendor == "postgresql" and len(rows) >= COPIED_ROWS:
        columns = ", ".join(STORED_COLUMNS)
        with (
            connection.wrap_database_errors,
            connection.connection.cursor() as cursor,
            cursor.copy(f"COPY rehab_step ({columns}) FROM STDIN") as copy,
        ):
            for row in rows:
                copy.write_row(_step_values(row, adapt_time))
        return
    with connection.wrap_database_errors, closing(connection.connection.cursor()) as cursor:
        for first in range(0, len(rows), STEPS_A_STATEMENT):
            chunk = rows[first : first + STEPS_A_STATEMENT]
            values = [value for row in chunk for value in _step_values(row, adapt_time)]
            cursor.execute(_insert_statement(len(chunk), mark), values)
