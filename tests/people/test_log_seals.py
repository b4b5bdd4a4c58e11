"""The logs are append-only in the database itself, and a chain shows who got around that."""

# ruff: noqa: S608 (the SQL is the test's own)

from __future__ import annotations

import io
import json
from datetime import timedelta

import pytest
import time_machine
from django.core.management import CommandError, call_command
from django.db import IntegrityError, connection, transaction
from django.utils import timezone

from rehab.management.commands.doctor import examine_seals
from rehab.patients.retention import delete_old_logs
from rehab.people.audit import append_only_triggers, audit_log, history, seals
from rehab.people.audit.audit_log import Act, AuditEntry, Recent
from rehab.people.audit.history import HistoryEntry
from rehab.people.audit.seals import LogSeal, find_broken, seal_logs
from rehab.people.models import Patient
from rehab.people.roles import Role
from tests.support.world import NOW, World, build_world

pytestmark = [pytest.mark.django_db, pytest.mark.postgres]

LATER = NOW + timedelta(hours=1)
AUDIT, HISTORY, SEALS = (m._meta.db_table for m in (AuditEntry, HistoryEntry, LogSeal))


@pytest.fixture
def logged(world: World) -> World:
    """A clinic with entries in both logs, and no seal but those that the test makes."""
    with append_only_triggers.lifted("default"):
        LogSeal.everywhere.all().delete()
    for number in range(5):
        who = world.people[Role.PT]
        audit_log.record(
            Act.VIEW, who, patient_id=world.patient.pk, about=f"/patients/{number}/", now=NOW
        )
    world.patient.nickname = "Rosa"
    world.patient.save()
    return world


def run(sql: str) -> int:
    with transaction.atomic(), connection.cursor() as cursor:
        cursor.execute(sql)
        return int(cursor.rowcount)


# --- append-only ----------------------------------------------------------------------------------


@pytest.mark.parametrize("sealed", [False, True])
@pytest.mark.parametrize(
    "sql",
    [
        f"UPDATE {AUDIT} SET about = 'elsewhere'",
        f"UPDATE {AUDIT} SET at = '2020-01-01 00:00:00+00:00'",
        f"UPDATE {AUDIT} SET patient_id = NULL, about = ''",  # without saying that it is erased
        f"UPDATE {AUDIT} SET erased = TRUE, patient_id = NULL, about = '', salt = '', act = 'x'",
        f"UPDATE {AUDIT} SET digest = ''",
        f"UPDATE {AUDIT} SET count = count - 1",
        f"DELETE FROM {AUDIT}",
        f"UPDATE {HISTORY} SET changes = '{{}}'",
        f"UPDATE {HISTORY} SET by_id = NULL, object_id = 0",
        f"UPDATE {HISTORY} SET erased = TRUE, salt = '', changes = '{{\"nickname\": [1, 2]}}'",
        f"DELETE FROM {HISTORY}",
    ],
)
def test_the_database_itself_refuses_to_change_the_logs(logged, sql, sealed):
    if sealed:
        seal_logs(LATER)
    with pytest.raises(IntegrityError, match="append-only"):
        run(sql)
    assert list(find_broken()) == []


@pytest.mark.parametrize(
    "sql",
    [
        f"UPDATE {SEALS} SET digest = ''",
        f"UPDATE {SEALS} SET cut_at = sealed_at, last_id = 999",
        f"DELETE FROM {SEALS}",
    ],
)
def test_the_database_itself_refuses_to_change_seals(logged, sql):
    seal_logs(LATER)
    with pytest.raises(IntegrityError, match="append-only"):
        run(sql)


def test_an_entry_is_counted_until_it_is_sealed(logged, monkeypatch, tmp_path):
    monkeypatch.setattr(audit_log, "recent_entries", Recent())
    now = timezone.now()

    def stop() -> list[int]:
        who = logged.people[Role.PT]
        audit_log.record_counted(audit_log.build_entry(Act.ROBOT_STOP, who, now=now))
        stops = AuditEntry.everywhere.filter(act=Act.ROBOT_STOP).order_by("pk")
        return list(stops.values_list("count", flat=True))

    assert [stop(), stop()] == [[1], [2]]
    call_command("shiplogs", tmp_path / "logs.jsonl", stdout=io.StringIO())
    delete_old_logs(logged.clinic, now)
    assert stop() == [3]
    seal_logs(now + timedelta(hours=1))
    with pytest.raises(IntegrityError, match="append-only"):
        run(f"UPDATE {AUDIT} SET count = count + 1")
    assert stop() == [3, 1]  # its clock was set back: nothing is lost
    assert list(find_broken()) == []


# --- the chain ------------------------------------------------------------------------------------


def break_into(sql: str) -> None:
    """Change a log as somebody may who has the database's password."""
    with append_only_triggers.lifted("default"):
        assert run(sql)


def test_a_clock_that_was_ahead_keeps_nothing_from_being_sealed_or_counted(logged, monkeypatch):
    monkeypatch.setattr(audit_log, "recent_entries", Recent())
    who = logged.people[Role.PT]
    audit_log.record(Act.VIEW, who, about="ahead", now=NOW + timedelta(days=400))
    audit_log.record(Act.VIEW, who, about="right again", now=NOW)
    audit_log.record(Act.VIEW, who, about="new", now=LATER)
    seal_logs(LATER)
    sealed_to = LogSeal.everywhere.filter(log="AuditEntry").latest("last_id").last_id
    unsealed = AuditEntry.everywhere.filter(pk__gt=sealed_to)
    assert [row.about for row in unsealed] == ["new"]
    for at in (NOW + timedelta(days=400), LATER):
        audit_log.record_counted(audit_log.build_entry(Act.ROBOT_STOP, who, now=at))
    assert AuditEntry.everywhere.filter(act=Act.ROBOT_STOP, count=1).count() == 2
    assert list(find_broken()) == []


def test_whole_chains_are_sealed_in_batches_and_hold(logged, monkeypatch):
    monkeypatch.setattr(seals, "BATCH_ROWS", 2)
    build_world("birch")
    total = sum(model.everywhere.count() for model in seals.sealed_models().values())
    own_seals = LogSeal.everywhere.count()  # birch's world has one of no rows
    with append_only_triggers.lifted("default"):
        LogSeal.everywhere.all().delete()
    assert own_seals == 1
    assert seal_logs(LATER) == total
    assert seal_logs(LATER) == 0
    assert list(find_broken()) == []
    assert seals.count_unsealed(LATER) == 0
    chain = LogSeal.everywhere.filter(log="AuditEntry", clinic=logged.clinic)
    numbers = list(chain.values_list("number", flat=True))
    assert numbers == list(range(1, len(numbers) + 1))
    assert len(numbers) >= 3


def test_what_is_younger_waits(logged):
    assert seal_logs(NOW - timedelta(days=1)) == 0


@pytest.mark.parametrize(
    ("sql", "said"),
    [
        (f"UPDATE {AUDIT} SET about = 'x' WHERE about = '/patients/3/'", "was changed"),
        (f"UPDATE {AUDIT} SET count = 7 WHERE about = '/patients/3/'", "counted anew"),
        (f"DELETE FROM {AUDIT} WHERE about = '/patients/3/'", "added, removed"),
        (f"UPDATE {AUDIT} SET digest = salt WHERE about = '/patients/3/'", "added, removed"),
        (f"UPDATE {HISTORY} SET kind = 'deleted' WHERE model_name = 'Patient'", "was changed"),
        (f"UPDATE {SEALS} SET digest = previous WHERE number = 1", "the seal before is another"),
        (f"DELETE FROM {SEALS} WHERE number = 1", "the seal before is another"),
        (f"UPDATE {AUDIT} SET erased = TRUE WHERE about = '/patients/3/'", "was changed"),
    ],
)
def test_doctor_finds_what_was_done_with_the_databases_password(logged, monkeypatch, sql, said):
    monkeypatch.setattr(seals, "BATCH_ROWS", 2)
    seal_logs(LATER)
    break_into(sql)
    told = [diagnosis.state for diagnosis in examine_seals() if diagnosis.cure]
    assert any(said in state for state in told), told


def test_doctor_misses_a_trigger(logged):
    assert [one for one in examine_seals() if one.cure] == []
    append_only_triggers.remove("default")
    missing = [one.state for one in examine_seals() if "trigger" in one.state]
    append_only_triggers.install("default")
    assert "the trigger garry_rehab_auditentry_delete is missing" in missing


# --- the two ways left open -----------------------------------------------------------------------


def test_erasing_empties_values_and_the_chain_holds(logged):
    seal_logs(LATER)
    audit_log.anonymize_patient(logged.patient, "")
    history.erase_values("Patient", logged.patient.pk)
    assert list(find_broken()) == []
    entries = AuditEntry.everywhere.filter(act=Act.VIEW, clinic=logged.clinic, erased=True)
    assert {(entry.about, entry.salt) for entry in entries} == {("", "")}
    change = HistoryEntry.everywhere.filter(model_name="Patient").first()
    assert (change.changes, change.salt) == ({"nickname": None}, "")
    row = Patient.everywhere.get(pk=logged.patient.pk)
    assert row.nickname not in str(list(HistoryEntry.everywhere.values_list("changes")))


def test_retention_cuts_whole_batches_behind_their_seals(logged):
    old = NOW - timedelta(days=2000)
    for about in ("old", "older"):
        audit_log.record(Act.VIEW, logged.people[Role.PT], about=about, now=old)
    audit_log.record(Act.VIEW, logged.people[Role.PT], about="new", now=NOW)
    assert delete_old_logs(logged.clinic, LATER) == 2
    abouts = set(AuditEntry.everywhere.values_list("about", flat=True))
    assert "new" in abouts
    assert not {"old", "older"} & abouts
    assert LogSeal.everywhere.get(cut_at__isnull=False).last_at == old
    assert list(find_broken()) == []
    with pytest.raises(IntegrityError, match="append-only"):
        run(f"DELETE FROM {AUDIT}")


# --- elsewhere ------------------------------------------------------------------------------------


def test_the_logs_are_shipped_once_each_as_lines_of_json(logged, tmp_path):
    file = tmp_path / "logs.jsonl"

    def ship() -> str:
        out = io.StringIO()
        with time_machine.travel(LATER):
            call_command("shiplogs", file, stdout=out)
        return out.getvalue()

    assert "0 new" not in ship()
    assert "0 new seals" in ship()
    assert file.stat().st_mode & 0o777 == 0o600
    lines = [json.loads(line) for line in file.read_text().splitlines()]
    assert {line["log"] for line in lines} == seals.sealed_models().keys()
    rows = [row for line in lines for row in line["rows"] if line["log"] == "AuditEntry"]
    assert "/patients/3/" in {row["about"] for row in rows}
    assert {line["digest"] for line in lines} == set(
        LogSeal.everywhere.values_list("digest", flat=True)
    )
    audit_log.record(Act.VIEW, logged.people[Role.PT], about="next", now=NOW)
    assert "1 new seals" in ship()
    file.write_text("something else\n")
    with pytest.raises(CommandError, match="not a file of shiplogs"):
        ship()
