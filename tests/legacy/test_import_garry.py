"""`import_garry`: what the original kept is here afterwards, once; damage changes nothing."""

from __future__ import annotations

import random
import re
import sqlite3
from collections.abc import Callable
from contextlib import closing
from datetime import datetime, timedelta
from io import StringIO
from pathlib import Path
from zoneinfo import ZoneInfo

import pytest
from django.core.management import CommandError, call_command

from rehab.boards.models import Leaderboard
from rehab.patients.erasure import erase
from rehab.people.consent.tombstones import is_reimport_blocked
from rehab.people.models import Clinic, ErasureReason, Patient, User
from rehab.people.roles import Role
from rehab.sessions.log import SessionMetric, Step
from rehab.sessions.models import TrainingSession
from tests.support.boards import board_of, figures_of
from tests.support.programs import Program, bearer_token
from tests.support.world import NOW, signed_in

pytestmark = pytest.mark.django_db

# The original's own tables (GARRY-Server/sqliteHelper.py): it names both in lower case later.
SCHEMA = """
CREATE TABLE IF NOT EXISTS Participants(participant_id INTEGER PRIMARY KEY, name TEXT NOT NULL);
CREATE TABLE IF NOT EXISTS Sessions(session_id INTEGER PRIMARY KEY, participant_id INTEGER,
    year INTEGER, month INTEGER, day INTEGER, start_time INTEGER NOT NULL,
    duration INTEGER NOT NULL, score INTEGER, feedback_type TEXT NOT NULL,
    threshold INTEGER NOT NULL,
    FOREIGN KEY(participant_id) REFERENCES Participants(participant_id));
"""
COLUMNS = "feedback_type, participant_id, start_time, day, month, year, score, duration, threshold"
INSERT = f"INSERT INTO sessions({COLUMNS}) VALUES ({{}})"  # noqa: S608 (a test's own)
SELECT = f"SELECT session_id, {COLUMNS} FROM sessions ORDER BY session_id"  # noqa: S608
UPDATE = "UPDATE sessions SET {} WHERE session_id = 1"
TYPES = ["Positive"] * 7 + ["Negative"] * 5 + ["Binary"] * 2 + ["Explicit"]
COUNT = len(TYPES)
GOALS = ["3.908", "4.051", "3.825", "2.658", "2.271"]
SCORES = {"Positive": (14, 1402), "Negative": (-220, -6), "Binary": (-112, 633), "Explicit": (0, 0)}
MADRID = ZoneInfo("Europe/Madrid")


@pytest.fixture
def clinic() -> Clinic:
    return Clinic.everywhere.create(name="Oak", time_zone="Europe/Madrid")


def write(path: Path, types: list[str]) -> Path:
    """Write a database as the original does, with a session of each type: all comes as text."""
    chance = random.Random(67)
    with closing(sqlite3.connect(path)) as database:
        database.executescript(SCHEMA)
        for name in ("Ann O'Brien", "Bo", "Cleo", "Dee"):
            database.execute("INSERT INTO participants(name) VALUES(?)", (name,))
        chance.shuffle(types := list(types))
        for index, kind in enumerate(types):
            start = datetime.fromisoformat("2023-09-01 09:30:01.123456") + timedelta(
                hours=31 * index
            )
            seconds = chance.uniform(3, 130)
            duration = f"0:{int(seconds // 60):02d}:{seconds % 60:09.6f}"
            low, high = SCORES[kind]
            row = (
                kind,
                str(chance.randint(1, 4)),
                str(start),
                str(start.day),
                str(start.month),
                str(start.year),
                str(chance.randint(low, high)),
                duration,
                chance.choice(GOALS),
            )
            database.execute(INSERT.format("?, ?, ?, ?, ?, ?, ?, ?, ?"), row)
        database.commit()
    return path


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return write(tmp_path / "data.db", TYPES)


@pytest.fixture
def short_file(tmp_path: Path) -> Path:
    """A database of as many sessions as a row that makes no sense has to stand out of."""
    return write(tmp_path / "data.db", TYPES[::2])


def alter(file: Path, *statements: str) -> None:
    with closing(sqlite3.connect(file)) as database:
        for statement in statements:
            database.execute(statement)
        database.commit()


def run(file: Path, *options: str) -> str:
    out = StringIO()
    call_command("import_garry", str(file), *options, stdout=out)
    return out.getvalue()


def refused(file: Path, *options: str) -> tuple[str, str]:
    """Return what was told, and why nothing was changed."""
    out = StringIO()
    with pytest.raises(CommandError) as caught:
        call_command("import_garry", str(file), *options, stdout=out)
    assert not Patient.everywhere.exists()
    assert not TrainingSession.everywhere.exists()
    return out.getvalue(), str(caught.value)


def counts(report: str) -> dict[str, list[int]]:
    rows = [line.split() for line in report.splitlines()]
    return {
        row[0]: [int(number) for number in row[1:]]
        for row in rows
        if row and row[0] in ("participants", "sessions")
    }


def test_ids_dates_scores_types_and_goals_are_those_of_the_original(file, clinic):
    report = run(file)
    assert counts(report) == {"participants": [4, 4, 0, 0], "sessions": [COUNT, COUNT, 0, 0]}
    with closing(sqlite3.connect(file)) as database:
        rows = database.execute(SELECT).fetchall()
    sessions = TrainingSession.everywhere.select_related("patient").order_by("legacy_id")
    scores = dict(SessionMetric.everywhere.values_list("session__legacy_id", "value"))
    for row, session in zip(rows, sessions, strict=True):
        pk, kind, participant, start, day, month, year, score, duration, goal = row
        assert session.legacy_id == pk
        assert (session.patient.code, session.patient.legacy_id) == (
            f"{participant}",
            participant,
        )
        assert session.clinic == clinic
        began = session.started_at.astimezone(MADRID)
        assert (began.year, began.month, began.day) == (year, month, day)
        assert began.replace(tzinfo=None) == datetime.fromisoformat(start)
        assert session.created_at == session.started_at
        minutes, seconds = duration.split(":")[1:]
        assert session.active_s == pytest.approx(int(minutes) * 60 + float(seconds))
        assert session.ended_at - session.started_at == timedelta(seconds=session.active_s)
        assert (session.valence, session.goal, session.state) == (kind.lower(), goal, "finished")
        assert session.to_plan().goal.value == goal
        assert scores.get(pk) == (None if kind == "Explicit" else score)
        assert session.legacy_row["score"] == score
        assert session.legacy_row["threshold"] == goal
    assert not Step.everywhere.exists()


def test_real_names_are_left_out_and_the_report_says_so(file, clinic):
    report = run(file)
    assert "4 name(s)" in report
    assert "1 explicit session(s)" in report
    assert [row.nickname for row in Patient.everywhere.order_by("pk")] == ["P1", "P2", "P3", "P4"]
    for row in [*Patient.everywhere.values(), *TrainingSession.everywhere.values()]:
        assert "Brien" not in str(row)


def test_importing_again_takes_only_what_is_new(file, clinic):
    run(file)
    before = list(TrainingSession.everywhere.values())
    assert counts(run(file)) == {"participants": [4, 0, 4, 0], "sessions": [COUNT, 0, COUNT, 0]}
    assert list(TrainingSession.everywhere.values()) == before
    alter(
        file,
        "INSERT INTO participants(name) VALUES('Eve')",
        INSERT.format("'Binary', 5, '2024-01-02 10:00:00.0', 2, 1, 2024, 7, '0:00:31.5', 4.0"),
    )
    assert counts(run(file)) == {"participants": [5, 1, 4, 0], "sessions": [COUNT + 1, 1, COUNT, 0]}
    patient = Patient.everywhere.get(legacy_id=5)
    patient.code, patient.nickname = "K7", "Rosa"  # a therapist's own; it stays
    patient.save()
    run(file)
    assert Patient.everywhere.get(legacy_id=5).nickname == "Rosa"


def test_no_imported_session_enters_a_board_whose_last_day_is_over(short_file, clinic):
    run(short_file)
    Patient.everywhere.update(boards="clinic")
    frozen = NOW.date() - timedelta(days=2)
    board = board_of(clinic, types="all", metric="hit_rate", display="top", names="code")
    Leaderboard.everywhere.update(frozen_on=frozen)  # as if that day were over since
    TrainingSession.everywhere.all().delete()
    assert run(short_file)
    assert figures_of(board) == {}


def test_who_was_erased_stays_away_with_all_sessions(file, clinic):
    run(file)
    bo = Patient.everywhere.get(legacy_id=2)
    walked = bo.sessions.count()
    erase(bo, ErasureReason.ASKED, None, NOW)
    said = run(file)
    assert counts(said) == {"participants": [4, 0, 3, 0], "sessions": [COUNT, 0, COUNT - walked, 0]}
    assert f"1 participant(s) who were erased here, and their {walked} session(s)" in said
    assert (Patient.everywhere.count(), TrainingSession.everywhere.count()) == (4, COUNT)
    elsewhere = Clinic.everywhere.create(name="Birch")
    assert counts(run(file, "--clinic", "Birch"))["participants"] == [4, 4, 0, 0]
    assert elsewhere.patients.filter(legacy_id=2).exists()


def test_of_whom_was_erased_nothing_is_kept_that_tells_the_number(file, clinic, settings):
    run(file)
    erase(Patient.everywhere.get(legacy_id=2), ErasureReason.ASKED, None, NOW)
    assert is_reimport_blocked(clinic.pk, 2)
    assert not is_reimport_blocked(clinic.pk, 1)
    settings.SECRET_KEY = "another server's"
    assert not is_reimport_blocked(clinic.pk, 2)


@pytest.mark.parametrize(("given", "shown"), [("'x9'", "'x9'"), ("NULL", "None")])
def test_a_participant_without_a_number_is_told_with_the_cure(given, shown, file, clinic):
    alter(
        file,
        "ALTER TABLE participants RENAME TO people",
        "CREATE TABLE Participants(participant_id INTEGER, name TEXT)",
        "INSERT INTO Participants SELECT * FROM people",
        f"INSERT INTO Participants VALUES({given}, 'Eva')",
    )
    report, _ = refused(file)
    place = 1 if given == "NULL" else 5  # they are read in the order of their numbers
    words = f"participant in row {place}: participant_id {shown} is no number. Give it a number"
    assert words in report
    assert counts(report) == {"participants": [5, 4, 0, 1], "sessions": [COUNT, COUNT, 0, 0]}
    assert "Done." in run(file, "--partial")


def test_a_dry_run_says_the_same_and_changes_nothing(file, clinic):
    told = run(file, "--dry-run")
    assert "Nothing was changed (--dry-run)." in told
    assert not Patient.everywhere.exists()
    assert not TrainingSession.everywhere.exists()
    assert told.splitlines()[:-1] == run(file).splitlines()[:-1]


def test_the_file_is_not_written_to(file, clinic):
    before = file.read_bytes()
    run(file)
    assert file.read_bytes() == before


# --- damage ---------------------------------------------------------------------------------------


def truncated(file: Path) -> None:
    file.write_bytes(file.read_bytes()[: file.stat().st_size // 2])


def scribbled(file: Path) -> None:
    data = bytearray(file.read_bytes())
    data[5000:9000] = random.Random(1).randbytes(4000)
    file.write_bytes(data)


DAMAGE: dict[str, tuple[Callable[[Path], object], str]] = {
    "missing": (lambda file: file.unlink(), "There is no file"),
    "empty": (lambda file: file.write_bytes(b""), "no table Participants"),
    "text": (lambda file: file.write_text("participant_id,name\n1,Ann\n" * 50), "SQLite database"),
    "truncated": (truncated, "whole copy"),
    "scribbled": (scribbled, "whole copy"),
    "no_sessions": (lambda file: alter(file, "DROP TABLE sessions"), "no table Sessions"),
    "no_score": (lambda file: alter(file, "ALTER TABLE sessions DROP score"), "lacks score"),
}


@pytest.mark.parametrize("kind", DAMAGE)
def test_a_damaged_file_gives_a_reason_and_changes_nothing(kind, file, clinic):
    harm, words = DAMAGE[kind]
    harm(file)
    _, problem = refused(file)
    assert words in problem
    assert problem.endswith("Nothing was changed.")
    refused(file, "--partial")


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ("feedback_type = 'Kind'", "feedback type 'Kind' is none of positive, negative"),
        ("month = 13", "year 2023, month 13, day 1 is no date"),
        ("year = NULL", "year None is no number"),
        ("day = 'x'", "day 'x' is no number"),
        ("start_time = 'noon'", "start_time 'noon' is no time of day"),
        ("duration = 'long'", "duration 'long' is no number"),
        ("duration = -1", "duration -1 is no duration"),
        ("score = 'NaN'", "score 'NaN' is no number"),
        ("threshold = 9e999", "threshold inf is no number"),
        ("threshold = 0", "A goal of 0 W/kg cannot be used"),
        ("threshold = 99", "A goal of 99 W/kg cannot be used"),
        ("feedback_type = x'00'", "it holds bytes"),
        ("participant_id = 77", "participant 77 is not in the file"),
        ("participant_id = 1.5", "participant_id 1.5 is no whole number"),
    ],
)
def test_a_row_that_makes_no_sense_is_told_and_nothing_is_changed(
    change, words, short_file, clinic
):
    alter(short_file, UPDATE.format(change))
    report, problem = refused(short_file)
    assert f"session 1: {words}" in report
    assert counts(report)["sessions"] == [8, 7, 0, 1]
    assert "--partial" in problem
    assert "Done." in run(short_file, "--partial")
    assert TrainingSession.everywhere.count() == 7


def test_a_code_of_another_patient_is_never_taken_over(file, clinic):
    other = Patient.everywhere.create(clinic=clinic, code="2", nickname="Rosa")
    with pytest.raises(CommandError, match="Nothing was changed"):
        run(file)
    report = run(file, "--partial")
    assert "participant 2: another patient of Oak has the code 2" in report
    assert "participant 2 could not be taken over" in report
    assert not TrainingSession.everywhere.filter(patient=other).exists()


def test_another_file_with_the_same_ids_is_not_mixed_in(file, clinic):
    run(file)
    alter(file, "UPDATE sessions SET score = 1 WHERE session_id = 3")
    with pytest.raises(CommandError, match="Nothing was changed"):
        run(file)
    assert "session 3: a session with this id but other contents" in run(file, "--partial")


def test_several_clinics_have_to_be_told_apart(file, clinic):
    birch = Clinic.everywhere.create(name="Birch")
    _, problem = refused(file)
    assert "Give --clinic with one of: Birch, Oak" in problem
    assert "no clinic 'Elm'" in refused(file, "--clinic", "Elm")[1]
    run(file, "--clinic", "Birch")
    assert TrainingSession.everywhere.filter(clinic=birch).count() == COUNT
    run(file, "--clinic", "Oak")
    assert TrainingSession.everywhere.count() == 2 * COUNT


def test_on_a_new_machine_the_first_clinic_is_made_unless_it_is_a_dry_run(file):
    run(file, "--dry-run")
    assert not Clinic.everywhere.exists()
    run(file)
    assert Clinic.everywhere.get().sessions.count() == COUNT


def test_a_start_before_midnight_keeps_its_own_day(file, clinic):
    alter(
        file,
        "UPDATE sessions SET start_time = '2023-08-31 23:59:50.000', year = 2023, month = 9,"
        " day = 1 WHERE session_id = 1",
        "UPDATE sessions SET start_time = '10:15' WHERE session_id = 2",
    )
    run(file)
    first, second = TrainingSession.everywhere.order_by("legacy_id")[:2]
    assert first.started_at.astimezone(MADRID).day == 31
    assert f"{second.started_at.astimezone(MADRID):%H:%M}" == "10:15"


# --- what people then see -------------------------------------------------------------------------


def test_pages_and_api_tell_an_imported_session_without_strides(file, clinic):
    run(file)
    pt = User.everywhere.create_user("pt", role=Role.PT, clinic=clinic)
    client = signed_in(pt)
    session = TrainingSession.everywhere.filter(valence="positive").first()
    assert session.source == "Original GARRY"
    score = SessionMetric.everywhere.get(session=session).value
    page = client.get(f"/sessions/{session.pk}/details/").content.decode()
    assert "No strides recorded: imported from the original GARRY" in page
    assert re.search(rf"Score</dt><dd>\s+<b>{score:,.0f}</b>", page)
    assert "left leg" not in page
    assert client.get(f"/sessions/{session.pk}/scores/").status_code == 200
    assert client.get(f"/sessions/{session.pk}/monitor/").status_code == 200
    history = client.get(f"/patients/{session.patient_id}/sessions/").content.decode()
    assert "imported" in history
    assert client.get(f"/patients/{session.patient_id}/").status_code == 200
    status, told = Program(bearer_token(pt, Role.PT)).get(f"/sessions/{session.pk}")
    assert (status, told["imported"], told["score"], told["trained_side"]) == (
        200,
        True,
        score,
        None,
    )


@pytest.mark.django_db(transaction=True)  # a change is written by a connection of its own
def test_an_imported_session_is_over_and_takes_no_change(file):
    run(file)
    clinic = Clinic.everywhere.get()
    program = Program(
        bearer_token(User.everywhere.create_user("pt", role="pt", clinic=clinic), "pt")
    )
    session = TrainingSession.everywhere.first()
    for kind in ("start", "goal", "finish", "abort"):
        status, problem = program.post(f"/sessions/{session.pk}/changes", kind=kind, value=3.0)
        assert (status, "is finished" in problem["message"]) == (409, True)
    assert not session.events.exists()
