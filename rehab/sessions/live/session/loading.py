"""Loads sessions from the database into this process, many with a few queries."""

from __future__ import annotations

import asyncio
import contextvars
import logging
from collections.abc import Collection, Sequence
from itertools import groupby, islice
from operator import attrgetter
from typing import NamedTuple

from asgiref.sync import sync_to_async
from django.db import transaction
from django.db.models import QuerySet

from rehab.sessions.alarms import OpenAlarms
from rehab.sessions.live.database import owners
from rehab.sessions.live.session.aggregate import MARKS, SessionAggregate, kinds_with_marks
from rehab.sessions.live.session.live_session import RECENT_STEPS
from rehab.sessions.log import ALARM_KINDS, RobotEntry, SessionEvent, Step, noted_end
from rehab.sessions.models import TrainingSession, find_newest
from rehab.sessions.replay import (
    MEASURED,
    DamagedLog,
    check_end,
    count_steps,
    fold_entries,
    merge_entries,
)
from rehab.stations.models import Station
from rehab.training.changes import OPEN_STATES, State
from rehab.training.controls import CONTROLS

log = logging.getLogger(__name__)

_measured = attrgetter(*MEASURED)
TOGETHER = 50  # sessions that are loaded at a time


class LoadedSession(NamedTuple):
    """A session as its log has it."""

    aggregate: SessionAggregate
    recent: list[Step]
    robot_stopped: bool
    owned_before: str  # by whom, before it was claimed here; or empty


LoadResult = LoadedSession | Exception


class Loader:
    """Loads what is asked for, and what is asked for meanwhile then together.

    After a restart all sources and pages come back at once; each alone takes twice the time.
    """

    def __init__(self) -> None:
        self._wanted: dict[int, asyncio.Future[LoadedSession]] = {}
        self._task: asyncio.Task[None] | None = None

    async def load(self, session_id: int) -> LoadedSession:
        """Return a session as its log has it. Raises what ``load_together`` gives for it."""
        loop = asyncio.get_running_loop()
        future = self._wanted.setdefault(session_id, loop.create_future())
        if self._task is None:
            self._task = loop.create_task(self._run(), context=contextvars.Context())
        return await future

    async def _run(self) -> None:
        await asyncio.sleep(0)  # who asks in this turn of the event loop comes along
        while some := dict(islice(self._wanted.items(), TOGETHER)):
            loaded: dict[int, LoadResult]
            try:
                loaded = await sync_to_async(load_together)(some)
            except Exception as problem:
                loaded = dict.fromkeys(some, problem)
            for session_id, future in some.items():
                del self._wanted[session_id]
                found = loaded[session_id]
                if future.cancelled():
                    continue
                if isinstance(found, Exception):
                    future.set_exception(found)
                else:
                    future.set_result(found)
        self._task = None


def load_together(session_ids: Collection[int]) -> dict[int, LoadResult]:
    """Rebuild sessions from their logs, and become the writer of those that are open.

    For one that cannot be loaded its error is returned: TrainingSession.DoesNotExist,
    OwnedElsewhere, DamagedLog, or the database's.
    """
    try:
        return _load(session_ids)
    except Exception as problem:
        if len(session_ids) == 1:
            return dict.fromkeys(session_ids, problem)
        log.exception("Sessions could not be loaded together; each is tried alone")
        return {key: found for one in session_ids for key, found in load_together([one]).items()}


def _load(session_ids: Collection[int]) -> dict[int, LoadResult]:
    chosen = TrainingSession.everywhere.select_related("patient", "measure", "station")
    sessions = chosen.order_by().in_bulk(session_ids)
    found: dict[int, LoadResult] = {
        key: TrainingSession.DoesNotExist(f"There is no session {key}.")
        for key in session_ids
        if key not in sessions
    }
    owned_before: dict[int, str] = {}
    with transaction.atomic():
        for key, session in sorted(sessions.items()):  # in one order, so that none wait in a ring
            if State(session.state) in OPEN_STATES:
                try:
                    owned_before[key] = owners.claim(session)
                except owners.OwnedElsewhere as problem:
                    found[key] = problem
    ends = count_steps([key for key in sessions if key not in found])
    last_numbers: dict[int, int] = {}
    for key, stored in ends.items():
        try:
            last_numbers[key] = check_end(sessions[key], stored)
        except DamagedLog as problem:
            found[key] = problem
    behind = [key for key, last in last_numbers.items() if last > sessions[key].last_number]
    if behind:  # their owner did not come to note it
        TrainingSession.everywhere.filter(pk__in=behind).update(last_number=noted_end())
    logs, marked = _read_events(last_numbers), kinds_with_marks()
    for key, last in last_numbers.items():
        session, events = sessions[key], logs.get(key, [])
        aggregate = SessionAggregate.from_checkpoint(session)
        after = min(aggregate.fold.last_number, last - RECENT_STEPS)
        steps = list(_read_steps(key, after))  # once, for the fold and for pages
        _fold_rest(aggregate, steps, events)
        aggregate.add_marks([event for event in events if event.kind in marked][-MARKS:])
        aggregate.alarms = OpenAlarms(events)
        found[key] = LoadedSession(
            aggregate=aggregate,
            recent=steps[-RECENT_STEPS:],
            robot_stopped=is_robot_stopped(session, events),
            owned_before=owned_before.get(key, ""),
        )
    return found


def _fold_rest(
    aggregate: SessionAggregate, steps: Sequence[Step], events: Sequence[SessionEvent]
) -> None:
    """Fold what came after the checkpoint."""
    session_id, after = aggregate.session.pk, aggregate.fold.last_number
    changes = [one for one in events if one.kind in CONTROLS and one.after_number >= after]
    measured = (_measured(step) for step in steps if step.number > after)
    fold_entries(aggregate.fold, session_id, merge_entries(session_id, after, measured, changes))


def _read_steps(session_id: int, after: int) -> QuerySet[Step]:
    """Return the steps after one, in their order.

    One session's: of many, each from another step on, databases read their whole logs instead.
    """
    return Step.everywhere.filter(session=session_id, number__gt=after).order_by("number")


def _read_events(session_ids: Collection[int]) -> dict[int, list[SessionEvent]]:
    """Return of each session the events that change it, leave a mark or concern its robot."""
    kinds = {*CONTROLS, *kinds_with_marks(), *ALARM_KINDS}
    events = SessionEvent.everywhere.filter(session__in=session_ids, kind__in=kinds)
    ordered = events.order_by("session_id", "pk")
    return {key: list(some) for key, some in groupby(ordered, attrgetter("session_id"))}


def is_robot_stopped(session: TrainingSession, events: Sequence[SessionEvent]) -> bool:
    """Return whether the latest order to the station's robot, in any session, was stop."""
    if session.station is not None:
        return session.station.robot_stopped
    orders = [one.kind for one in events if one.kind in (RobotEntry.STOP, RobotEntry.ARM)]
    return orders[-1:] == [RobotEntry.STOP]


def find_stopped(station_ids: Collection[int]) -> set[int]:
    """Return the stations among these whose robot's latest order was stop."""
    stopped = Station.everywhere.filter(pk__in=station_ids, robot_stopped=True).order_by()
    return set(stopped.values_list("pk", flat=True))


def find_newest_open(station_id: int) -> int | None:
    """Return the newest open session of a station."""
    there = TrainingSession.everywhere.filter(station=station_id, state__in=[*OPEN_STATES])
    return find_newest(there)
