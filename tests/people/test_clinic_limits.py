"""A clinic's share of a server: what one asks too often, another does not wait for."""

from __future__ import annotations

import pytest

from rehab.people import clinic_limits
from rehab.people.token_buckets import TokenBuckets
from tests.support.world import build_world

pytestmark = pytest.mark.django_db


def test_one_clinic_that_asks_too_often_is_refused_and_no_other(monkeypatch):
    amber, birch = build_world("amber"), build_world("birch")
    monkeypatch.setattr(clinic_limits, "_requests", TokenBuckets(2, 60.0))
    assert [amber.pt.get("/").status_code for _ in range(2)] == [200, 200]
    answer = amber.lead.get("/")
    assert answer.status_code == 429
    assert 0 < int(answer["Retry-After"]) <= 61
    assert "GARRY_CLINIC_SESSIONS" in answer.content.decode()
    assert birch.pt.get("/").status_code == 200


def test_a_hospital_of_three_hundred_sessions_fits(settings):
    assert 300 * 4 <= clinic_limits.max_sockets() == settings.CLINIC_SESSIONS * 6
    assert not any(clinic_limits.take_request(-1) for _ in range(300 * 4))
