"""Sessions that are loaded together are what each is alone, and none harms another."""

from __future__ import annotations

import asyncio
from typing import Any

import pytest
from asgiref.sync import sync_to_async
from django.db import DatabaseError, connection
from django.test.utils import CaptureQueriesContext

from rehab.people.audit import append_only_triggers
from rehab.sessions.live import runtime as runtimes
from rehab.sessions.live.session import loading
from rehab.sessions.live.session.aggregate import SessionAggregate
from rehab.sessions.log import Remark, RobotEntry, Step
from rehab.sessions.log_fold import DamagedLog
from rehab.sessions.models import TrainingSession
from rehab.training.changes import Change, ChangeKind
from rehab.training.fold.checkpoints import fold_to_json
from rehab.training.steps import Measurement, Side
from tests.support.callers import build_place, open_session, restart
from tests.support.world import NOW, store

pytestmark = pytest.mark.django_db


def walk(place, steps: int, *, checkpoint: int = 0, at_station: bool = True) -> TrainingSession:
    """Store a session with so many steps, goals in between, and a checkpoint after one of them."""
    session = open_session(place, at_station=at_station)
    aggregate = SessionAggregate(session)
    store(aggregate, aggregate.change(Change(ChangeKind.START), None, NOW))
    for number in range(1, steps + 1):
        row = aggregate.record_step(Measurement(number, number * 1.1, Side.LEFT, 4.0), NOW)
        store(aggregate, [row])
        if number == checkpoint:
            stored = {"checkpoint": fold_to_json(aggregate.fold), "last_number": number}
            TrainingSession.everywhere.filter(pk=session.pk).update(**stored)
        if number % 3 == 0:
            goal = Change(ChangeKind.GOAL, 3.0 + number / 100)
            store(aggregate, aggregate.change(goal, place.pt, NOW))
    store(aggregate, [aggregate.log_event(Remark.REST, place.pt, NOW, {})])
    return session


def plain(one: loading.LoadedSession) -> tuple[Any, ...]:
    recent = [(step.number, step.performance, step.received_at) for step in one.recent]
    aggregate = one.aggregate
    return vars(aggregate.fold), list(aggregate.marks), recent, one.robot_stopped


def loaded(keys: list[int]) -> dict[int, loading.LoadedSession]:
    found = loading.load_together(dict.fromkeys(keys, 0))
    return {key: one for key, one in found.items() if isinstance(one, loading.LoadedSession)}


def test_sessions_loaded_together_are_what_each_is_alone():
    places = [build_place(name) for name in ("elm", "oak", "ash", "fir")]
    sessions = [
        walk(places[0], 70, checkpoint=64),
        walk(places[1], 5),
        walk(places[2], 9, checkpoint=9),
        walk(places[3], 0, at_station=False),
    ]
    alone = SessionAggregate(sessions[3])
    store(alone, [alone.log_event(RobotEntry.STOP, places[3].pt, NOW, {})])
    keys = [session.pk for session in sessions]
    together = loaded(keys)
    for session in sessions:
        one = together[session.pk]
        stored = TrainingSession.everywhere.get(pk=session.pk)
        stored.checkpoint = None
        assert vars(one.aggregate.fold) == vars(SessionAggregate.load(stored).fold)
        assert plain(one) == plain(loaded([session.pk])[session.pk])
    assert [together[key].robot_stopped for key in keys] == [False, False, False, True]
    assert [len(together[key].recent) for key in keys] == [60, 5, 9, 0]
    assert [TrainingSession.everywhere.get(pk=key).last_number for key in keys] == [70, 5, 9, 0]


def test_a_session_that_cannot_be_loaded_leaves_the_others_alone():
    whole, damaged = (walk(build_place(name), 4) for name in ("elm", "oak"))
    with append_only_triggers.lifted("default"):
        Step.everywhere.filter(session=damaged, number=2).delete()
    found = loading.load_together(dict.fromkeys([whole.pk, damaged.pk, 0], 0))
    assert isinstance(found[whole.pk], loading.LoadedSession)
    assert isinstance(found[damaged.pk], DamagedLog)
    assert isinstance(found[0], TrainingSession.DoesNotExist)


def test_what_the_database_refuses_of_all_is_tried_of_each(monkeypatch):
    first, second = (walk(build_place(name), 2) for name in ("elm", "oak"))
    read = loading._read_steps

    def fail(session_id: int, after: int) -> Any:
        if session_id == second.pk:
            raise DatabaseError("locked")
        return read(session_id, after)

    monkeypatch.setattr(loading, "_read_steps", fail)
    found = loading.load_together(dict.fromkeys([first.pk, second.pk], 0))
    assert isinstance(found[first.pk], loading.LoadedSession)
    assert isinstance(found[second.pk], DatabaseError)


def test_many_sessions_take_hardly_more_queries_than_one():
    keys = [walk(build_place(name), 2).pk for name in ("elm", "oak", "ash", "fir")]
    with CaptureQueriesContext(connection) as asked:
        loading.load_together(dict.fromkeys(keys, 0))
    assert len(asked.captured_queries) <= len(keys) + 4  # one for each: its latest steps


@pytest.mark.django_db(transaction=True)
async def test_sessions_asked_for_in_one_turn_are_loaded_together(place, begun, monkeypatch):
    begun_one = await begun(place)
    waiting = await sync_to_async(open_session)(place, at_station=False)
    keys = [begun_one.pk, waiting.pk]
    await restart()
    together, load = [], loading.load_together

    def note(epochs):
        together.append(sorted(epochs))
        return load(epochs)

    monkeypatch.setattr(loading, "load_together", note)
    runtime = runtimes.current()
    asked = [runtime.session(key) for key in (*keys, 0)]
    found = await asyncio.gather(*asked, return_exceptions=True)
    assert together == [sorted(keys)]
    assert [runtime.sessions[key] for key in keys] == found[:2]
    assert isinstance(found[2], TrainingSession.DoesNotExist)
