"""A program that ends, a person who is erased, and what goes with time by itself."""

from __future__ import annotations

import io
from datetime import UTC, datetime, timedelta
from typing import Any

import pytest
from django.contrib.admin.models import LogEntry
from django.core.management import call_command
from django.core.serializers import serialize
from django.test import Client
from django.urls import reverse

from rehab.boards.models import Leaderboard
from rehab.patients.closure import SessionStillOpen, end_program, reopen_program
from rehab.patients.erasure import erase
from rehab.patients.retention import months_before, patients_past_retention
from rehab.patients.visits import Visit
from rehab.people.audit import audit_log
from rehab.people.audit.audit_log import Act, AuditEntry
from rehab.people.audit.history import HistoryEntry
from rehab.people.models import EndReason, ErasureReason, Patient
from rehab.people.roles import Role
from rehab.sessions.corrections import CorrectedField, SessionCorrection, correct_session
from rehab.sessions.log import SessionEvent, SessionMetric, Step
from rehab.sessions.models import TrainingSession
from rehab.training.measures import InvalidSetting
from tests.support.boards import figures_of
from tests.support.marks import mark
from tests.support.world import NOW, World, build_world, client_of, scoped_models

pytestmark = pytest.mark.django_db


def page_of(world: World, client: Client) -> str:
    url = reverse("patient", kwargs={"patient_id": world.patient.pk})
    return client.get(url).content.decode()


# --- the program --------------------------------------------------------------------------------


def test_an_ended_program_leaves_the_lists_and_is_found_by_name(world):
    client = world.pt
    key = {"patient_id": world.patient.pk}
    client.post(reverse("end-program", kwargs=key), {"reason": "moved"})
    world.patient.refresh_from_db()
    assert world.patient.ended_at is not None
    assert world.patient.end_reason == EndReason.MOVED
    address = reverse("patient", kwargs=key)
    assert address not in client.get(reverse("start")).content.decode()
    found = client.get(reverse("start"), {"q": world.patient.code}).content.decode()
    assert address in found


def test_an_ended_program_cannot_be_started_until_it_is_reopened(world):
    client = world.pt
    end_program(world.patient, EndReason.DONE, NOW)
    page = page_of(world, client)
    setup = reverse("setup", kwargs={"patient_id": world.patient.pk})
    assert f'action="{setup}"' not in page
    assert reverse("take-home", kwargs={"patient_id": world.patient.pk}) in page
    with pytest.raises(InvalidSetting, match="has ended"):
        world.begin_session()
    client.post(reverse("reopen", kwargs={"patient_id": world.patient.pk}))
    world.patient.refresh_from_db()
    assert (world.patient.ended_at, world.patient.end_reason) == (None, "")
    assert f'action="{setup}"' in page_of(world, client)
    world.begin_session()


def test_who_has_an_open_session_is_neither_ended_nor_erased(world):
    world.begin_session()
    for act in (
        lambda: end_program(world.patient, EndReason.DONE, NOW),
        lambda: erase(world.patient, ErasureReason.ASKED, None, NOW),
    ):
        with pytest.raises(SessionStillOpen, match="End it first"):
            act()
    url = reverse("end-program", kwargs={"patient_id": world.patient.pk})
    assert b"open session" in world.pt.post(url, {"reason": "done"}).content
    world.patient.refresh_from_db()
    assert world.patient.ended_at is None
    assert world.patient.nickname == mark("amber", Patient)


def test_the_page_asks_for_a_reason(world):
    url = reverse("end-program", kwargs={"patient_id": world.patient.pk})
    assert world.pt.post(url, {"reason": "bored"}).status_code == 200
    assert Patient.everywhere.get(pk=world.patient.pk).ended_at is None


# --- erasing --------------------------------------------------------------------------------------


def everything_stored() -> str:
    """Return every row of every model, and the admin's own notes, as text."""
    rows: list[Any] = [*scoped_models(), LogEntry]
    return "\n".join(serialize("json", model._base_manager.all()) for model in rows)


def test_erasing_leaves_nothing_that_leads_to_the_person(world):
    patient, lead = world.patient, world.lead
    secrets = {"nickname": "Rosamunde", "code": "CASE-4711", "body_mass_kg": 87.125}
    details = reverse("edit-patient", kwargs={"patient_id": patient.pk})
    lead.post(details, secrets | {"paretic_side": "left"})
    change = reverse("admin:rehab_patient_change", args=[patient.pk])
    given = secrets | {"language": "en", "screen_side": "right", "boards": "clinic", "blinded": ""}
    assert lead.post(change, given).status_code == 302
    TrainingSession.everywhere.filter(pk=world.session.pk).update(
        source="Recording rosamunde.csv",
        source_args=["recording", "/data/rosamunde.csv"],
        legacy_row={"name": "Rosamunde"},
        legacy_id=990_017,
    )
    Patient.everywhere.filter(pk=patient.pk).update(legacy_id=880_018)
    SessionEvent.everywhere.create(
        session=world.session, after_number=1, kind="pain", at=NOW, data={"note": "CASE-4711"}
    )
    bands = [{"from_performance": 0.0, "words": "Push, osamunde!", "confetti": "none"}]
    SessionEvent.everywhere.create(
        session=world.session,
        after_number=1,
        kind="feedback_text",
        at=NOW,
        data={"value": {"valence": "positive", "bands": bands}},
    )
    other = world.add_patient("Other")
    lead_user = world.people[Role.LEAD]
    for walker in (other, patient):  # given to somebody else, and back
        changes = {
            CorrectedField.PATIENT: walker.pseudonym,
            CorrectedField.NOTE: f"A note of osamunde {walker.code}",
        }
        correct_session(world.session, changes, "because CASE-47", lead_user, NOW)
    patient.refresh_from_db()
    known = [patient.pseudonym, patient.alias, "990017", "880018", "87.125", "osamunde", "CASE-47"]
    assert all(one in everything_stored() for one in known)

    url = reverse("erase", kwargs={"patient_id": patient.pk})
    assert lead.post(url, {"reason": "asked", "code": "CASE-4711"}).status_code == 302
    left = everything_stored()
    assert [one for one in known if one in left] == []
    patient.refresh_from_db()
    assert patient.erased_at is not None
    assert patient.pseudonym == patient.code
    assert not AuditEntry.everywhere.filter(patient=patient).exists()
    assert all(patient.pk not in figures_of(board) for board in Leaderboard.everywhere.all())
    assert not Visit.everywhere.filter(patient=patient).exists()
    walked = SessionCorrection.everywhere.filter(field=CorrectedField.PATIENT).order_by("pk")
    assert [row.new for row in walked][-2:] == [other.pseudonym, patient.pseudonym]


def test_erasing_keeps_the_figures_and_says_who_did_it(world):
    before = {model: model.everywhere.count() for model in (Step, SessionMetric, TrainingSession)}
    values = list(Step.everywhere.values_list("value", "points"))
    erase(world.patient, ErasureReason.ASKED, world.people[Role.LEAD], NOW)
    assert {model: model.everywhere.count() for model in before} == before
    assert list(Step.everywhere.values_list("value", "points")) == values
    entry = AuditEntry.everywhere.get(act=Act.ERASE)
    assert (entry.by, entry.at, entry.patient) == (world.people[Role.LEAD], NOW, None)
    change = HistoryEntry.everywhere.filter(model_name="Patient").first()
    assert change.changes.keys() >= {"nickname", "code"}
    assert not any(change.changes.values())


def test_an_imported_session_still_tells_its_score_once_erased(world):
    TrainingSession.everywhere.filter(pk=world.session.pk).update(legacy_id=17)
    erase(world.patient, ErasureReason.ASKED, None, NOW)
    world.session.refresh_from_db()
    assert world.session.legacy_id == -world.session.pk
    url = reverse("session", kwargs={"session_id": world.session.pk})
    assert world.pt.get(url).status_code == 200


def test_an_erased_patient_never_comes_back(world):
    erase(world.patient, ErasureReason.ASKED, None, NOW)
    reopen_program(world.patient)
    assert world.patient.ended_at == NOW
    client = world.lead
    consent = reverse("consent", kwargs={"patient_id": world.patient.pk})
    client.post(consent, {"purpose": "boards", "answer": "clinic"})
    assert Patient.everywhere.get(pk=world.patient.pk).boards == "own"
    assert "Reopen" not in page_of(world, client)
    details = reverse("edit-patient", kwargs={"patient_id": world.patient.pk})
    given = {"nickname": "Rosa", "code": "R-1", "paretic_side": "left"}
    assert b"This person is erased" in client.post(details, given).content
    assert Patient.everywhere.get(pk=world.patient.pk).nickname == "Erased"


@pytest.mark.parametrize(
    "given",
    [
        {"reason": "asked", "code": "another"},
        {"reason": "asked", "code": ""},
        {"reason": "retention", "code": mark("amber", Patient)},
        {"code": mark("amber", Patient)},
    ],
)
def test_only_the_patients_own_code_and_a_reason_erase(given, world):
    url = reverse("erase", kwargs={"patient_id": world.patient.pk})
    assert world.lead.post(url, given).status_code == 200
    assert Patient.everywhere.get(pk=world.patient.pk).erased_at is None


def test_only_leads_erase_and_only_in_their_clinic(world):
    url = reverse("erase", kwargs={"patient_id": world.patient.pk})
    given = {"reason": "asked", "code": world.patient.code}
    assert world.pt.post(url, given).status_code == 403
    assert client_of(build_world("birch"), Role.LEAD).post(url, given).status_code == 404
    assert Patient.everywhere.get(pk=world.patient.pk).erased_at is None
    records = reverse("records", kwargs={"patient_id": world.patient.pk})
    assert url not in world.pt.get(records).content.decode()


# --- retention ------------------------------------------------------------------------------------


def retain(*options: str) -> str:
    out = io.StringIO()
    call_command("retention", *options, stdout=out, stderr=out)
    return out.getvalue()


def last_walked(world: World, days: int) -> None:
    moment = datetime.now(UTC) - timedelta(days=days)
    TrainingSession.everywhere.filter(patient=world.patient).update(created_at=moment)
    Patient.everywhere.filter(pk=world.patient.pk).update(created_at=moment)
    Visit.everywhere.filter(patient=world.patient).update(day=moment.date())


@pytest.mark.parametrize(("days", "erased"), [(58, False), (63, True)])
def test_who_was_kept_long_enough_is_erased(days, erased, world):
    world.clinic.retention_months = 2
    world.clinic.save()
    last_walked(world, days)
    said = retain()
    world.patient.refresh_from_db()
    assert (world.patient.erased_at is not None) == erased
    assert f"{int(erased)} patient(s) erased" in said
    if erased:
        assert world.patient.erasure_reason == ErasureReason.RETENTION
        assert "0 patient(s) erased" in retain()


def test_who_was_imported_a_moment_ago_stays_however_old_the_sessions_are(world):
    world.clinic.retention_months = 2
    last_walked(world, 400)
    taken_in = datetime.now(UTC) - timedelta(days=58)
    Patient.everywhere.filter(pk=world.patient.pk).update(created_at=taken_in)
    assert not patients_past_retention(world.clinic, datetime.now(UTC)).exists()
    assert (
        patients_past_retention(world.clinic, datetime.now(UTC) + timedelta(days=5)).get()
        == world.patient
    )


@pytest.mark.parametrize(
    ("zone", "days", "stays"),
    [("UTC", 0, True), ("UTC", -1, False), ("Pacific/Honolulu", -1, True)],
)
def test_who_is_expected_again_stays_by_the_clinics_day(zone, days, stays, world):
    now = NOW.astimezone(UTC).replace(hour=8)  # in Honolulu it is still the day before
    world.clinic.retention_months, world.clinic.time_zone = 2, zone
    last_walked(world, 400)
    Visit.everywhere.filter(patient=world.patient).update(day=now.date() + timedelta(days))
    assert patients_past_retention(world.clinic, now).exists() == (not stays)


def test_without_a_wish_nobody_goes_and_each_clinic_has_its_own(world):
    birch = build_world("birch")
    birch.clinic.retention_months = 1
    birch.clinic.save()
    for one in (world, birch):
        last_walked(one, 5000)
    retain()
    assert Patient.everywhere.get(pk=world.patient.pk).erased_at is None
    assert Patient.everywhere.get(pk=birch.patient.pk).erased_at is not None


def test_a_dry_run_says_whom_and_changes_nothing(world):
    world.clinic.retention_months = 1
    world.clinic.save()
    last_walked(world, 400)
    before = everything_stored()
    assert f"would erase {world.patient.code}" in retain("--dry-run")
    assert everything_stored() == before


def test_an_open_session_holds_up_one_patient_and_no_other(world):
    world.clinic.retention_months = 1
    world.clinic.save()
    other = world.add_patient()
    world.begin_session()
    last_walked(world, 400)
    Patient.everywhere.filter(pk=other.pk).update(created_at=datetime.now(UTC) - timedelta(400))
    assert "End it first" in retain()
    assert Patient.everywhere.get(pk=world.patient.pk).erased_at is None
    assert Patient.everywhere.get(pk=other.pk).erased_at is not None


def test_simulated_patients_stay(world):
    world.clinic.retention_months = 1
    Patient.everywhere.filter(pk=world.patient.pk).update(simulated=True)
    assert not patients_past_retention(world.clinic, NOW + timedelta(days=5000)).exists()


def test_both_logs_go_when_the_clinic_has_kept_them_long_enough(world):
    now = datetime.now(UTC)
    for months, about in ((13, "old"), (11, "new")):
        at = months_before(now, months)
        audit_log.record(Act.VIEW, world.people[Role.PT], about=about, now=at)
        HistoryEntry.everywhere.create(
            clinic=world.clinic, model_name=about, object_id=1, kind="added", at=at
        )
    world.clinic.log_retention_months = 12
    world.clinic.save()
    retain("--dry-run")
    assert AuditEntry.everywhere.filter(about="old").exists()
    retain()
    assert not AuditEntry.everywhere.filter(about="old").exists()
    assert AuditEntry.everywhere.filter(about="new").exists()
    assert set(
        HistoryEntry.everywhere.filter(object_id=1, model_name__in=["old", "new"]).values_list(
            "model_name"
        )
    ) == {("new",)}


@pytest.mark.parametrize(
    ("moment", "months", "before"),
    [
        ("2026-03-31", 1, "2026-02-28"),
        ("2024-03-31", 1, "2024-02-29"),
        ("2026-01-15", 1, "2025-12-15"),
        ("2026-12-31", 12, "2025-12-31"),
        ("2026-11-21", 1200, "1926-11-21"),
    ],
)
def test_months_are_those_of_the_calendar(moment, months, before):
    there = datetime.fromisoformat(moment).replace(tzinfo=UTC)
    assert months_before(there, months) == datetime.fromisoformat(before).replace(tzinfo=UTC)
