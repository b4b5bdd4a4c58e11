"""Whoever looks at patients' data stands in the log, and nobody takes it out again."""

from __future__ import annotations

from datetime import timedelta

import pytest
from django.contrib import admin
from django.db import DatabaseError
from django.test import Client
from django.urls import get_resolver, reverse
from django.utils import timezone

from rehab.people.admin.audit import PAGES, name_of_page
from rehab.people.audit import access_log, audit_log
from rehab.people.audit.audit_log import (
    SIGN_IN_ACTS,
    Act,
    AuditEntry,
    Recent,
    truncate_address,
)
from rehab.people.models import Clinic, Patient, User
from rehab.people.roles import Role
from rehab.people.sign_in.factors.factors import Authenticator
from rehab.people.sign_in.tokens import ApiToken
from rehab.sessions.log import Step
from rehab.sessions.models import TrainingSession
from rehab.sessions.setup.protocol_models import MeasureDefinition, Protocol
from rehab.stations.models import Device
from tests.support.archives import body_of
from tests.support.extent import EVERYTHING
from tests.support.marks import mark
from tests.support.tablets import approved
from tests.support.tenancy import Route, all_routes, walk_patterns
from tests.support.world import NOW, client_of

pytestmark = pytest.mark.django_db


@pytest.fixture(autouse=True)
def nothing_noted_yet(monkeypatch):
    monkeypatch.setattr(audit_log, "recent_views", Recent())


def entries():
    """Return what was recorded of patients; `test_sign_in_log` looks at the rest."""
    rows = AuditEntry.everywhere.exclude(act__in=SIGN_IN_ACTS)
    return rows.exclude(about=mark("amber", AuditEntry)).order_by("pk")


# --- every route ----------------------------------------------------------------------------------

# Pages and calls that show nothing of patients. Whatever is not here must leave an entry.
SILENT = {
    *("account", "own-password", "set-up-second-factor", "add-app", "add-passkey"),
    *("sign-on", "sign-on-complete", "sign-on-ended", "sign-on-confirm", "sign-on-link"),
    *("remove-authenticator", "recovery-codes", "pair", "pair-phone", "consent-text", "export"),
    *("screen-size", "https", "certificate", "certificate-file", "trial-walk"),
    *(
        "catalog",
        "home",
        "healthz",
        "readyz",
        "tablet",
        "tablet-app",
        "tablet-state",
        "sensor",
        "sign-in",
        "second-factor",
        "confirm",
    ),
    *("check-recording", "add-recording-part", "first-steps", "first-steps-state"),
    "trial-state",
    *("new-station", "edit-station", "new-device"),
    *("own-sign-ins", "end-sign-ins", "help", "help-page", "problem-report"),
    *("studies", "new-study", "plan-study", "study-protocol", "study-protocol-pdf"),
    *("study-power", "study-size", "study-figures"),
    *("api:api-root", "api:openapi-json", "api:openapi-view", "api:show_me"),
    *("api:list_protocols", "api:list_stations", "api:list_boards", "api:list_measures"),
    *("api:show_capabilities",),
    *("admin:login", "admin:logout", "admin:jsi18n"),
    *("admin:password_change", "admin:password_change_done", "admin:auth_user_password_change"),
}


def is_silent(name: str) -> bool:
    """Return, apart from the code under test, whether a route shows nothing of patients."""
    bare = {
        *(
            "clinic",
            "user",
            "apitoken",
            "signongroup",
            "station",
            "device",
            "measuredefinition",
            "protocol",
            "composedgesture",
            "endpoint",
            "outboxmessage",
        ),
        *("feedbacktype", "preset", "questionnaire", "clinictest"),
    }
    return name in SILENT or any(name.startswith(f"admin:rehab_{noun}_") for noun in bare)


@pytest.mark.wide
@pytest.mark.parametrize(
    "role",
    [Role.PT, *(pytest.param(r, marks=pytest.mark.long) for r in (Role.LEAD, Role.RESEARCHER))],
)
def test_every_route_that_shows_patients_leaves_an_entry(world, monkeypatch, role):
    """A new page is in this test by itself; one that shows no patients says so and stands above."""
    shown = set()
    client = client_of(world, role, raise_request_exception=False)
    routes: dict[object, Route] = {}
    for route in all_routes((world,)):
        kind = route.name, route.model, route.url.partition("?")[2].partition("=")[0]
        routes.setdefault(route if EVERYTHING else kind, route)
    for route in routes.values():
        monkeypatch.setattr(audit_log, "recent_views", Recent())
        before = entries().count()
        response = client.get(route.url)
        body_of(response)
        noted = entries().count() - before
        if response.status_code == 200 and not is_silent(route.name):
            shown.add(route.name)
            assert noted == 1, f"{route.url} leaves {noted} entries"
            if route.model in (Patient, TrainingSession, Step) and "?" not in route.url:
                assert entries().last().patient == world.patient, route.url
        else:
            assert not noted, f"{route.url} ({response.status_code}) leaves an entry"
    assert len(shown) > 20
    if role != Role.RESEARCHER:
        missing = {"patient", "history", "session", "monitor", "walk"} - shown
        assert missing <= {"walk"}  # it has ended


def test_every_silent_route_is_one_that_there_is():
    assert {name for name, _, _ in walk_patterns(get_resolver())} >= SILENT


def test_which_admin_pages_lead_to_patients():
    for model in admin.site._registry:
        name = f"admin:rehab_{model._meta.model_name}_changelist"
        assert access_log.leads_to_patients(model) != is_silent(name), model
    assert access_log.leads_to_patients(Step)
    assert not any(map(access_log.leads_to_patients, (Clinic, MeasureDefinition, Protocol, Device)))


# --- who, whose, what -----------------------------------------------------------------------------


def test_an_entry_says_who_whose_what_when_and_from_which_network(world):
    url = reverse("history", kwargs={"patient_id": world.patient.pk})
    client_of(world, Role.PT, REMOTE_ADDR="192.0.2.77").get(url)
    entry = entries().get()
    assert (entry.by, entry.patient, entry.act) == (world.people[Role.PT], world.patient, Act.VIEW)
    assert (entry.about, entry.address) == (url, "192.0.2.0/24")
    assert entry.clinic == world.clinic


def test_a_program_is_noted_by_its_name_and_no_code_of_a_patient_is_kept(world):
    row = ApiToken(clinic=world.clinic, user=world.people[Role.LEAD], name="nightly", role=Role.PT)
    row.may_steer = True
    token = row.new_token()
    row.save()
    client = Client(headers={"Authorization": f"Bearer {token}"})
    assert client.get(f"/api/v1/users/{world.patient.code}").status_code == 200
    entry = entries().get()
    assert (entry.by, entry.through) == (world.people[Role.LEAD], "nightly")
    assert entry.patient == world.patient
    assert world.patient.code not in entry.about


def test_a_tablet_is_noted_as_itself(world):
    _, token = approved(world.device.station, "Door")
    url = reverse("scores", kwargs={"session_id": world.session.pk})
    Client(headers={"Authorization": f"Bearer {token}"}).get(url)
    entry = entries().get()
    assert (entry.by, entry.through, entry.patient) == (None, "Door (Tablet)", world.patient)


def test_a_page_that_asks_again_and_again_is_noted_once_in_five_minutes(world, monkeypatch):
    client = world.lead
    url = reverse("session", kwargs={"session_id": world.session.pk})
    for minutes, count in ((0, 1), (1, 1), (4, 1), (5, 2), (9, 2), (10, 3)):
        monkeypatch.setattr(timezone, "now", lambda m=minutes: NOW + timedelta(minutes=m))
        client.get(url)
        assert entries().count() == count, minutes


def test_changes_are_noted_each_time_and_refusals_never(world):
    client = world.pt
    url = reverse("screen", kwargs={"patient_id": world.patient.pk})
    for _ in range(2):
        client.post(url, {"screen_side": "left"})
    assert [entry.act for entry in entries()] == [Act.CHANGE, Act.CHANGE]
    client_of(world, Role.RESEARCHER).get(url)
    Client().get(url)
    client.get(reverse("patient", kwargs={"patient_id": 10**9}))
    assert entries().count() == 2


def test_a_page_costs_at_most_two_statements_more_and_one_that_polls_none(
    world, django_assert_num_queries, django_assert_max_num_queries
):
    client = world.lead
    request = client.get(reverse("monitor", kwargs={"session_id": world.session.pk})).wsgi_request
    request.resolver_match = get_resolver().resolve(request.path)
    response = client.get(request.path)
    with django_assert_num_queries(0):
        access_log.record_request(request, response, NOW)
    audit_log.recent_views = Recent()
    with django_assert_max_num_queries(4):  # whose session, the entry, and a savepoint around it
        access_log.record_request(request, response, NOW)


def test_care_goes_on_when_the_log_cannot_be_written_but_nothing_is_given_out(world, monkeypatch):
    def fail(*args, **kwargs):
        raise DatabaseError("the disk is full")

    monkeypatch.setattr(AuditEntry.everywhere, "bulk_create", fail)
    monkeypatch.setattr(AuditEntry, "save", fail)
    client = client_of(world, Role.LEAD, raise_request_exception=False)
    key = {"patient_id": world.patient.pk}
    assert client.get(reverse("patient", kwargs=key)).status_code == 200
    assert client.get(reverse("patient-data", kwargs=key)).status_code == 500
    assert client.get(reverse("export-sessions")).status_code == 500


def test_leads_read_it_in_the_admin_and_nobody_writes_there(world):
    audit_log.record(
        Act.EXPORT, world.people[Role.PT], patient_id=world.patient.pk, about="here", now=NOW
    )
    entry = entries().get()
    lead = world.lead
    changelist = reverse("admin:rehab_auditentry_changelist")
    assert "here" in lead.get(changelist).content.decode()
    for key, value in (
        ("patient__id__exact", world.patient.pk),
        ("by__id__exact", world.people[Role.PT].pk),
        ("act__exact", "export"),
        ("at__year", entry.at.year),
        ("q", world.patient.nickname),
    ):
        assert "here" in lead.get(changelist, {key: value}).content.decode(), key
    assert lead.post(reverse("admin:rehab_auditentry_change", args=[entry.pk])).status_code == 403
    assert lead.post(reverse("admin:rehab_auditentry_delete", args=[entry.pk])).status_code == 403
    assert lead.get(reverse("admin:rehab_auditentry_add")).status_code == 403
    for role in (Role.PT, Role.RESEARCHER):
        assert client_of(world, role).get(changelist).status_code == 403


def test_it_calls_pages_by_their_names(world):
    path = reverse("records", args=[world.patient.pk])
    world.lead.get(path)
    log = world.lead.get(reverse("admin:rehab_auditentry_changelist")).content.decode()
    assert f'<span title="{path}">Consent and data</span>' in log


@pytest.mark.parametrize(
    ("about", "name"),
    [
        ("/ws/session/15/monitor/", "Therapist’s page"),
        ("/ws/session/15/patient/", "Patient’s page"),
        ("/patients/<int:patient_id>/records/", "Consent and data"),
        ("/admin/", "Admin"),
        ("/admin/rehab/patient/3/change/", "Patients"),
        ("/api/v1/sessions", "/api/v1/sessions"),
        ("device: Kobuki", "device: Kobuki"),
    ],
)
def test_it_names_sockets_refused_pages_and_lists_of_the_admin(about, name):
    assert name_of_page(about) == name


def test_each_page_that_it_speaks_of_has_a_name():
    names = {
        name
        for name, _route, pattern in walk_patterns(get_resolver())
        if getattr(pattern.callback, "access", None) and getattr(pattern.callback, "patients", True)
    }
    assert "correct" in names
    assert not names - PAGES.keys()


@pytest.mark.parametrize(
    ("address", "kept"),
    [
        ("192.0.2.77", "192.0.2.0/24"),
        ("2001:db8:1:2:3::4", "2001:db8:1::/48"),
        ("", ""),
        ("unknown", ""),
    ],
)
def test_of_an_address_the_network_is_kept(address, kept):
    assert truncate_address(address) == kept


def test_what_was_noted_is_forgotten_in_its_turn(monkeypatch):
    monkeypatch.setattr(audit_log, "MAX_RECENT", 2)
    recent = Recent()
    assert [recent.is_new(key, NOW) for key in "abab"] == [True, True, False, False]
    assert recent.is_new("c", NOW)
    assert recent.is_new("a", NOW)


@pytest.mark.parametrize("model", [Device, ApiToken])
def test_a_new_token_is_noted(model, world):
    row = world.rows[model]
    ApiToken.everywhere.update(user=world.people[Role.LEAD])
    url = reverse(f"admin:rehab_{model.__name__.lower()}_changelist")
    world.lead.post(url, {"action": "renew_tokens", "_selected_action": row.pk})
    entry = entries().get(act=Act.TOKEN)
    assert (entry.by, entry.about) == (
        world.people[Role.LEAD],
        f"{model._meta.verbose_name}: {row}",
    )


def test_without_a_log_no_second_factor_goes_and_no_token_changes(world, monkeypatch):
    def fail(*args, **kwargs):
        raise DatabaseError("full")

    monkeypatch.setattr(AuditEntry, "save", fail)
    lead = client_of(world, Role.LEAD, raise_request_exception=False)
    for model, action in ((Device, "renew_tokens"), (User, "remove_second_factors")):
        url = reverse(f"admin:rehab_{model.__name__.lower()}_changelist")
        row = world.rows[model]
        assert lead.post(url, {"action": action, "_selected_action": row.pk}).status_code == 500
    device = world.device
    assert Device.everywhere.get(pk=device.pk).token_hash == device.token_hash
    assert Authenticator.everywhere.filter(user=world.rows[User]).exists()
