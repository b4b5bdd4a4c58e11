"""The page of the clinic's stations: who walks there, and the robot's stop."""

from __future__ import annotations

import pytest
from django.urls import reverse

from rehab.people.audit.audit_log import AuditEntry
from rehab.people.roles import Role
from rehab.sessions.log import SessionEvent
from rehab.sessions.models import TrainingSession
from rehab.stations.models import Device, Station
from tests.support.page_text import plain, words
from tests.support.tablets import approved
from tests.support.world import NOW, build_world, client_of

pytestmark = pytest.mark.django_db


def test_a_station_says_who_walks_there_and_its_robot_is_stopped(transactional_db, world):
    session = world.session
    station = world.rows[Station]
    type(session).everywhere.filter(pk=session.pk).update(station=station, state="running")
    pt = client_of(world)
    page = pt.get(reverse("stations")).content.decode()
    assert f"{session.patient.nickname}, running" in words(plain(page))
    assert reverse("monitor", args=[session.pk]) in page
    address = reverse("stop-robot", args=[session.pk])
    assert address in page
    assert client_of(build_world("oak")).post(address).status_code == 404
    assert not SessionEvent.everywhere.filter(session=session, kind="robot_stop").exists()

    answer = pt.post(address, follow=True)
    assert f"Robot stopped: {station}." in plain(answer.content.decode())
    stop = SessionEvent.everywhere.get(session=session, kind="robot_stop")
    assert stop.by == world.people[Role.PT]
    assert AuditEntry.everywhere.filter(act="robot_stop", by_id=stop.by_id).exists()


def test_a_station_is_ready_where_what_measures_and_the_tablet_are_connected(world):
    station = world.rows[Station]
    Device.everywhere.filter(station=station).delete()

    def told():
        page = words(plain(client_of(world).get(reverse("stations")).content.decode()))
        return "ready" in page, "not connected: " in page

    TrainingSession.everywhere.update(state="finished")
    assert told() == (False, False)  # no device
    approved(station, "Plates", kind="source")
    tablet, _ = approved(station, "Tablet", kind="tablet")
    assert told() == (False, True)  # never seen
    Device.everywhere.update(last_seen_at=NOW)
    assert told() == (True, False)
    Device.everywhere.filter(pk=tablet.pk).update(revoked_at=NOW)
    assert told() == (False, True)


def test_the_robot_of_a_session_that_has_ended_is_not_stopped(world):
    session = world.session
    type(session).everywhere.filter(pk=session.pk).update(state="finished")
    address = reverse("stop-robot", args=[session.pk])
    assert client_of(world).post(address).status_code == 404
