"""Allocations, events and marks of studies: sealed in the chain, and looked over at the end."""

# ruff: noqa: S608 (the SQL is the test's own)

from __future__ import annotations

from datetime import timedelta
from typing import Any

import pytest
from django.db import IntegrityError, connection, transaction
from django.db.models import ProtectedError

from rehab.management.commands.doctor import examine_seals
from rehab.people.audit import append_only_triggers
from rehab.people.audit.seals import LogSeal, find_broken, seal_logs
from rehab.people.models import User
from rehab.people.roles import Role
from rehab.studies.blinding import Task, give_mark, reveal_arms, take_mark
from rehab.studies.models import Study, StudyMark
from rehab.studies.participants import Allocation, Enrollment, StudyEvent, empty_reasons
from rehab.studies.registration.lifecycle import close
from tests.support.studies import enrolled, new_patient, running_study
from tests.support.world import NOW, World

pytestmark = [pytest.mark.django_db, pytest.mark.postgres]

LATER = NOW + timedelta(hours=1)
ALLOCATIONS, EVENTS, MARKS = (m._meta.db_table for m in (Allocation, StudyEvent, StudyMark))


@pytest.fixture
def study(world: World) -> Study:
    """A running study with a participant, a mark and an arm that was revealed."""
    with append_only_triggers.lifted("default"):
        LogSeal.everywhere.all().delete()  # the world's, of no rows
    study = running_study(world)
    enrollment = enrolled(study, new_patient(world))
    give_mark(study, world.people[Role.PT], Task.ASSESSOR, None, NOW)
    reveal_arms(enrollment, "Fell", emergency=True, by=world.people[Role.LEAD], now=NOW)
    return study


def run(sql: str) -> int:
    with transaction.atomic(), connection.cursor() as cursor:
        cursor.execute(sql)
        return int(cursor.rowcount)


BREAK_INS = [
    f"UPDATE {ALLOCATIONS} SET {connection.ops.quote_name('group')} = 'X'",
    f"UPDATE {ALLOCATIONS} SET at = '2020-01-01 00:00:00+00:00'",
    f"DELETE FROM {ALLOCATIONS}",
    f"UPDATE {EVENTS} SET reason = 'otherwise' WHERE kind = 'emergency'",
    f"UPDATE {EVENTS} SET by_id = NULL WHERE kind = 'emergency'",
    f"UPDATE {EVENTS} SET reason = '', about = '' WHERE kind = 'emergency'",
    f"DELETE FROM {EVENTS} WHERE kind = 'emergency'",
    f"UPDATE {MARKS} SET task = 'interim' WHERE task = 'assessor'",
    f"UPDATE {MARKS} SET ended_at = at",  # no event says who ended it
    f"DELETE FROM {MARKS}",
]


@pytest.mark.parametrize("sealed", [False, True])
@pytest.mark.parametrize("sql", BREAK_INS)
def test_the_database_itself_refuses_to_change_them(study, sql, sealed):
    if sealed:
        seal_logs(LATER)
    with pytest.raises(IntegrityError, match="append-only"):
        run(sql)
    assert list(find_broken()) == []


@pytest.mark.skipif(connection.vendor != "postgresql", reason="SQLite has no TRUNCATE")
@pytest.mark.parametrize("table", [ALLOCATIONS, EVENTS, MARKS])
def test_the_database_itself_refuses_to_empty_their_tables(table):
    with pytest.raises(IntegrityError, match="append-only"):
        run(f"TRUNCATE {table} CASCADE")


SEEN = [sql for sql in BREAK_INS if "ended_at" not in sql]  # an end is sealed as its event


@pytest.mark.parametrize("sql", SEEN)
def test_doctor_and_closing_find_what_was_done_with_the_databases_password(world, study, sql):
    seal_logs(LATER)
    assert {seal.log for seal in LogSeal.everywhere.filter(clinic=world.clinic)} >= {
        *("Allocation", "StudyEvent", "StudyMark")
    }
    with append_only_triggers.lifted("default"):
        assert run(sql)
    assert [one.state for one in examine_seals() if one.cure]
    close(study, None, LATER)
    assert "not as sealed" in closing(study).about


@pytest.mark.parametrize("sql", [sql for sql in SEEN if "DELETE" not in sql])
def test_a_row_that_is_not_sealed_yet_is_looked_over_as_well(study, sql):
    with append_only_triggers.lifted("default"):
        assert run(sql)
    assert [one for one in find_broken() if "was changed" in one]
    close(study, None, NOW)
    assert "not as sealed" in closing(study).about


def test_closing_says_that_all_is_as_it_was_sealed(study):
    seal_logs(LATER)
    close(study, None, LATER)
    head = LogSeal.everywhere.filter(log="StudyEvent", clinic=study.clinic).latest("number")
    assert closing(study).about == f"as sealed: {head.digest}"


def closing(study: Study) -> Any:
    return study.events.get(kind="closed")


def test_another_clinics_damage_is_not_this_studys(world, study):
    seal_logs(LATER)
    with append_only_triggers.lifted("default"):
        LogSeal.everywhere.filter(clinic=None).update(digest="")
    close(study, None, LATER)
    assert "not as sealed" not in closing(study).about


def test_a_mark_ends_with_the_event_that_says_so(study):
    seal_logs(LATER)
    take_mark(study.marks.get(), None, LATER)
    assert study.marks.get().ended_at == LATER
    seal_logs(LATER + timedelta(hours=1))
    assert list(find_broken()) == []


def test_an_erasure_empties_words_and_the_chain_holds(study):
    seal_logs(LATER)
    empty_reasons(Enrollment.everywhere.get(study=study).patient, "")
    assert not study.events.exclude(enrollment=None).exclude(reason="", salt="").exists()
    assert list(find_broken()) == []


def test_an_account_that_acted_in_a_study_stays(study):
    who = User.everywhere.create_user("who", role=Role.LEAD, clinic=study.clinic)
    reveal_arms(study.enrollments.get(), "Fell", emergency=True, by=who, now=NOW)
    with pytest.raises(ProtectedError):
        who.delete()
