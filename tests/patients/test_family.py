"""Family view: a link that shows a little, to who has it, until it ends; and then nothing."""

from __future__ import annotations

import io
import logging
import re
from datetime import datetime, time, timedelta

import pytest
from django.db import OperationalError
from django.test import Client
from django.urls import reverse

from garry_site.logs import JsonFormatter, LineFormatter
from rehab.patients import family
from rehab.patients.closure import end_program
from rehab.patients.erasure import erase
from rehab.patients.family import FamilyLink, FamilyLinkRefused, find_link, give_link
from rehab.patients.pages import family as page
from rehab.patients.visits import next_visit, plan_visit
from rehab.people.audit.audit_log import Act, AuditEntry
from rehab.people.consent.models import Consent, Purpose
from rehab.people.consent.services import record_consent, withdraw_consent
from rehab.people.models import EndReason, ErasureReason, Patient
from rehab.people.roles import Role
from rehab.people.token_buckets import TokenBuckets
from rehab.sessions.models import TrainingSession
from rehab.sessions.reports.better_or_worse import Result
from rehab.sessions.reports.patient_summary import describe_weeks
from rehab.studies.enrolling import withdraw
from tests.support.studies import STROKE, enrolled, running_study
from tests.support.world import NOW

pytestmark = pytest.mark.django_db


@pytest.fixture(autouse=True)
def calm_gate(monkeypatch):
    monkeypatch.setattr(page, "limit", TokenBuckets(burst=1000, interval_s=2.0))


@pytest.fixture
def agreed(world):
    """A clinic whose patient has agreed."""
    FamilyLink.everywhere.all().delete()
    record_consent(world.patient, Purpose.FAMILY, None, NOW)
    return world


def links_page(world):
    return reverse("family-links", kwargs={"patient_id": world.patient.pk})


def test_who_was_not_asked_is_asked_from_the_patients_records(world):
    asked = f'href="/patients/{world.patient.pk}/consent/">Ask about it'
    page = reverse("records", args=[world.patient.pk])
    Consent.everywhere.filter(purpose=Purpose.FAMILY).delete()
    assert asked in world.pt.get(page).content.decode()
    record_consent(world.patient, Purpose.FAMILY, None, NOW)
    assert asked not in world.pt.get(page).content.decode()


def give(world, weeks=4, name="yes"):
    """Give a link on the page; return its path."""
    answer = world.pt.post(links_page(world), {"weeks": weeks, "name": name})
    found = re.search(r"http://testserver(/family/[\w-]{43}/)", answer.content.decode())
    assert found, answer.content.decode()
    return found[1]


def acts():
    return [entry.act for entry in AuditEntry.everywhere.order_by("pk") if "family" in entry.act]


def shows(path, client=None):
    """Return what the page shows to who taps its button; empty where it shows nothing."""
    answer = (client or Client()).post(path)
    assert answer["Cache-Control"] == "no-store"
    assert answer["Referrer-Policy"] == "no-referrer"
    assert "noindex" in answer["X-Robots-Tag"]
    assert not answer.cookies
    return answer.content.decode() if answer.status_code == 200 else ""


def test_a_link_shows_sessions_and_the_next_visit_to_who_has_it(agreed):
    Patient.everywhere.filter(pk=agreed.patient.pk).update(code="CASE-4711")
    agreed.patient.refresh_from_db()
    path = give(agreed)
    text = shows(path)
    assert agreed.patient.nickname in text
    for secret in (agreed.patient.code, agreed.patient.pseudonym, "W/kg"):
        assert secret not in text
    assert acts() == [Act.FAMILY_LINK, Act.FAMILY_VIEW]
    entry = AuditEntry.everywhere.get(act=Act.FAMILY_VIEW)
    assert (entry.patient_id, entry.clinic_id) == (agreed.patient.pk, agreed.clinic.pk)
    link = FamilyLink.everywhere.get()
    assert (link.opened, link.token_hash in path) == (1, False)
    answer = agreed.pt.get(links_page(agreed)).content.decode()
    assert "opened once" in answer.replace("\n", " ")
    assert path not in answer  # it is shown this once


def test_a_preview_of_the_link_shows_and_counts_nothing(agreed):
    path = give(agreed)
    answer = Client().get(path)
    assert answer.status_code == 200
    assert agreed.patient.nickname not in answer.content.decode()
    assert FamilyLink.everywhere.get().opened == 0
    assert Act.FAMILY_VIEW not in acts()


def test_without_a_name_none_is_shown(agreed):
    assert agreed.patient.nickname not in shows(give(agreed, name="no"))


def test_it_needs_no_cookie_where_forgeries_are_checked(agreed):
    assert shows(give(agreed), Client(enforce_csrf_checks=True))


def test_the_therapists_forms_come_with_an_origin(agreed):
    """Where a page sends no referrer, browsers send the origin "null", which Django refuses."""
    answer = agreed.pt.get(links_page(agreed))
    assert answer["Referrer-Policy"] == "same-origin"


def leave_a_study(world):
    world.patient.stroke_month = STROKE
    world.patient.save()
    enrollment = enrolled(running_study(world), world.patient)
    withdraw(enrollment, None, NOW)
    world.patient.refresh_from_db()
    assert not world.patient.blinded


ENDS = {
    "the consent is withdrawn": lambda world: withdraw_consent(
        world.patient, Purpose.FAMILY, None, NOW
    ),
    "the program ends": lambda world: end_program(world.patient, EndReason.DONE, NOW),
    "the person is erased": lambda world: erase(world.patient, ErasureReason.ASKED, None, NOW),
    "a blinded study begins": lambda world: Patient.everywhere.filter(pk=world.patient.pk).update(
        blinded=True
    ),
    "the link expires": lambda world: FamilyLink.everywhere.update(expires_at=NOW),
    "the therapist ends it": lambda world: world.pt.post(
        reverse("end-family-link", kwargs={"link_id": FamilyLink.everywhere.get().pk})
    ),
}


@pytest.mark.parametrize("why", ENDS)
def test_a_link_ends_when(agreed, why):
    path = give(agreed)
    assert shows(path)
    TrainingSession.everywhere.update(state="finished")
    ENDS[why](agreed)
    assert not shows(path)
    assert Client().get(path).status_code == 404
    assert Client().get(path).content == Client().get(f"/family/{'a' * 43}/").content
    if why not in ("a blinded study begins", "the link expires", "the person is erased"):
        assert acts()[-1] == Act.FAMILY_END
        record_consent(agreed.patient, Purpose.FAMILY, None, NOW)
        Patient.everywhere.filter(pk=agreed.patient.pk).update(ended_at=None)
        assert not shows(path)  # for good


REFUSED = {
    "nothing was agreed": lambda world: withdraw_consent(world.patient, Purpose.FAMILY, None, NOW),
    "the study is blinded": ENDS["a blinded study begins"],
    "the study that was left goes on": leave_a_study,
    "the program has ended": ENDS["the program ends"],
    "five are in use": lambda world: [give(world) for _ in range(5)],
    "a study hides the sessions": lambda world: None,
}


@pytest.mark.parametrize("why", REFUSED)
def test_no_link_is_given_where(agreed, why, monkeypatch):
    TrainingSession.everywhere.update(state="finished")
    REFUSED[why](agreed)
    if why == "a study hides the sessions":
        monkeypatch.setattr(family, "hidden_patients", lambda _by: Patient.everywhere.all())
    before = FamilyLink.everywhere.count()
    answer = agreed.pt.post(links_page(agreed), {"weeks": 4, "name": "yes"}, follow=True)
    assert "/family/" not in re.sub(r"/patients/\d+/family/", "", answer.content.decode())
    assert FamilyLink.everywhere.count() == before


@pytest.mark.parametrize("weeks", [0, 3, 520])
def test_a_link_ends_in_weeks(agreed, weeks):
    by = agreed.people[Role.PT]
    with pytest.raises(FamilyLinkRefused, match="how long"):
        give_link(agreed.patient, weeks, by, "", NOW, shows_name=True)
    token = give_link(agreed.patient, 2, by, "", NOW, shows_name=True)
    assert find_link(token, NOW + timedelta(days=14) - timedelta(seconds=1)) is not None
    assert find_link(token, NOW + timedelta(days=14)) is None


def test_who_asks_too_often_waits(agreed, monkeypatch):
    path = give(agreed)
    monkeypatch.setattr(page, "limit", TokenBuckets(burst=3, interval_s=60.0))
    client = Client()
    assert [client.get(path).status_code for _ in range(5)] == [200, 200, 200, 429, 429]
    assert int(client.get(path)["Retry-After"]) > 0


def fail(*_: object) -> None:
    raise OperationalError("the database is away")


@pytest.mark.parametrize("formatter", [LineFormatter(), JsonFormatter()])
@pytest.mark.parametrize("is_away", [False, True], ids=["unknown link", "no database"])
def test_no_log_has_a_token(agreed, monkeypatch, caplog, is_away, formatter):
    told = io.StringIO()
    handler = logging.StreamHandler(told)
    handler.setFormatter(formatter)
    caplog.set_level(logging.DEBUG)
    caplog.set_level(logging.DEBUG, "django.request")
    path = give(agreed)
    if is_away:
        monkeypatch.setattr(page, "find_link", fail)
    else:
        ENDS["the link expires"](agreed)
    logging.getLogger().addHandler(handler)
    try:
        Client(raise_request_exception=False).post(path)
    finally:
        logging.getLogger().removeHandler(handler)
    assert "/family/.../" in told.getvalue()
    assert path.split("/")[2] not in told.getvalue()
    assert not AuditEntry.everywhere.filter(about__contains=path.split("/")[2]).exists()


def test_the_next_visit_is_one_that_is_to_come(agreed):
    now = datetime(2026, 5, 4, 12, 0, tzinfo=NOW.tzinfo)
    patient = agreed.patient
    for day, at in ((3, None), (4, time(9)), (11, time(9, 30))):
        plan_visit(patient, now.date().replace(day=day), at)
    visit = next_visit(patient.pk, now)
    assert (visit.day.day, visit.at) == (11, time(9, 30))


@pytest.mark.parametrize(
    ("rates", "goals", "word"),
    [
        ([0.5, 0.6, 0.5, 0.9, 0.8, 0.8], [2.0] * 6, "more steps"),
        ([0.7, 0.6, 0.8, 0.4, 0.5, 0.5], [2.0] * 6, "fewer steps"),
        ([0.6, 0.6, 0.6, 0.6, 0.6, 0.62], [2.0] * 6, "as many"),
        ([0.7, 0.6, 0.8, 0.4, 0.5, 0.5], [2.0] * 3 + [2.2] * 3, "was higher"),
        ([0.4, 0.5, 0.5, 0.7, 0.6, 0.8], [2.2] * 3 + [2.0] * 3, "was lower"),
        ([0.1, 0.1, 0.1, 0.1, 0.9], [2.0] * 5, ""),
    ],
)
def test_the_sentence_says_what_was_and_judges_nobody(rates, goals, word):
    said = describe_weeks([Result(*one) for one in zip(rates, [None] * 6, goals, strict=False)])
    assert word in said if word else said == ""
