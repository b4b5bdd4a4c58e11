"""An incident's report: its figures, its course, its file; who may open it; that it is noted."""

from __future__ import annotations

import re

import pytest
from django.urls import reverse

from rehab.people.audit import audit_log
from rehab.people.audit.audit_log import Act, AuditEntry, Recent
from rehab.people.roles import Role
from rehab.sessions.reports.incident import review_incident
from rehab.sessions.robot_incidents import RobotIncident
from robot.wire.incident import read_lines
from tests.support.world import RECORDED, build_world, client_of

pytestmark = pytest.mark.django_db


def address(world, name="incident"):
    return reverse(name, args=[world.rows[RobotIncident].pk])


def test_the_page_tells_what_happened_and_can_be_replayed(world):
    page = client_of(world).get(address(world)).content.decode()
    text = re.sub(r"\s+", " ", re.sub(r"<[^>]+>", " ", page)).replace(" :", ":")
    assert "ordered to stand" in text
    assert "felt: bump" in text
    assert "Speed at the stop 0.20 m/s" in text
    assert "It moved on by 2.0 cm" in text
    assert '"poses": [[0.0, 0.0, 0.0, 0.0]' in page
    assert address(world, "incident-file") in page


def test_who_looked_is_noted_with_the_patient(world, monkeypatch):
    monkeypatch.setattr(audit_log, "recent_views", Recent())
    client_of(world).get(address(world))
    entry = AuditEntry.everywhere.get(act=Act.VIEW, about=address(world))
    assert entry.patient_id == world.patient.pk


def test_the_sessions_page_leads_to_it_in_one_tap(world):
    page = client_of(world).get(reverse("session", args=[world.session.pk])).content.decode()
    assert f'href="{address(world)}"' in page
    seen = client_of(world, Role.RESEARCHER).get(reverse("session", args=[world.session.pk]))
    assert address(world) not in seen.content.decode()


def test_the_file_is_what_was_recorded_and_taking_it_is_noted(world):
    answer = client_of(world).get(address(world, "incident-file"))
    assert read_lines(answer.content.decode()) == RECORDED
    assert ".jsonl" in answer["Content-Disposition"]
    entry = AuditEntry.everywhere.filter(act=Act.EXPORT).latest("pk")
    assert (entry.about, entry.patient_id) == (address(world, "incident-file"), world.patient.pk)


@pytest.mark.parametrize("name", ["incident", "incident-file"])
def test_nobody_else_sees_it(world, name):
    other = build_world("other")
    assert client_of(other).get(address(world, name)).status_code == 404
    assert client_of(world, Role.RESEARCHER).get(address(world, name)).status_code == 403


def test_a_damaged_recording_is_said(world):
    RobotIncident.everywhere.update(recording="AAAA")
    answer = client_of(world).get(address(world))
    assert answer.status_code == 200
    assert "damaged" in answer.content.decode()


@pytest.mark.parametrize(
    "records",
    [
        [],
        [{"at_s": 1.0}],
        [{"at_s": 1.0, "retained": None}, {"at_s": 2, "tick": "1234567"}],
        [{"at_s": 1.0, "tick": [None] * 7}, {"at_s": 1, "tick": [0] * 7, "hazards": [[]]}],
        [{"at_s": 1.0, "sent": {"kind": [], "lights": [1]}}, {"at_s": 1, "received": {"type": {}}}],
        [{"at_s": 1.0, "sent": {"kind": "gesture", "phase": {}, "outcome": {}}}],
        [{"at_s": 1.0, "lost": []}, {"at_s": 1.0, "sent": {"kind": "status", "lights": []}}],
    ],
)
def test_a_robot_that_records_nonsense_breaks_no_page(records):
    review = review_incident(records)
    assert isinstance(review.entries, list)
