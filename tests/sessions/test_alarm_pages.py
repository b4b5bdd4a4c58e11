"""Alarms on plain pages: what the clinic sees, what is told afterwards, and that watching is no
activity.
"""

from __future__ import annotations

import re
from datetime import timedelta
from typing import Any

import pytest
from django.contrib.sessions.models import Session
from django.test import Client
from django.urls import reverse
from django.utils import timezone

from rehab.patients import urls
from rehab.people.roles import Role
from rehab.sessions.alarms import OpenAlarms
from rehab.sessions.log import SessionEvent
from rehab.sessions.models import TrainingSession
from tests.support.page_text import plain, words
from tests.support.walks import HIT, make_patient, walk
from tests.support.world import NOW, World, build_world, client_of

pytestmark = pytest.mark.django_db


@pytest.fixture
def session(world: World) -> TrainingSession:
    return walk(make_patient(world.clinic, "Iris"), "positive", [HIT, HIT])


def note(session: TrainingSession, kind: str, **columns: Any) -> SessionEvent:
    made: SessionEvent = SessionEvent.everywhere.create(
        session=session, after_number=1, kind=kind, at=NOW, **columns
    )
    return made


def seen(client: Client, name: str = "alarms", **query: Any) -> str:
    return plain(client.get(reverse(name), query).content.decode())


def test_an_open_alarm_is_on_the_pages_of_its_clinic_alone(transactional_db, world, session):
    note(session, "fall")
    pt = client_of(world)
    told = seen(pt)
    assert f"Iris fell, {NOW:%H:%M}." in told
    assert "Finished" in told
    assert "I’m going there" in told
    assert "Iris fell" in seen(pt, but=session.pk)  # its page tells no more: it has ended
    TrainingSession.everywhere.filter(pk=session.pk).update(state="paused")
    assert "Iris" not in seen(pt, but=session.pk)
    TrainingSession.everywhere.filter(pk=session.pk).update(state="finished")
    assert "Iris" not in seen(pt, station=world.session.station_id or 0)  # it was at none
    assert "Iris" not in seen(client_of(build_world("oak")))
    assert "fell" in seen(pt, "start")
    answer = pt.post(reverse("acknowledge-alarms", args=[session.pk]), {"kind": "fall"})
    assert (answer.status_code, answer.content) == (204, b"")
    assert "fell" not in (told := seen(pt))
    assert f"{world.people[Role.PT]} takes care of Iris’s fall, {NOW:%H:%M}." in told
    assert "Iris" not in seen(pt, but=0)  # no room beside another walk
    assert "fell" not in seen(pt, "start")
    row = SessionEvent.everywhere.get(session=session, kind="fall_acknowledged")
    assert row.by == world.people[Role.PT]


def test_who_takes_care_of_a_fall_is_told_until_the_session_goes_on(session):
    alarms = OpenAlarms([note(session, "fall"), note(session, "fall_acknowledged")])
    assert alarms.describe()["fall_seen"]
    assert alarms.describe()["fall_seen"]["severity"] is None
    alarms.apply(note(session, "fall_severity", value=2))
    assert alarms.describe()["fall_seen"]["severity"] == 2
    alarms.apply(note(session, "resume"))
    assert alarms.describe()["fall_seen"] is None


def test_what_an_ended_session_left_is_folded_up_on_the_page_of_another(world, session):
    note(session, "fall")
    pt = client_of(world)
    for query, is_folded in (({"but": 0}, True), ({}, False)):
        told = pt.get(reverse("alarms"), query).content.decode()
        assert "Iris fell, " in told
        assert ("1 alarm of an ended session" in told) is is_folded


def test_a_fall_stands_first_on_the_start_page_and_in_the_admins_day(world, session):
    note(session, "fall", by=world.people[Role.PT])
    TrainingSession.everywhere.filter(pk=session.pk).update(active_s=60)
    walk(make_patient(world.clinic, "Tom", code="K-2"), "positive", [HIT])
    pt = client_of(world)
    assert f"Noted by {world.people[Role.PT]}" in seen(pt)
    listed = seen(pt, "start")
    assert listed.index("Iris") < listed.index("Tom")
    page = pt.get(reverse("admin:index"))
    fallen = [(row.patient, row.has_fallen) for row in page.context["today"]]
    assert fallen[0] == ("Iris", True)
    assert sum(has_fallen for _, has_fallen in fallen) == 1
    text = plain(page.content.decode())
    assert text.index("Needs attention") < text.index("Iris fell.") < text.index("Today")


def test_each_page_of_a_patient_asks_for_alarms_where_they_are(world, session):
    pt, asked = client_of(world), {}
    for pattern in urls.urlpatterns:
        if pattern.pattern.converters.keys() == {"patient_id"}:
            address = reverse(pattern.name, args=[session.patient_id])
            page = pt.get(address).content.decode()
            asked[address] = re.search(r'data-alarms="([^"]*)"', page)
    found = {address: match[1] for address, match in asked.items() if match}
    assert len(found) >= 5
    assert set(found.values()) == {reverse("alarms")}, found


def test_another_clinic_acknowledges_nothing(world, session):
    note(session, "fall")
    stranger = client_of(build_world("oak"))
    answer = stranger.post(reverse("acknowledge-alarms", args=[session.pk]), {"kind": "fall"})
    assert answer.status_code == 404
    assert "Iris fell, " in seen(client_of(world))


def test_who_has_seen_a_stop_takes_care_of_no_fall(transactional_db, world, session):
    note(session, "robot_stop", data={"reason": "bump"})
    note(session, "fall")
    pt = client_of(world)
    address = reverse("acknowledge-alarms", args=[session.pk])
    assert pt.post(address, {"kind": "robot_stop"}).status_code == 204
    told = seen(pt)
    assert "Iris fell, " in told
    assert "stopped by itself" not in told
    assert pt.post(address).status_code == 400
    assert pt.post(address, {"kind": "fall"}).status_code == 204
    assert "Iris fell, " not in seen(pt)


def test_list_report_and_list_of_incidents_tell_it_afterwards(world, session):
    by = world.people[Role.PT]
    note(session, "fall")
    note(session, "fall_severity", value=1)
    listed = words(seen(client_of(world), "incidents"))
    where = re.escape(str(session.station or "–"))
    told = rf"Iris fell. .*{NOW:%Y, %H:%M} {where} Slightly hurt – Nobody has answered yet"
    assert re.search(told, listed)
    note(session, "robot_stop", data={"reason": "bump"})
    note(session, "fall_acknowledged", by=by)
    pt = client_of(world)
    listed = words(seen(pt, "incidents"))
    assert "Iris fell." in listed
    assert re.search(rf"Slightly hurt – Seen after 0\ss by {by}", listed)
    assert "The robot of Iris stopped by itself." in listed
    assert "Not seen yet" in listed
    assert "Falls 1 Near falls 0 Robot stopped by itself 1" in words(listed)
    assert "! incident" in plain(
        pt.get(reverse("history", args=[session.patient_id])).content.decode()
    )
    for page in ("report", "session"):
        text = plain(pt.get(reverse(page, args=[session.pk])).content.decode())
        assert "Falls" in text
        assert "slightly hurt, seen" in text
        assert "Robot stopped by itself" in text


def test_a_severity_is_of_the_fall_that_was_one(world, session):
    by = world.people[Role.PT]
    note(session, "fall")
    note(session, "fall_acknowledged", by=by)
    note(session, "fall")
    note(session, "fall_withdrawn")
    note(session, "fall_severity", value=2)
    listed = words(seen(client_of(world), "incidents"))
    assert re.search(rf"Moderately hurt – Seen after 0\ss by {by}", listed)
    assert listed.count("hurt") == 1


def test_what_is_counted_is_listed_with_what_was_done_then(world, session):
    by = world.people[Role.PT]
    note(session, "pain", value=0)  # none
    note(session, "near_fall", by=by)
    assert f"– {by} Walked on" in words(seen(client_of(world), "incidents"))
    note(session, "pain", value=6)
    note(session, "pause")
    note(session, "dizziness")
    listed = words(seen(client_of(world), "incidents"))
    where = re.escape(str(session.station or "–"))
    assert "Falls 0 Near falls 1 Robot stopped by itself 0 Pain 1 Dizziness 1" in listed
    for line in (
        rf"Iris: near fall .*, \d\d:\d\d {where} – {by} Pause, {NOW:%H:%M}",
        rf"Iris: pain 6 of 10 .*, \d\d:\d\d {where} – – Pause, {NOW:%H:%M}",
        rf"Iris: dizziness .*, \d\d:\d\d {where} – – During a pause",
    ):
        assert re.search(line, listed), line
    assert "pain 0" not in listed


def test_the_list_of_incidents_goes_back_as_far_as_it_is_asked(world, session):
    SessionEvent.everywhere.create(
        session=session, after_number=1, kind="near_fall", at=NOW - timedelta(weeks=8)
    )
    pt = client_of(world)
    assert "Iris: near fall" not in seen(pt, "incidents", weeks="4")
    for weeks in ("12", "52", "", "many"):
        assert "Iris: near fall" in seen(pt, "incidents", weeks=weeks)


def test_what_was_only_simulated_is_listed_and_not_counted(world, session):
    TrainingSession.everywhere.filter(pk=session.pk).update(simulated=True)
    note(session, "fall")
    listed = words(seen(client_of(world), "incidents"))
    assert "Falls 0" in listed
    assert "Nothing went wrong in " in listed
    assert listed.index("Simulated, not counted") < listed.index("Iris fell.")


def test_falls_come_first_and_a_simulated_robot_alarms_no_other_page(world, session):
    note(session, "fall")
    other = walk(make_patient(world.clinic, "Tom", code="K-2"), "positive", [HIT])
    note(other, "robot_stop", data={"reason": "bump"})
    pt = client_of(world)
    told = seen(pt)
    assert told.index("Iris fell, ") < told.index("The robot of Tom stopped by itself, ")
    assert "moves again" not in told  # it may, since the session has ended
    TrainingSession.everywhere.filter(pk=other.pk).update(state="paused")
    assert "It moves again only when you let it, on Tom’s page." in words(seen(pt))
    TrainingSession.everywhere.filter(pk__in=[session.pk, other.pk]).update(simulated=True)
    told = seen(client_of(world))
    assert "Iris fell, " in told
    assert "Tom" not in told


def test_a_withdrawn_fall_is_no_mark(world, session):
    note(session, "fall")
    note(session, "fall_withdrawn")
    pt = client_of(world)
    assert "Iris" not in seen(pt)
    assert "! incident" not in plain(
        pt.get(reverse("history", args=[session.patient_id])).content.decode()
    )


def test_watching_keeps_nobody_signed_in(world):
    pt = client_of(world)
    pt.get("/start/")
    almost = timezone.now() + timedelta(minutes=1)
    Session.objects.update(expire_date=almost)
    stored = pt.session
    stored["last_activity_at"] = 0
    stored.save()
    Session.objects.update(expire_date=almost)
    pt.get(reverse("alarms"), headers={"Garry-Watching": "yes"})
    assert Session.objects.get().expire_date == almost
    pt.get(reverse("alarms"))
    assert Session.objects.get().expire_date > almost


def test_who_may_not_see_patients_sees_no_alarm(world, session):
    note(session, "fall")
    researcher = client_of(world, Role.RESEARCHER)
    assert researcher.get(reverse("alarms")).status_code == 403
