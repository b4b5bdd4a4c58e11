"""Who may call: people with a token or a browser, for as long as both are good."""

from __future__ import annotations

import re
from datetime import timedelta
from typing import Any

import pytest
from django.contrib.sessions.models import Session
from django.core.exceptions import ValidationError
from django.test import Client
from django.utils import timezone

from rehab.people.access import UndeclaredView
from rehab.people.audit.audit_log import Act, AuditEntry
from rehab.people.models import User
from rehab.people.roles import Role
from rehab.people.sign_in.tokens import LIFETIME, ApiToken
from rehab.people.token_buckets import TokenBuckets
from rehab.people.web import api_base
from tests.support.programs import ROOT, Program, bearer_token, program_of
from tests.support.world import NOW, build_world, client_of

pytestmark = pytest.mark.django_db


def filled(**fields: Any) -> dict[str, Any]:
    """Return the form of a new token as a lead sends it."""
    day = timezone.now() + LIFETIME
    given = {"name": "Export", "role": "pt", "may_read": "on"}
    given |= {"expires_at_0": f"{day:%Y-%m-%d}", "expires_at_1": f"{day:%H:%M:%S}"}
    return given | fields


def issued(answer: Any) -> str:
    """Return the token that a page shows."""
    return str(re.search(r'class="token">(\S+?)<', answer.content.decode()).group(1))


def test_a_lead_makes_a_token_that_is_shown_once_and_works_until_it_is_revoked(world):
    client = world.lead
    answer = client.post("/admin/rehab/apitoken/add/", filled(role="researcher"))
    token = issued(answer)
    assert token not in str(answer.cookies)
    assert not any(token in str(row.get_decoded()) for row in Session.objects.all())
    assert token not in client.get("/admin/rehab/apitoken/").content.decode()
    row = ApiToken.everywhere.get(name="Export")
    assert (row.clinic, token in row.token_hash) == (world.clinic, False)
    assert row.user == world.people[Role.LEAD]
    program = Program(token)
    assert program.get("/me")[1]["role"] == "researcher"
    row.refresh_from_db()
    assert row.last_seen_at is not None
    chosen = {"action": "revoke_tokens", "_selected_action": row.pk}
    client.post("/admin/rehab/apitoken/", chosen)
    status, problem = program.get("/me")
    assert (status, "A lead makes tokens" in problem["message"]) == (401, True)


def test_a_token_carries_no_role_that_its_account_lacks(world):
    client = world.lead
    token = ApiToken(clinic=world.clinic, user=world.people[Role.RESEARCHER], role="pt")
    with pytest.raises(ValidationError, match="choose that role, or one below"):
        token.clean()
    page = client.post("/admin/rehab/apitoken/add/", filled(role="host")).content.decode()
    assert "Select a valid choice" in page
    assert not ApiToken.everywhere.filter(name="Export").exists()


def test_a_lead_makes_no_token_that_speaks_for_another_person(world):
    client, pt = world.lead, world.people[Role.PT]
    client.post("/admin/rehab/apitoken/add/", filled(role="pt", user=pt.pk))
    assert ApiToken.everywhere.get(name="Export").user == world.people[Role.LEAD]
    others = world.rows[ApiToken]
    before = others.token_hash
    chosen = {"action": "renew_tokens", "_selected_action": others.pk}
    page = client.post("/admin/rehab/apitoken/", chosen, follow=True).content.decode()
    assert "Only its own person" in page
    form = {"name": "Mine now", "user": world.people[Role.LEAD].pk, "may_export": "on"}
    client.post(f"/admin/rehab/apitoken/{others.pk}/change/", form)
    others.refresh_from_db()
    assert (others.token_hash, others.user, not others.may_export) == (before, pt, True)


def test_a_renewed_token_is_shown_once_and_in_no_cookie(world):
    client = world.lead
    client.post("/admin/rehab/apitoken/add/", filled())
    row = ApiToken.everywhere.get(name="Export")
    chosen = {"action": "renew_tokens", "_selected_action": row.pk}
    answer = client.post("/admin/rehab/apitoken/", chosen)
    token = issued(answer)
    assert token not in str(client.cookies)
    assert "no-store" in answer.headers["Cache-Control"]
    assert Program(token).get("/me")[0] == 200


def test_a_token_ends_after_ninety_days_and_never_later_than_a_year(world):
    client = world.lead
    program = Program(issued(client.post("/admin/rehab/apitoken/add/", filled())))
    row = ApiToken.everywhere.get(name="Export")
    assert timedelta(days=89) < row.expires_at - NOW < timedelta(days=91)
    assert program.get("/me")[0] == 200
    ApiToken.everywhere.filter(pk=row.pk).update(expires_at=timezone.now())
    assert program.get("/me")[0] == 401
    for days in (-1, 367):
        day = NOW + timedelta(days=days)
        given = filled(name="Late", expires_at_0=f"{day:%Y-%m-%d}", expires_at_1="10:00:00")
        page = client.post("/admin/rehab/apitoken/add/", given).content.decode()
        assert "within a year" in page
    assert not ApiToken.everywhere.filter(name="Late").exists()


@pytest.mark.parametrize(
    ("scope", "call", "allowed"),
    [
        ("read", "GET /patients", 200),
        ("read", "POST /patients", 403),
        ("read", "GET /sessions/{session}/steps", 403),
        ("steer", "GET /patients", 403),
        ("steer", "POST /patients", 201),
        ("export", "GET /sessions/{session}/steps", 200),
        ("export", "GET /patients", 403),
        ("", "GET /me", 403),
    ],
)
def test_a_token_does_what_its_scopes_say(world, scope, call, allowed):
    row = ApiToken(clinic=world.clinic, user=world.people[Role.LEAD], name="p", role=Role.PT)
    row.may_read = scope == "read"
    row.may_steer, row.may_export = scope == "steer", scope == "export"
    program = Program(row.new_token())
    row.save()
    method, path = call.format(session=world.session.pk).split()
    body = {"code": "K1", "nickname": "Rosa"} if method == "POST" else {}
    status, told = getattr(program, method.lower())(path, **body)
    assert status == allowed
    if status == 403:
        assert "lacks the scope" in told["message"]


@pytest.mark.parametrize("change", ["password", "role", "nothing"])
def test_a_token_ends_with_the_password_and_the_role_of_its_account(world, change):
    lead = world.people[Role.LEAD]
    program = Program(bearer_token(lead, Role.RESEARCHER))
    if change == "password":
        lead.set_password("another one 2026")
    elif change == "role":
        lead.role = Role.PT  # which may still lend a researcher's
    else:
        lead.first_name = "Rosa"
    lead.save()
    assert program.get("/me")[0] == (200 if change == "nothing" else 401)
    assert ApiToken.everywhere.get(user=lead).is_revoked == (change != "nothing")


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
    monkeypatch.setattr(api_base, "calls", TokenBuckets(3, 20.0))
    program = program_of(world, Role.LEAD)
    assert [program.get("/me")[0] for _ in range(4)] == [200, 200, 200, 429]
    response = program.client.get(f"{ROOT}/me")
    assert response.headers["Retry-After"] == "20"


def test_a_call_that_declares_nothing_stops_the_start():
    def silent(request: object) -> None:
        return None

    with pytest.raises(UndeclaredView, match="silent.*@for_roles"):
        api_base.check_roles(silent)


def test_a_service_account_outlives_who_makes_its_tokens(world):
    """Nobody can sign in there; the logs name it, and no other clinic's lead gets its token."""
    service = User.everywhere.create_user(
        "bookings", role=Role.PT, clinic=world.clinic, is_service=True
    )
    other = build_world("basil")
    form = filled(user=service.pk)
    other.lead.post("/admin/rehab/apitoken/add/", form)
    assert ApiToken.everywhere.filter(name="Export", user=service).count() == 0
    token = issued(world.lead.post("/admin/rehab/apitoken/add/", form))
    status, me = Program(token).get("/me")
    assert (status, me["username"]) == (200, "bookings")
    noted = AuditEntry.everywhere.filter(act=Act.TOKEN_USE, by=service)
    assert [(one.by, one.through) for one in noted] == [(service, "Export")]
    lead = world.people[Role.LEAD]
    lead.is_active = False
    lead.save()
    assert Program(token).get("/me")[0] == 200
    service.is_active = False
    service.save()
    assert Program(token).get("/me")[0] == 401


def test_nobody_signs_in_to_a_service_account(world):
    form = {"username": "bookings", "role": "pt", "is_service": "on", "usable_password": "true"}
    form |= {"password1": "a-password-that-is-long", "password2": "a-password-that-is-long"}
    world.lead.post("/admin/rehab/user/add/", form)
    service = User.everywhere.get(username="bookings")
    assert service.is_service
    service.subject = "4711"
    service.set_password("a-password-that-is-long")
    service.save()
    service.refresh_from_db()
    assert (service.has_usable_password(), service.subject) == (False, None)
    world.lead.post(f"/admin/rehab/user/{service.pk}/change/", {"username": "x", "role": "pt"})
    service.refresh_from_db()
    assert (service.username, service.is_service) == ("x", True)  # its tokens are not a person's
