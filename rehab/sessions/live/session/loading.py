"""Loads sessions from the database into this process, many with a few queries."""

from __future__ import annotations

import asyncio
import contextvars
import logging
from collections.abc import Awaitable, Callable, Collection, Mapping, Sequence
from itertools import groupby, islice
from operator import attrgetter
from typing import NamedTuple

from asgiref.sync import sync_to_async
from django.db.models import QuerySet

from rehab.sessions.alarms import OpenAlarms
from rehab.sessions.live.database import clinic_owners
from rehab.sessions.live.session.aggregate import MARKS, SessionAggregate, kinds_with_marks
from rehab.sessions.live.session.live_session import RECENT_STEPS
from rehab.sessions.log import ALARM_KINDS, RobotEntry, SessionEvent, Step
from rehab.sessions.log_fold import (
    MEASURED,
    DamagedLog,
    check_end,
    count_steps,
    fold_entries,
    merge_entries,
)
from rehab.sessions.models import TrainingSession, find_newest
from rehab.training.changes import OPEN_STATES
from rehab.training.controls import CONTROLS

log = logging.getLogger(__name__)

_measured = attrgetter(*MEASURED)
TOGETHER = 50  # sessions that are loaded at a time


class LoadedSession(NamedTuple):
    """A session as its log has it; ``epoch``: under which this process writes its clinic's."""

    aggregate: SessionAggregate
    recent: list[Step]
    robot_stopped: bool
    epoch: int


LoadResult = LoadedSession | Exception
Own = Callable[[int], Awaitable[int]]


class Loader:
    """Loads what is asked for, and what is asked for meanwhile then together.

    After a restart all sources and pages come back at once; each alone takes twice the time.

    Parameters
    ----------
    own
        Makes this process the owner of a clinic and returns the epoch; raises OwnedElsewhere.
    """

    def __init__(self, own: Own) -> None:
        self._own = own
        self._wanted: dict[int, asyncio.Future[LoadedSession]] = {}
        self._task: asyncio.Task[None] | None = None

    async def load(self, session_id: int) -> LoadedSession:
        """Return a session as its log has it.

        Raises OwnedElsewhere, and what ``load_together`` gives for it.
        """
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
                loaded = await self._load(list(some))
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

    async def _load(self, session_ids: list[int]) -> dict[int, LoadResult]:
        """Own the clinics of sessions first: from then on nobody else writes their logs."""
        clinics = await sync_to_async(find_clinics)(session_ids)
        wanted = sorted(set(clinics.values()))
        results = await asyncio.gather(*map(self._own, wanted), return_exceptions=True)
        owned = dict(zip(wanted, results, strict=True))
        epochs: dict[int, int] = {}
        found: dict[int, LoadResult] = {}
        for session_id in session_ids:
            match owned.get(clinics.get(session_id, 0)):
                case int(epoch):
                    epochs[session_id] = epoch
                case Exception() as problem:
                    found[session_id] = problem
                case _:
                    found[session_id] = TrainingSession.DoesNotExist(
                        f"There is no session {session_id}."
                    )
        return found | (await sync_to_async(load_together)(epochs) if epochs else {})


def find_clinics(session_ids: Collection[int]) -> dict[int, int]:
    """Return the clinic of each session that there is."""
    rows = TrainingSession.everywhere.filter(pk__in=session_ids).order_by()
    return dict(rows.values_list("pk", "clinic"))


def load_together(epochs: Mapping[int, int]) -> dict[int, LoadResult]:
    """Rebuild sessions from their logs, given with the epochs of their clinics.

    For one that cannot be loaded its error is returned: TrainingSession.DoesNotExist, DamagedLog,
    or the database's.
    """
    try:
        return _load(epochs)
    except Exception as problem:
        if len(epochs) == 1:
            return dict.fromkeys(epochs, problem)
        log.exception("Sessions could not be loaded together; each is tried alone")
        alone = [load_together({key: epoch}) for key, epoch in epochs.items()]
        return {key: found for one in alone for key, found in one.items()}


def _load(epochs: Mapping[int, int]) -> dict[int, LoadResult]:
    chosen = TrainingSession.everywhere.select_related("patient", "measure", "station")
    sessions = chosen.order_by().in_bulk(epochs)
    found: dict[int, LoadResult] = {
        key: TrainingSession.DoesNotExist(f"There is no session {key}.")
        for key in epochs
        if key not in sessions
    }
    ends = count_steps(list(sessions))
    last_numbers: dict[int, int] = {}
    for key, stored in ends.items():
        try:
            last_numbers[key] = check_end(sessions[key], stored)
        except DamagedLog as problem:
            found[key] = problem
    behind = [key for key, last in last_numbers.items() if last > sessions[key].last_number]
    if behind:  # their owner did not come to note it
        clinic_owners.note_ends(behind)
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
            epoch=epochs[key],
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


def find_newest_open(station_id: int) -> int | None:
    """Return the newest open session of a station."""
    there = TrainingSession.everywhere.filter(station=station_id, state__in=[*OPEN_STATES])
    return find_newest(there)
