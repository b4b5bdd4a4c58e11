"""No query of the live path walks through a table that grows with the years."""

from __future__ import annotations

import re

import pytest
from django.db import connection
from django.test.utils import CaptureQueriesContext

from rehab.sessions.live.database import clinic_owners
from rehab.sessions.live.protocol.past_steps import PAGE_STEPS
from rehab.sessions.live.session.aggregate import SessionAggregate
from rehab.sessions.live.session.loading import LoadedSession, find_newest_open, load_together
from rehab.sessions.log import RobotEntry, Step
from rehab.stations.models import Station
from tests.support.callers import build_place, open_session
from tests.support.world import NOW, store

pytestmark = pytest.mark.django_db


def load(session_id: int) -> LoadedSession:
    found = load_together({session_id: 0})[session_id]
    assert isinstance(found, LoadedSession)
    return found


GROWING = {"rehab_step", "rehab_sessionevent", "rehab_trainingsession", "rehab_sessionmetric"}


@pytest.mark.skipif("connection.vendor != 'sqlite'", reason="PostgreSQL plans by what is there")
@pytest.mark.parametrize("at_station", [True, False])
def test_no_table_that_grows_is_scanned(at_station):
    place = build_place("elm")
    session = open_session(place, at_station=at_station)
    with CaptureQueriesContext(connection) as asked:
        load(session.pk)
        clinic_owners.find_ownerless()
        clinic_owners.claim(session.clinic_id)
        clinic_owners.note_ends([session.pk])
        clinic_owners.release([session.clinic_id])
        find_newest_open(place.station.pk)
        list(Step.everywhere.filter(session_id=1, number__gt=5, number__lte=9)[:PAGE_STEPS])
    plans = []
    for query in asked.captured_queries:
        if query["sql"].startswith(("SELECT", "UPDATE")):
            with connection.cursor() as cursor:
                cursor.execute(f"EXPLAIN QUERY PLAN {query['sql']}")
                plans += [(row[3], query["sql"]) for row in cursor.fetchall()]
    scanned = [
        (step, sql)
        for step, sql in plans
        if (found := re.match(r"SCAN (\w+)", step)) and found[1] in GROWING
    ]
    assert not scanned
    assert len(plans) > 10


def test_a_station_knows_its_robots_latest_order():
    place = build_place("elm")
    session = open_session(place)
    aggregate = SessionAggregate(session)
    for order, stopped in ((RobotEntry.STOP, True), (RobotEntry.ARM, False)):
        store(aggregate, [aggregate.log_event(order, place.pt, NOW, {})])
        assert Station.everywhere.get(pk=place.station.pk).robot_stopped is stopped
    assert not load(session.pk).robot_stopped
    Station.everywhere.filter(pk=place.station.pk).update(robot_stopped=True)
    assert load(session.pk).robot_stopped
    alone = SessionAggregate(open_session(place, at_station=False))
    store(alone, [alone.log_event(RobotEntry.STOP, place.pt, NOW, {})])
    assert load(alone.session.pk).robot_stopped
