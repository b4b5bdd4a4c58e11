"""What changes something of a clinic is answered by the server that the clinic lives in."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest
from django.urls import reverse

from rehab.feedback.models import FeedbackType
from rehab.people.models import User
from rehab.people.roles import Role
from rehab.sessions.live import runtime
from rehab.sessions.live.database import clinic_owners
from rehab.sessions.live.database.clinic_owners import OwnedElsewhere
from tests.support.programs import program_of
from tests.support.world import signed_in

pytestmark = pytest.mark.django_db
OTHER = "10.0.0.2:8000"
FORM = "admin:rehab_feedbacktype_add"


@pytest.fixture
def asked(world, monkeypatch) -> list[int]:
    """Let another server have every clinic; return which were asked for."""
    clinics: list[int] = []

    def find_elsewhere(clinic_id: int) -> OwnedElsewhere:
        clinics.append(clinic_id)
        return OwnedElsewhere("another", OTHER)

    live: Any = SimpleNamespace(servers=True, clinics=set())
    monkeypatch.setattr(runtime, "peek", lambda: live)
    monkeypatch.setattr(clinic_owners, "find_elsewhere", find_elsewhere)
    return clinics


def test_a_form_is_sent_to_the_clinics_server_before_anything_is_stored(world, asked):
    lead = signed_in(world.people[Role.LEAD])
    before = FeedbackType.everywhere.count()
    answer = lead.post(reverse(FORM), {})
    assert (answer.status_code, answer["Location"]) == (307, reverse(FORM))
    assert lead.cookies["garry_server"].value == OTHER
    assert FeedbackType.everywhere.count() == before
    # The proxy does not reach that one, and has asked another again: no redirect without an end.
    assert lead.post(reverse(FORM), {}).status_code == 503
    assert asked == [world.clinic.pk] * 2


def test_a_call_that_changes_something_is_sent_there_and_reading_works_anywhere(world, asked):
    program = program_of(world, Role.PT)
    path = f"/sessions/{world.session.pk}"
    call = f"/api/v1{path}/changes"
    answer = program.client.post(f"{call}?a=b", {"kind": "start"}, "application/json")
    there = f"{call}?a=b&garry_server=10.0.0.2%3A8000"
    assert (answer.status_code, answer["Location"]) == (307, there)
    assert "another server" in answer.json()["message"]
    answer = program.client.post(there, {"kind": "start"}, "application/json")
    assert answer.status_code == 503
    assert program.get(path)[0] == 200
    assert signed_in(world.people[Role.PT]).get("/start/").status_code in (200, 302)
    assert asked == [world.clinic.pk] * 2


def test_nobody_is_sent_away_from_the_clinics_own_server(world, asked):
    live: Any = runtime.peek()
    live.clinics.add(world.clinic.pk)
    lead = signed_in(world.people[Role.LEAD])
    assert lead.post(reverse(FORM), {}).status_code == 200
    assert asked == []


def test_hosts_who_have_no_clinic_are_served_anywhere(world, asked):
    host = signed_in(User.everywhere.create_user("a-host", role=Role.HOST))
    assert host.post(reverse("admin:rehab_clinic_add"), {}).status_code == 200
    assert asked == []
