"""Who may call: people with a token or a browser, for as long as both are good."""

from __future__ import annotations

import re

import pytest
from django.test import Client

from rehab.people.access import UndeclaredView
from rehab.people.roles import Role
from rehab.people.sign_in.tokens import ApiToken
from rehab.people.web import api_base
from tests.support.programs import ROOT, Program, bearer_token, program_of
from tests.support.world import build_world, client_of

pytestmark = pytest.mark.django_db


def test_a_lead_makes_a_token_that_is_shown_once_and_works_until_it_is_revoked(world):
    client = client_of(world, Role.LEAD)
    form = {"name": "Export", "user": world.people[Role.PT].pk, "role": "researcher"}
    page = client.post("/admin/rehab/apitoken/add/", form, follow=True).content.decode()
    token = re.search(r"one time only: (\S+?)<", page).group(1)
    assert token not in client.get("/admin/rehab/apitoken/").content.decode()
    row = ApiToken.everywhere.get(name="Export")
    assert (row.clinic, token in row.token_hash) == (world.clinic, False)
    program = Program(token)
    assert program.get("/me")[1]["role"] == "researcher"
    row.refresh_from_db()
    assert row.last_seen_at is not None
    chosen = {"action": "revoke_tokens", "_selected_action": row.pk}
    client.post("/admin/rehab/apitoken/", chosen)
    status, problem = program.get("/me")
    assert (status, "A lead makes tokens" in problem["message"]) == (401, True)


def test_a_token_carries_no_role_that_its_account_lacks(world):
    client = client_of(world, Role.LEAD)
    form = {"name": "Export", "user": world.people[Role.RESEARCHER].pk, "role": "pt"}
    page = client.post("/admin/rehab/apitoken/add/", form).content.decode()
    assert "choose that role, or one below" in page
    assert not ApiToken.everywhere.filter(name="Export").exists()


def test_only_leads_see_tokens(world):
    for role in (Role.PT, Role.RESEARCHER):
        client = client_of(world, role)
        assert client.get("/admin/rehab/apitoken/").status_code == 403


def test_a_token_dies_with_its_account_and_with_its_right(world):
    pt = world.people[Role.PT]
    program = program_of(world, Role.PT)
    assert program.get("/patients")[0] == 200
    pt.is_active = False
    pt.save()
    assert program.get("/patients")[0] == 401
    pt.is_active, pt.role = True, Role.RESEARCHER
    pt.save()
    assert program.get("/me")[0] == 401  # the account may lend a PT's role no more
    pt.role = Role.PT
    pt.clinic = build_world("birch").clinic
    pt.save()
    assert program.get("/me")[0] == 401


def test_a_call_never_changes_the_role_of_the_account(world):
    program = Program(bearer_token(world.people[Role.LEAD], Role.PT))
    program.post("/patients", code="K1", nickname="Rosa")
    world.people[Role.LEAD].refresh_from_db()
    assert world.people[Role.LEAD].role == Role.LEAD


@pytest.mark.parametrize("header", ["", "Bearer", "Bearer ", "Bearer x", "Basic eDp4", "Bearer é"])
def test_strangers_are_told_how_to_be_known(header, world):
    response = Client(headers={"Authorization": header}).get(f"{ROOT}/me")
    assert response.status_code == 401
    assert response.headers["WWW-Authenticate"] == "Bearer"
    assert "Authorization: Bearer" in response.json()["message"]


def test_a_device_is_no_person(world):
    assert Program(world.token).get("/me")[0] == 401


def test_a_browser_that_is_signed_in_calls_too_but_changes_nothing_from_a_foreign_page(world):
    client = client_of(world, enforce_csrf_checks=True)
    assert client.get(f"{ROOT}/me").json()["role"] == "pt"
    body = {"code": "K1", "nickname": "Rosa"}
    url = f"{ROOT}/patients"
    response = client.post(url, body, "application/json")
    assert response.status_code == 403
    assert "CSRF" in response.json()["message"]
    client.get("/start/")
    header = {"X-CSRFToken": client.cookies["csrftoken"].value}
    assert client.post(url, body, "application/json", headers=header).status_code == 201


def test_too_many_calls_are_asked_to_wait(world, monkeypatch):
    monkeypatch.setattr(api_base, "CALLS_A_MINUTE", 3)
    monkeypatch.setattr("rehab.people.web.api_base.time.time", lambda: 6000.0)
    program = program_of(world, Role.LEAD)
    assert [program.get("/me")[0] for _ in range(4)] == [200, 200, 200, 429]
    response = program.client.get(f"{ROOT}/me")
    assert response.headers["Retry-After"] == "60"


def test_a_call_that_declares_nothing_stops_the_start():
    def silent(request: object) -> None:
        return None

    with pytest.raises(UndeclaredView, match="silent.*@for_roles"):
        api_base.check_roles(silent)
