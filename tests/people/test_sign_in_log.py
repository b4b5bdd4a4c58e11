"""Sign-ins leave a trace that their owner and the clinic's leads read."""

from __future__ import annotations

from datetime import timedelta
from typing import Any

import pytest
from django.db import transaction
from django.test import Client
from django.urls import reverse
from django.utils import timezone

from rehab.people.audit import audit_log
from rehab.people.audit.audit_log import (
    Act,
    AuditEntry,
    Recent,
    build_entry,
    record_counted,
)
from rehab.people.models import User
from rehab.people.roles import Role
from rehab.people.sign_in.factors import factors, totp
from rehab.people.sign_in.signed_in_browsers import describe_browser
from tests.support.programs import bearer_token
from tests.support.world import NOW, World, build_world, client_of

pytestmark = [pytest.mark.django_db, pytest.mark.postgres]

PASSWORD = "walk well 2026"
FIREFOX = "Mozilla/5.0 (Windows NT 10.0; Win64; x64; rv:131.0) Gecko/20100101 Firefox/131.0"


@pytest.fixture(autouse=True)
def fresh(monkeypatch):
    monkeypatch.setattr(audit_log, "recent_views", Recent())
    monkeypatch.setattr(audit_log, "recent_entries", Recent())


@pytest.fixture
def pt(world: World) -> User:
    person = world.people[Role.PT]
    factors.remove_second_factors(person)
    person.set_password(PASSWORD)
    person.save()
    return person


def enter(client: Client, name: str, password: str = PASSWORD, address: str = "192.0.2.7"):
    form = {"username": name, "password": password}
    return client.post(reverse("sign-in"), form, REMOTE_ADDR=address, HTTP_USER_AGENT=FIREFOX)


def traced(*acts: Act) -> list[tuple[Any, ...]]:
    rows = AuditEntry.everywhere.filter(act__in=acts).order_by("pk")
    return list(rows.values_list("act", "by__username", "clinic__name", "address", "count"))


def test_a_sign_in_and_its_failures_are_traced(pt, client):
    for _ in range(2):
        enter(client, pt.username, "wrong")
    enter(client, pt.username)
    clinic = pt.clinic.name
    assert traced(Act.SIGN_IN, Act.SIGN_IN_FAILED) == [
        ("sign_in_failed", pt.username, clinic, "192.0.2.0/24", 2),
        ("sign_in", pt.username, clinic, "192.0.2.0/24", 1),
    ]


def test_a_lock_out_is_traced_once_with_its_repeats(pt, client):
    for _ in range(7):
        enter(client, pt.username, "wrong")
    ((act, who, *_, count),) = traced(Act.LOCK_OUT)
    assert (act, who) == ("lock_out", pt.username)
    assert count >= 2


def test_a_name_that_no_account_has_is_in_no_log(pt, client, caplog):
    with caplog.at_level("INFO", logger="rehab"):
        enter(client, "my-secret-password", "wrong")
    assert traced(Act.SIGN_IN_FAILED) == []
    ours = [record.getMessage() for record in caplog.records if record.name.startswith("rehab")]
    assert ours == ["A sign-in failed from 192.0.2.0/24, by a name that no account has"]


def test_a_host_is_traced_in_the_hosts_own_log(client):
    host = User.everywhere.create_user("root", password=PASSWORD, role=Role.HOST)
    enter(client, "root")
    assert traced(Act.SIGN_IN) == [("sign_in", "root", None, "192.0.2.0/24", 1)]
    assert AuditEntry.objects.visible_to(host).count() == 0  # the log's page is for leads
    assert "Signed in" in client.get(reverse("own-sign-ins")).content.decode()


def test_changes_of_password_and_factors_are_traced(pt, client):
    enter(client, pt.username)
    change = {"old_password": PASSWORD, "new_password1": "a new one 2026"}
    client.post(reverse("own-password"), change | {"new_password2": "a new one 2026"})
    secret = totp.generate_secret()
    factors.add_authenticator(pt, factors.Authenticator.Kind.APP, "App", secret, 0)
    factors.remove_second_factors(pt)
    entries = AuditEntry.everywhere.filter(
        act__in=(Act.PASSWORD, Act.FACTOR_ADDED, Act.FACTOR_REMOVED), by=pt
    )
    told = [(entry.act, entry.about, entry.address) for entry in entries.order_by("pk")]
    assert told[-3:] == [
        ("password", str(pt), "127.0.0.0/24"),
        ("factor_added", "App", ""),  # by no request, but by this test
        ("factor_removed", "App", ""),
    ]


def test_new_recovery_codes_and_a_rejected_passkey_are_traced(pt, client):
    factors.add_authenticator(pt, factors.Authenticator.Kind.APP, "App", "x", 0)
    enter(client, pt.username)
    forged = {"passkey": '{"id": "forged"}'}
    assert client.post(reverse("second-factor"), forged).status_code == 200
    assert [row[:2] for row in traced(Act.SIGN_IN_FAILED)] == [("sign_in_failed", pt.username)]
    browser = Client()
    browser.force_login(pt)
    browser.post(reverse("recovery-codes"), {"password": "wrong"})
    assert traced(Act.RECOVERY_CODES) == []
    browser.post(reverse("recovery-codes"), {"password": PASSWORD})
    assert [row[:2] for row in traced(Act.RECOVERY_CODES)] == [("recovery_codes", pt.username)]
    assert "Made new recovery codes" in browser.get(reverse("own-sign-ins")).content.decode()


@pytest.mark.parametrize(
    ("page", "form"),
    [("add-passkey", {"passkey": "{}"}), ("add-passkey", {}), ("add-app", {"code": "000000"})],
)
def test_a_factor_that_is_not_accepted_is_traced(pt, page, form):
    browser = Client(headers={"host": "localhost"})  # passkeys need a name
    browser.force_login(pt)
    browser.get(reverse(page))
    assert browser.post(reverse(page), form).status_code == 200
    assert not factors.authenticators_of(pt).exists()
    entry = AuditEntry.everywhere.filter(act=Act.REFUSED).get()
    assert (entry.by, entry.about, entry.count) == (pt, reverse(page), 1)
    browser.post(reverse(page), form)
    entry.refresh_from_db()
    assert entry.count == 2  # repeats are counted


def test_wrong_passkeys_lock_out_passkeys_alone(pt, client):
    secret = totp.generate_secret()
    code = totp.generate_code(secret, int(NOW.timestamp()) // totp.TIME_STEP_S - 100)
    then = NOW - 100 * timedelta(seconds=totp.TIME_STEP_S)
    assert factors.add_app(pt, secret, code, then)
    enter(client, pt.username)
    for _ in range(5):
        answer = client.post(reverse("second-factor"), {"passkey": "{}"})
    assert answer.status_code == 429
    assert [row[0] for row in traced(Act.LOCK_OUT)] == ["lock_out"]
    right = totp.generate_code(secret, int(timezone.now().timestamp()) // totp.TIME_STEP_S)
    assert client.post(reverse("second-factor"), {"code": right}).status_code == 302


def test_a_password_that_a_lead_gives_is_traced_with_the_account(world, pt):
    lead = world.people[Role.LEAD]
    url = reverse("admin:auth_user_password_change", args=[pt.pk])
    given = {"usable_password": "true", "password1": "a new one 2026"}
    world.lead.post(url, given | {"password2": "a new one 2026"})
    entry = AuditEntry.everywhere.filter(act=Act.PASSWORD, by=lead).get()
    assert entry.about == f"{pt}: {pt}"


def test_a_token_is_traced_at_its_first_use_in_each_network(world):
    token = bearer_token(world.people[Role.LEAD], Role.PT)
    program = Client(headers={"Authorization": f"Bearer {token}"})
    for address in ("192.0.2.7", "192.0.2.9", "198.51.100.4", "192.0.2.7"):
        audit_log.recent_views = Recent()  # long after
        assert program.get("/api/v1/me", REMOTE_ADDR=address).status_code == 200
    assert [row[3] for row in traced(Act.TOKEN_USE)] == ["192.0.2.0/24", "198.51.100.0/24"]


def test_what_is_refused_is_traced_and_repeats_are_counted(world):
    client = client_of(world, Role.RESEARCHER)
    for _ in range(3):
        assert client.get("/admin/rehab/patient/").status_code == 403
        assert client.get("/api/v1/patients").status_code == 403
    entries = AuditEntry.everywhere.filter(act=Act.REFUSED).order_by("pk")
    assert [(entry.about, entry.count) for entry in entries] == [
        ("/admin/rehab/patient/", 3),
        ("/api/v1/patients", 3),
    ]
    assert {entry.by for entry in entries} == {world.people[Role.RESEARCHER]}


def test_after_some_minutes_the_same_is_an_entry_of_its_own(world):
    for minutes in (0, 4, 6):
        now = NOW + minutes * audit_log.REPEAT_AFTER / 5
        actor = world.people[Role.PT]
        record_counted(build_entry(Act.REFUSED, actor, about="/x/", now=now))
    assert [row[-1] for row in traced(Act.REFUSED)] == [2, 1]


def test_a_repeat_is_never_counted_in_the_row_of_somebody_else(world):
    """A row that was rolled back is remembered, and another one gets its key."""
    pt, lead = world.people[Role.PT], world.people[Role.LEAD]
    with transaction.atomic():
        record_counted(build_entry(Act.REFUSED, pt, about="/lost/", now=NOW))
        (lost,) = AuditEntry.everywhere.filter(about="/lost/")
        transaction.set_rollback(True)
    AuditEntry(pk=lost.pk, **vars_of(build_entry(Act.REFUSED, lead, about="/x/", now=NOW))).save()
    record_counted(build_entry(Act.REFUSED, pt, about="/lost/", now=NOW))
    counted = AuditEntry.everywhere.filter(act=Act.REFUSED).order_by("pk")
    assert [(entry.by, entry.count) for entry in counted] == [(lead, 1), (pt, 1)]


def vars_of(entry: AuditEntry) -> dict[str, Any]:
    """Return what an entry says."""
    fields = ("clinic_id", "at", "by", "through", "act", "about", "address")
    return {name: getattr(entry, name) for name in fields}


# --- who reads it ---------------------------------------------------------------------------------


def test_people_see_where_they_are_signed_in_and_what_was_tried(pt, client):
    enter(Client(), pt.username, "wrong", address="198.51.100.4")
    enter(client, pt.username)
    page = client.get(reverse("own-sign-ins")).content.decode()
    assert "Firefox, Windows" in page
    assert "192.0.2.0/24" in page
    assert "this one" in page
    assert "Failed to sign in" in page
    assert "198.51.100.0/24" in page


def test_nobody_sees_the_sign_ins_of_others(world, pt, client):
    enter(client, pt.username)
    for role in (Role.LEAD, Role.RESEARCHER):
        page = client_of(world, role).get(reverse("own-sign-ins")).content.decode()
        assert "192.0.2.0/24" not in page


def test_ending_all_ends_every_browser_of_this_account_and_no_other(world, pt, client):
    elsewhere, researcher = Client(), client_of(world, Role.RESEARCHER)
    for browser in (client, elsewhere):
        enter(browser, pt.username)
        assert browser.get("/start/").status_code == 200
    assert client.post(reverse("end-sign-ins")).headers["Location"] == reverse("sign-in")
    for browser in (client, elsewhere):
        assert browser.get("/start/").status_code == 302
    assert researcher.get("/account/").status_code == 200
    assert traced(Act.SIGN_INS_ENDED)[0][1] == pt.username
    enter(client, pt.username)
    assert client.get(reverse("own-sign-ins")).content.decode().count("Firefox, Windows") == 1


def test_leads_read_the_sign_ins_of_their_clinic_alone(world, pt, client):
    enter(client, pt.username)
    log = reverse("admin:rehab_auditentry_changelist")
    assert "192.0.2.0/24" in world.lead.get(log).content.decode()
    others = client_of(build_world("birch"), Role.LEAD).get(log).content.decode()
    assert "192.0.2.0/24" not in others
    assert world.pt.get(log).status_code == 403


@pytest.mark.parametrize(
    ("agent", "name"),
    [
        (FIREFOX, "Firefox, Windows"),
        ("Mozilla/5.0 (X11; Linux x86_64) Chrome/130.0 Safari/537.36", "Chrome, Linux"),
        ("Mozilla/5.0 (X11; Linux x86_64) HeadlessChrome/1.0 Safari/537.36", "Chrome, Linux"),
        ("Mozilla/5.0 (iPhone; CPU OS 17_0) CriOS/130.0 Mobile Safari/604", "Chrome, iPhone"),
        ("Mozilla/5.0 (Windows NT 10.0) Chrome/130.0 Safari/537.36 Edg/130.0", "Edge, Windows"),
        ("Mozilla/5.0 (iPad; CPU OS 17_0 like Mac OS X) Version/17 Safari/604", "Safari, iPad"),
        ("Mozilla/5.0 (Linux; Android 14) Chrome/130.0 Mobile Safari/537.36", "Chrome, Android"),
        ("curl/8", ""),
        ("", ""),
    ],
)
def test_a_browser_is_told_in_two_words(agent, name):
    assert describe_browser(agent) == name
