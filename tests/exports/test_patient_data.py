"""What is given out holds everything, exactly, harmlessly, and for the right eyes."""

from __future__ import annotations

import io
import json
import secrets
import tracemalloc
from datetime import date, datetime, time
from typing import Any

import pytest
from asgiref.sync import sync_to_async
from django.core.management import CommandError, call_command
from django.db import connection
from django.test import AsyncClient, Client
from django.test.utils import CaptureQueriesContext
from django.urls import reverse

from rehab.boards.models import Leaderboard
from rehab.exports.archive import ZipResponse, write_csv, write_zip
from rehab.exports.codebook import TABLES
from rehab.exports.selection import PAGE_ROWS, Selection
from rehab.exports.session_table import SESSIONS
from rehab.exports.step_tables import STEPS
from rehab.patients.visits import plan_visit
from rehab.people.audit import append_only_triggers
from rehab.people.audit.audit_log import Act, AuditEntry
from rehab.people.consent.models import Purpose
from rehab.people.consent.services import withdraw_consent
from rehab.people.models import Clinic, Patient, User
from rehab.people.roles import Role
from rehab.sessions.corrections import CorrectedField, correct_session
from rehab.sessions.log import SessionEvent, SessionMetric, Step
from rehab.sessions.models import TrainingSession
from rehab.stations.models import Station
from rehab.training.changes import Change, ChangeKind
from rehab.training.phases import make_phase
from tests.support.archives import body_of, open_archive, rows_of
from tests.support.boards import figures_of
from tests.support.marks import mark
from tests.support.walks import walk
from tests.support.world import NOW, World, build_world, client_of

NAMED = {Patient, User, Station}


def fetch(world: World, role: Role = Role.LEAD) -> dict[str, str]:
    url = reverse("patient-data", kwargs={"patient_id": world.patient.pk})
    return open_archive(body_of(client_of(world, role).get(url)))


def to_number(text: str) -> float | None:
    return float(text) if text else None


def test_a_table_of_sessions_costs_the_same_however_many_there_are(world):
    user = world.people[Role.LEAD]

    def cost() -> int:
        chosen = Selection(user, TrainingSession.objects.visible_to(user), named=True)
        with CaptureQueriesContext(connection) as queries:
            told = list(SESSIONS.read(chosen))
        assert len(told) == TrainingSession.everywhere.count()
        return len(queries)

    before = cost()
    for _ in range(5):
        walk(world.patient, "positive", [3.0, 1.0])
    assert cost() == before


# --- one patient ----------------------------------------------------------------------------------


def test_a_patients_file_holds_everything_that_is_kept(world):
    files = fetch(world, Role.PT)
    assert set(files) == {
        *("README.txt", "patient.json", "consent.json", "codebook.csv"),
        *("visits.json", "family.json", "boards.json", "studies.json", "changes.json"),
        *("sessions.csv", "steps.csv", "events.csv", "corrections.csv", "incidents.csv"),
        *("feedback.csv", "answers.csv", "study_visits.csv", "assessments.csv", "tests.json"),
    }
    who = json.loads(files["patient.json"])
    assert (who["nickname"], who["code"]) == (world.patient.nickname, world.patient.code)
    agreed = json.loads(files["consent.json"])
    assert {row["purpose"] for row in agreed} == {"boards", "research"}
    assert agreed[0]["words"] == world.patient.consents.first().text.text
    assert len(rows_of(files["steps.csv"])) == Step.everywhere.count()
    assert len(rows_of(files["events.csv"])) == SessionEvent.everywhere.count()


def test_the_file_says_what_is_in_it_in_the_language_of_whoever_asks(world):
    Clinic.everywhere.update(language="es")
    for url in (reverse("patient-data", args=[world.patient.pk]), reverse("export-sessions")):
        readme = open_archive(body_of(client_of(world, Role.LEAD).get(url)))["README.txt"]
        assert "una fila por paso" in readme
        assert "Son datos de salud." in readme


# Where the file tells the rows of each model that leads to a patient. Who looked is told from the
# audit log (docs/privacy.md).
TOLD_IN = {
    "Consent": "consent.json",
    "Visit": "visits.json",
    "Assessment": "tests.json",
    "FamilyLink": "family.json",
    "Leaderboard_group": "boards.json",
    "TrainingSession": "sessions.csv",
    "Step": "steps.csv",
    "SessionSeal": "",  # digests
    "SessionEvent": "events.csv",
    "SessionMetric": "sessions.csv",
    "SessionCorrection": "corrections.csv",
    "Enrollment": "studies.json",
    "Screening": "studies.json",
    "StudyVisit": "studies.json",
    "RobotIncident": "incidents.csv",
    "QuestionnaireResponse": "answers.csv",
    "AuditEntry": None,
}
RENAMED = {
    "boards": "leaderboards",
    "alias": "animal_name",
    "blinded": "in_a_blinded_study",
    "legacy_id": "participant_of_the_original",
    "ended_at": "program_ended_at",
    "end_reason": "program_end_reason",
}


def test_no_model_that_leads_to_a_patient_is_forgotten(world):
    links = [
        link.related_model.__name__
        for model in (Patient, TrainingSession)
        for link in model._meta.get_fields(include_hidden=True)
        if link.auto_created and link.is_relation and not link.many_to_many
    ]
    assert set(links) == set(TOLD_IN)
    files = fetch(world)
    assert set(filter(None, TOLD_IN.values())) <= set(files)


def test_every_detail_of_a_patient_is_told(world):
    who = json.loads(fetch(world)["patient.json"])
    names = {field.name for field in Patient._meta.concrete_fields} - {"id"}
    assert set(who) == {RENAMED.get(name, name) for name in names}
    assert who["screen_text"] == "normal"


def test_visits_boards_and_earlier_values_are_told(world):
    patient, board = world.patient, world.rows[Leaderboard]
    plan_visit(patient, date(2031, 2, 3), time(9, 15))
    client_of(world).post(
        reverse("edit-patient", args=[patient.pk]),
        {"nickname": "Rosa", "code": "R-1", "paretic_side": "right"},
    )
    board.group.add(patient)
    files = fetch(world)
    visits = json.loads(files["visits.json"])
    assert {"day": "2031-02-03", "at": "09:15:00"} in visits
    row, *groups = json.loads(files["boards.json"])
    assert (row["board"], row["figure"]) == (board.name, figures_of(board)[patient.pk])
    assert {"in_the_group_of_the_board": board.name} in groups
    last = json.loads(files["changes.json"])[-1]
    assert last["before_and_after"]["nickname"] == [patient.nickname, "Rosa"]
    assert all(user.username not in files["changes.json"] for user in world.people.values())


def test_read_back_the_numbers_are_the_same_to_the_last_digit(world):
    with append_only_triggers.lifted("default"), append_only_triggers.lifted("default"):
        Step.everywhere.filter(number=4).update(value=0.1 + 0.2, time_s=1e-17, goal=1 / 3)
        Step.everywhere.filter(number=5).update(late=True)
    files = fetch(world)
    for row, step in zip(
        rows_of(files["steps.csv"]), Step.everywhere.order_by("number"), strict=True
    ):
        for column, field in (
            *(("time", "time_s"), ("value", "value"), ("shown", "shown"), ("goal", "goal")),
            *(("performance", "performance"), ("gain", "gain"), ("points", "points")),
        ):
            assert to_number(row[column]) == getattr(step, field), column
        assert (row["hit"], row["valid"]) == (
            "" if step.hit is None else str(step.hit).lower(),
            str(step.valid).lower(),
        )
        assert row["late"] == str(step.number == 5).lower()
        assert datetime.fromisoformat(row["received_at"]) == step.received_at
        assert row["reasons"].split() == step.reasons
        assert (row["phase_kind"], row["side"], row["trained"]) == ("training", "left", "true")
    session = rows_of(files["sessions.csv"])[0]
    for metric in SessionMetric.everywhere.filter(session=world.session):
        assert to_number(session[metric.slug]) == metric.value


def test_the_row_of_a_session_counts_the_strides_that_came_late_apart(world):
    session = walk(world.patient, "positive", [2.5, 1.5, 2.5, 1.5])
    steps = Step.everywhere.filter(session=session)
    with append_only_triggers.lifted("default"):
        steps.filter(number__lte=2).update(valid=False, reasons=["odd", "late"])
        steps.filter(number=3).update(valid=False, reasons=["gap"])
    counts = {row["session"]: row["late_strides"] for row in rows_of(fetch(world)["sessions.csv"])}
    assert counts[str(session.pk)] == "2"
    assert counts[str(world.session.pk)] == "0"


def test_each_step_says_under_which_feedback_type_it_was_taken(world):
    phases = (make_phase("training", strides=2), make_phase("catch"), make_phase("training"))
    session = walk(
        world.patient,
        "positive",
        [
            *(2.5, Change(ChangeKind.VALENCE, "negative"), 1.5, 2.5),
            *(Change(ChangeKind.PHASE, 2), 1.5, 2.5),
        ],
        phases=phases,
    )
    lead = world.people[Role.LEAD]
    correct_session(session, {CorrectedField.COUNTS: "no"}, "The sensor slipped.", lead, NOW)
    files = fetch(world)
    steps = [row for row in rows_of(files["steps.csv"]) if row["session"] == str(session.pk)]
    assert [row["feedback_type"] for row in steps] == [
        *("positive", "positive", "", "negative", "negative")
    ]
    assert [row["points"] for row in steps] == ["1", "0", "", "-1", "0"]
    (told,) = (row for row in rows_of(files["sessions.csv"]) if row["session"] == str(session.pk))
    assert (told["changed_to"], told["excluded"]) == ("negative", "true")
    rows = rows_of(files["corrections.csv"])
    (corrected,) = (row for row in rows if row["session"] == str(session.pk))
    assert (corrected["field"], corrected["old"], corrected["new"]) == ("counts", "yes", "no")
    assert (corrected["reason"], corrected["by"]) == ("The sensor slipped.", lead.username)


def test_giving_a_file_is_noted_each_time_with_who_and_whose(world):
    for _ in range(2):
        fetch(world, Role.PT)
    entries = AuditEntry.everywhere.filter(act=Act.EXPORT)
    assert {(e.by, e.patient) for e in entries} == {(world.people[Role.PT], world.patient)}
    assert entries.count() == 2


def test_an_imported_session_without_steps_or_log_is_in_it(world):
    TrainingSession.everywhere.filter(pk=world.session.pk).update(
        legacy_id=7, protocol=None, trained_side=""
    )
    with append_only_triggers.lifted("default"), append_only_triggers.lifted("default"):
        Step.everywhere.all().delete()
    row = rows_of(fetch(world)["sessions.csv"])[0]
    assert (row["imported"], row["protocol"], row["trained_side"]) == ("true", "", "")


# --- all sessions ---------------------------------------------------------------------------------


@pytest.mark.parametrize("role", [Role.LEAD, Role.RESEARCHER])
def test_all_sessions_go_out_by_pseudonyms_alone(role, world):
    response = client_of(world, role).get(reverse("export-sessions"))
    files = open_archive(body_of(response))
    whole = "\n".join(files.values())
    assert not any(mark("amber", model) in whole for model in NAMED)
    assert "patient.json" not in files
    for table in TABLES:
        assert {row["patient"] for row in rows_of(files[table.file])} == {world.patient.pseudonym}
    assert rows_of(files["sessions.csv"])[0]["source"] == ""
    assert {row["by"] for row in rows_of(files["events.csv"])} == {"person"}


def test_researchers_get_no_session_of_who_has_not_agreed(world):
    withdraw_consent(world.patient, Purpose.RESEARCH, None, NOW)
    response = client_of(world, Role.RESEARCHER).get(reverse("export-sessions"))
    files = open_archive(body_of(response))
    assert not any(rows_of(files[table.file]) for table in TABLES)


def test_therapists_and_strangers_do_not_take_all_sessions_along(world):
    assert client_of(world, Role.PT).get(reverse("export-sessions")).status_code == 403
    assert Client().get(reverse("export-sessions")).status_code == 302
    url = reverse("patient-data", kwargs={"patient_id": world.patient.pk})
    assert client_of(world, Role.RESEARCHER).get(url).status_code == 403


def test_a_nickname_that_is_a_formula_stays_text(world):
    TrainingSession.everywhere.update(source="=1+1")
    assert rows_of(fetch(world)["sessions.csv"])[0]["source"] == "'=1+1"


# --- size -----------------------------------------------------------------------------------------


def test_pages_of_steps_join_without_a_gap(world):
    step = Step.everywhere.get(number=1)
    columns = {f.attname: getattr(step, f.attname) for f in Step._meta.concrete_fields}
    numbers = range(11, 2 * PAGE_ROWS + 1)
    Step.everywhere.bulk_create(Step(**columns | {"id": None, "number": n}) for n in numbers)
    user = world.people[Role.LEAD]
    sessions = TrainingSession.objects.visible_to(user)
    rows = STEPS.read(Selection(user, sessions, named=False))
    assert [row.number for row in rows] == list(range(1, 2 * PAGE_ROWS + 1))


@pytest.mark.long
def test_memory_does_not_grow_with_the_number_of_steps():
    row = (1, "P-ABCDEFGH", 1, 1.07, NOW, "left", True, 0.1 + 0.2, 1.0, 1 / 3)

    def peak(count: int) -> int:
        parts = write_zip([("steps.csv", write_csv(["x"] * 10, (row for _ in range(count))))])
        tracemalloc.start()
        for _part in parts:
            pass
        _, most = tracemalloc.get_traced_memory()
        tracemalloc.stop()
        return most

    peak(100)
    assert peak(40_000) < peak(4_000) + 200_000


async def test_served_by_asgi_it_comes_part_by_part():
    made = []

    def texts():
        for number in range(200):
            made.append(number)
            yield secrets.token_hex(5_000)

    response = ZipResponse([("steps.csv", texts())], "x.zip")
    first = [part async for part in _few(response, 1)]
    assert first
    assert len(made) < 200
    assert response["Content-Disposition"] == 'attachment; filename="x.zip"'


@pytest.mark.django_db(transaction=True)
async def test_by_asgi_a_patients_file_is_as_whole_as_any(transactional_db):
    world = await sync_to_async(build_world)("birch")
    client = AsyncClient()
    await sync_to_async(client.force_login)(world.people[Role.LEAD])
    url = reverse("patient-data", kwargs={"patient_id": world.patient.pk})
    response: Any = await client.get(url)
    files = open_archive(b"".join([part async for part in response]))
    assert len(rows_of(files["steps.csv"])) == 10
    assert world.patient.nickname in files["patient.json"]


async def _few(response, count):
    iterator = aiter(response)
    for _ in range(count):
        yield await anext(iterator)
    await iterator.aclose()


# --- manage.py export -----------------------------------------------------------------------------


def test_the_command_writes_what_the_account_may_see(world, tmp_path):
    file = tmp_path / "all.zip"
    file.write_text("from before, for all to read")
    file.chmod(0o644)
    researcher = world.people[Role.RESEARCHER]
    call_command("export", file, "--as", researcher.username, stdout=io.StringIO())
    files = open_archive(file.read_bytes())
    assert len(rows_of(files["steps.csv"])) == 10
    assert file.stat().st_mode & 0o077 == 0
    entry = AuditEntry.everywhere.filter(act=Act.EXPORT).get()
    assert (entry.by, entry.through, entry.clinic) == (None, "server console", world.clinic)
    code = world.patient.code
    with pytest.raises(CommandError, match="sees no patient"):
        call_command("export", file, "--as", researcher.username, "--patient", code)
    lead = world.people[Role.LEAD].username
    call_command("export", file, "--as", lead, "--patient", code, stdout=io.StringIO())
    assert code in open_archive(file.read_bytes())["patient.json"]
    with pytest.raises(CommandError, match="account"):
        call_command("export", file, "--as", "nobody")
    with pytest.raises(CommandError, match="cannot be written"):
        call_command("export", tmp_path / "no" / "x.zip", "--as", lead)
