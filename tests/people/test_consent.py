"""Consent: to which words, noted with a tap, withdrawn with effect at once."""

from __future__ import annotations

import pytest
from django.core.exceptions import ValidationError
from django.db import IntegrityError, transaction
from django.test import Client
from django.urls import reverse

from rehab.boards.models import Leaderboard
from rehab.people.consent.models import Consent, ConsentText, Purpose
from rehab.people.consent.services import (
    active_consents,
    answered_purposes,
    current_text,
    offered_purposes,
    publish_text,
    record_consent,
    withdraw_consent,
)
from rehab.people.models import BoardsConsent, Clinic, Patient
from rehab.people.pages.consent import split_words
from rehab.people.roles import Role
from rehab.sessions.log import SessionEvent, SessionMetric, Step
from rehab.sessions.models import TrainingSession
from rehab.training.measures import InvalidSetting
from tests.support.boards import figures_of
from tests.support.world import NOW, World, client_of

pytestmark = pytest.mark.django_db
LOG = (TrainingSession, Step, SessionEvent, SessionMetric)


def tap(client: Client, patient: Patient, purpose: str, answer: str) -> Patient:
    url = reverse("consent", kwargs={"patient_id": patient.pk})
    assert client.post(url, {"purpose": purpose, "answer": answer}).status_code == 302
    patient.refresh_from_db()
    return patient


# --- words ----------------------------------------------------------------------------------------


def test_words_that_somebody_agreed_to_never_change(world):
    text = current_text(world.clinic)
    text.text = "Something else"
    with pytest.raises(IntegrityError, match="append-only"), transaction.atomic():
        text.save()


@pytest.mark.parametrize("networks", ["", "192.168.1.0/24"])
def test_a_clinic_begins_with_words_that_name_all_it_asks_for_but_are_its_own_to_change(networks):
    clinic = Clinic.everywhere.create(name="New", networks=networks)
    first = current_text(clinic)
    assert first.version == 1
    named = [purpose for purpose in Purpose if f"{purpose.label}:" in first.text]
    assert named == offered_purposes(clinic)
    assert (Purpose.REMOTE in named) == bool(networks)
    assert current_text(clinic) == first
    assert ConsentText.everywhere.filter(clinic=clinic).count() == 1


def test_new_words_are_a_new_version_and_old_consent_stays_with_the_old_ones(world):
    old = current_text(world.clinic)
    assert publish_text(world.clinic, old.text, None, NOW) == old  # nothing new in it
    new = publish_text(world.clinic, "New words", world.people[Role.LEAD], NOW)
    assert (new.version, new.written_by) == (old.version + 1, world.people[Role.LEAD])
    held = active_consents(world.patient)["research"]
    assert held.text == old
    record_consent(world.patient, Purpose.RESEARCH, world.people[Role.PT], NOW)
    assert active_consents(world.patient)["research"].text == new
    held.refresh_from_db()
    assert held.withdrawn_at == NOW


def test_a_lead_writes_the_words_and_others_do_not(world, pt):
    url = reverse("consent-text")
    assert pt.get(url).status_code == 403
    lead = world.lead
    words = "First line\nsecond\n\nCare: plans"
    assert lead.post(url, {"text": words.replace("\n", "\r\n")}).status_code == 302
    assert current_text(world.clinic).text == words
    assert "“Care:” The others" in lead.get(url).content.decode()  # how paragraphs begin
    assert "in force already" in lead.post(url, {"text": words}).content.decode()
    lost = lead.post(url, {"text": words.replace("Care:", "Care.")}).content.decode()
    assert "begins with “Care:” is missing" in lost
    assert lead.post(url, {"text": " "}).status_code == 200  # refused
    assert ConsentText.everywhere.filter(clinic=world.clinic).count() == 2


# --- the page -------------------------------------------------------------------------------------


def test_a_tap_notes_consent_and_another_withdraws_it_with_who_and_when(world, pt):
    tap(pt, world.patient, "care", "yes")
    row = active_consents(world.patient)["care"]
    assert (row.recorded_by, row.text) == (world.people[Role.PT], current_text(world.clinic))
    tap(pt, world.patient, "care", "yes")  # nothing new
    assert Consent.everywhere.filter(patient=world.patient, purpose="care").count() == 1
    tap(pt, world.patient, "care", "no")
    row.refresh_from_db()
    assert row.withdrawn_by == world.people[Role.PT]
    assert row.withdrawn_at >= row.given_at
    assert "care" not in active_consents(world.patient)


def test_what_follows_a_purposes_words_belongs_to_them(world):
    text = "First.\n\nCare: a\n\nmore\n\nResearch: b\n\nLast."
    before, own, after = split_words(text, world.patient)
    assert (before, after) == ("First.", "Last.")
    assert own == {Purpose.CARE: "a\n\nmore", Purpose.RESEARCH: "b"}


def test_who_was_not_asked_has_no_answer_and_a_no_is_noted_once(world, pt):
    rosa = world.add_patient()
    publish_text(world.clinic, "Hello.\n\nCare: your therapists use it.\n\nBye.", None, NOW)
    url = reverse("consent", kwargs={"patient_id": rosa.pk})
    page = pt.get(url).content.decode()
    assert 'aria-pressed="true"' not in page
    assert page.count("not asked yet") == len(offered_purposes(world.clinic))
    assert (
        page.index("Hello.")
        < page.index("Bye.")  # that one may say no comes before the questions
        < page.index("Your therapists use it.")
        < page.index('value="yes"')
    )
    for _ in range(2):
        tap(pt, rosa, "care", "no")
        tap(pt, rosa, "boards", "own")
    page = pt.get(url).content.decode()
    assert page.count('aria-pressed="true"') == 2
    assert active_consents(rosa) == {}
    rows = list(Consent.everywhere.filter(patient=rosa))
    assert sorted(row.purpose for row in rows if row.is_refusal) == ["boards", "care"]
    assert "until" not in page  # nothing was given that could end
    tap(pt, rosa, "care", "yes")
    assert not active_consents(rosa)["care"].is_refusal


@pytest.mark.parametrize(
    ("purpose", "answer"), [("care", "maybe"), ("fame", "yes"), ("boards", "x")]
)
def test_what_was_not_offered_is_refused(world, pt, purpose, answer):
    before = list(Consent.everywhere.values_list("pk", "withdrawn_at"))
    tap(pt, world.patient, purpose, answer)
    assert list(Consent.everywhere.values_list("pk", "withdrawn_at")) == before


def test_the_page_says_where_the_words_have_changed_since(world, pt):
    url = reverse("consent", kwargs={"patient_id": world.patient.pk})
    assert b"words have changed since" not in pt.get(url).content
    publish_text(world.clinic, "New words", None, NOW)
    assert b"words have changed since" in pt.get(url).content


def test_a_patient_whom_two_take_in_at_once_is_told_by_the_form(world, pt, monkeypatch):
    find_good = Patient.full_clean

    def be_slower(patient, *args, **kwargs):
        find_good(patient, *args, **kwargs)
        monkeypatch.setattr(Patient, "full_clean", find_good)
        Patient.everywhere.create(clinic=world.clinic, code="R1", nickname="Rosa")

    monkeypatch.setattr(Patient, "full_clean", be_slower)
    given = {"nickname": "Rosa", "code": "R1", "paretic_side": "left"}
    page = pt.post(reverse("new-patient"), given)
    assert page.status_code == 200
    assert "Code R1 already exists: it is Rosa" in page.content.decode()
    assert Patient.everywhere.filter(code="R1").count() == 1


def test_the_demo_patient_is_one_and_takes_nobodys_code(world, pt):
    for _ in range(2):
        assert pt.post(reverse("demo")).status_code == 302
    demo = Patient.everywhere.get(code="demo")
    Patient.everywhere.filter(pk=demo.pk).update(simulated=False)
    page = pt.post(reverse("demo"), follow=True)
    assert "Demo has the code demo. Give that patient another code first." in page.content.decode()
    assert Patient.everywhere.filter(code="demo").count() == 1


def test_the_new_patient_form_notes_each_answer_and_what_was_not_asked(world, pt):
    given = {"nickname": "Rosa", "code": "R1", "paretic_side": "left"}
    answers = {"consent_care": "yes", "consent_research": "no", "consent_boards": "total"}
    assert pt.post(reverse("new-patient"), given | answers).status_code == 302
    rosa = Patient.everywhere.get(code="R1")
    assert set(active_consents(rosa)) == {"care", "boards"}
    assert answered_purposes(rosa) == {"care", "boards", "research"}
    assert rosa.boards == BoardsConsent.TOTAL
    pt.post(reverse("new-patient"), given | {"code": "R2"})
    assert not answered_purposes(Patient.everywhere.get(code="R2"))


# --- boards ---------------------------------------------------------------------------------------


def test_boards_with_others_need_consent(world):
    patient = world.add_patient()
    patient.boards = BoardsConsent.TOTAL
    with pytest.raises(ValidationError, match="consent to boards"):
        patient.full_clean()
    record_consent(patient, Purpose.BOARDS, None, NOW)
    patient.full_clean()


@pytest.mark.parametrize(("before", "asked"), [("own", "clinic"), ("clinic", "own")])
def test_the_admin_shows_boards_and_leads_to_where_they_are_agreed_to(before, asked, world, pt):
    tap(pt, world.patient, "boards", before)
    lead = world.lead
    url = reverse("admin:rehab_patient_change", args=[world.patient.pk])
    consent = reverse("consent", kwargs={"patient_id": world.patient.pk})
    assert f'href="{consent}"' in lead.get(url).content.decode()
    held = list(Consent.everywhere.values_list("pk", "withdrawn_at"))
    given = {"code": "c", "nickname": "n", "language": "en", "boards": asked}
    assert lead.post(url, given).status_code == 302
    stored = Patient.everywhere.get(pk=world.patient.pk)
    assert (stored.nickname, stored.boards) == ("n", before)
    assert list(Consent.everywhere.values_list("pk", "withdrawn_at")) == held


def test_every_level_of_boards_is_noted_and_who_goes_further_agrees_again(world, pt):
    Clinic.everywhere.update(boards_across=True)
    Consent.everywhere.filter(patient=world.patient, purpose="boards").delete()
    for answer in ("total", "across", "across", "clinic"):
        tap(pt, world.patient, "boards", answer)
    rows = Consent.everywhere.filter(patient=world.patient, purpose="boards").order_by("pk")
    assert [row.level for row in rows] == ["total", "across", "clinic"]
    assert [row.withdrawn_at is None for row in rows] == [False, False, True]
    page = pt.get(reverse("consent", kwargs={"patient_id": world.patient.pk})).content.decode()
    assert str(BoardsConsent.ACROSS.label) in page


def test_withdrawing_takes_the_patient_off_all_boards_at_once(world, pt):
    assert world.patient.pk in figures_of(world.rows[Leaderboard])
    patient = tap(pt, world.patient, "boards", "own")
    assert patient.boards == BoardsConsent.OWN
    assert patient.pk not in figures_of(world.rows[Leaderboard])
    assert tap(pt, patient, "boards", "total").boards == BoardsConsent.TOTAL
    assert "boards" in active_consents(patient)


# --- care -----------------------------------------------------------------------------------------


def test_a_clinic_may_need_consent_to_care_before_a_session(world, pt):
    consent = reverse("consent", kwargs={"patient_id": world.patient.pk})
    assert "no session without it" not in pt.get(consent).content.decode()
    world.begin_session()  # off, unless the clinic says so
    world.clinic.care_needs_consent = True
    world.clinic.save()
    with pytest.raises(InvalidSetting, match="not agreed to care.*Consent and data"):
        world.begin_session()
    tap(pt, world.patient, "care", "yes")
    world.begin_session()
    page = pt.post(consent, {"purpose": "care", "answer": "no"}, follow=True).content.decode()
    assert "This clinic sets up no session without it." in page
    assert f'href="{reverse("records", args=[world.patient.pk])}">End the training program' in page
    with pytest.raises(InvalidSetting):
        world.begin_session()
    Patient.everywhere.filter(pk=world.patient.pk).update(simulated=True)
    world.begin_session()


# --- remote view ----------------------------------------------------------------------------------

HERE, AWAY = "192.168.1.7", "203.0.113.9"


@pytest.mark.parametrize("name", ["monitor", "walk"])
def test_from_elsewhere_a_session_is_watched_with_consent_only(name, world, pt):
    session = world.begin_session()
    url, consent = reverse(name, args=[session.pk]), reverse("consent", args=[world.patient.pk])
    assert pt.get(url, REMOTE_ADDR=AWAY).status_code == 200  # no networks: nobody is asked
    assert 'value="remote"' not in pt.get(consent).content.decode()
    Clinic.everywhere.update(networks="192.168.1.0/24\n2001:db8::/48")
    for address, opens in (
        *((HERE, True), ("2001:db8:0:5::9", True), ("127.0.0.1", True)),
        *((AWAY, False), ("192.168.2.7", False), ("2001:db9::1", False), ("?", False)),
    ):
        answer = pt.get(url, REMOTE_ADDR=address)
        assert (answer.status_code == 200) == opens, address
    told = pt.get(url, REMOTE_ADDR=AWAY, follow=True)
    assert told.redirect_chain == [(consent, 302)]
    assert "has not agreed to remote view" in told.content.decode()
    tap(pt, world.patient, "remote", "yes")
    assert pt.get(url, REMOTE_ADDR=AWAY).status_code == 200
    tap(pt, world.patient, "remote", "no")
    assert pt.get(url, REMOTE_ADDR=AWAY).status_code == 302


def test_what_is_not_offered_can_be_withdrawn_but_not_given(world, pt):
    tap(pt, world.patient, "remote", "yes")
    assert "remote" not in active_consents(world.patient)
    record_consent(
        world.patient, Purpose.REMOTE, None, NOW
    )  # before the clinic took its networks away
    tap(pt, world.patient, "remote", "no")
    assert "remote" not in active_consents(world.patient)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("192.168.1.7/24", "is no network"),
        ("our floor", "is no network"),
        ("2001:db8:1:2:3::/80", "too small"),
    ],
)
def test_what_is_no_network_is_refused(text, words, world):
    world.clinic.networks = text
    with pytest.raises(ValidationError, match=words):
        world.clinic.full_clean()


# --- research -------------------------------------------------------------------------------------


def seen(world: World, role: Role = Role.RESEARCHER) -> set[bool]:
    return {model.objects.visible_to(world.people[role]).exists() for model in LOG}


def test_researchers_see_sessions_of_those_only_who_agreed(world, pt):
    assert seen(world) == {True}
    tap(pt, world.patient, "research", "no")
    assert seen(world) == {False}
    assert seen(world, Role.PT) == {True}
    client = client_of(world, Role.RESEARCHER)
    url = reverse("session", kwargs={"session_id": world.session.pk})
    assert client.get(url).status_code == 404
    assert client.get("/api/v1/sessions").json()["total"] == 0
    tap(pt, world.patient, "research", "yes")
    assert client.get(url).status_code == 200


def test_a_clinic_may_do_without_and_simulated_patients_need_none(world):
    withdraw_consent(world.patient, Purpose.RESEARCH, None, NOW)
    world.clinic.research_needs_consent = False
    world.clinic.save()
    assert seen(world) == {True}
    world.clinic.research_needs_consent = True
    world.clinic.save()
    Patient.everywhere.filter(pk=world.patient.pk).update(simulated=True)
    assert seen(world) == {True}
