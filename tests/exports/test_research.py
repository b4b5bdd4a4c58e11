"""The export for analysis: resumable, sealed, pseudonymous, and the same scores when replayed."""

from __future__ import annotations

import csv
import io
import json
import os
import zipfile
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any

import pytest
from django.core.management import CommandError, call_command
from django.urls import reverse

from rehab.exports.codebook import TABLES
from rehab.exports.research import resumable_export as packages
from rehab.exports.research.dates import shift_of, without_clocks
from rehab.exports.research.resumable_export import Package, sessions_for
from rehab.exports.selection import Selection
from rehab.exports.step_tables import FEEDBACK
from rehab.patients.erasure import erase
from rehab.people.audit import append_only_triggers
from rehab.people.audit.audit_log import Act, AuditEntry
from rehab.people.consent.models import Purpose
from rehab.people.consent.services import withdraw_consent
from rehab.people.models import ErasureReason, Patient, User
from rehab.people.roles import Role
from rehab.sessions.live.session.aggregate import SessionAggregate
from rehab.sessions.log import Step
from rehab.sessions.models import TrainingSession
from rehab.sources.recording import read_recording
from rehab.studies.enrolling import withdraw
from rehab.studies.registration.lifecycle import close
from rehab.studies.visits import Place, next_visit, start_session
from rehab.training.changes import Change, ChangeKind
from rehab.training.fold import SessionFold
from rehab.training.measures import InvalidSetting
from rehab.training.phases import make_phase
from rehab.training.scoring import RULES_VERSION
from rehab.training.steps import Measurement, Side
from tests.support.archives import body_of, rows_of
from tests.support.studies import enrolled, new_patient, running_study
from tests.support.walks import visit, walk
from tests.support.world import NOW, client_of, store

pytestmark = pytest.mark.django_db


def export(user: User, folder: Path, *, study: Any = None, shift_dates: bool = False) -> Package:
    package = Package.create(folder, user, study, shift_dates=shift_dates, now=NOW)
    for _ in package.advance(1e9):
        pass
    assert package.progress.is_done
    return package


def unpack(package: Package) -> dict[str, bytes]:
    return {
        name: b"".join(p.encode() if isinstance(p, str) else p for p in pieces)
        for name, pieces in package.files()
    }


def table(files: dict[str, bytes], name: str) -> list[dict[str, str]]:
    return rows_of(files[name].decode())


def walked_visit(enrollment: Any) -> TrainingSession:
    session = start_session(enrollment, Place(), None, NOW)
    session.state, session.started_at, session.ended_at = "finished", NOW, NOW
    session.save()
    return session


# --- what it holds --------------------------------------------------------------------------------


def test_tables_are_those_of_the_plain_export_with_a_typed_codebook(world, tmp_path):
    walk(world.patient, "positive", [2.5, 1.5, None, 2.5])
    lead = world.people[Role.LEAD]
    files = unpack(export(lead, tmp_path / "x"))
    chosen = Selection(lead, sessions_for(lead, None), named=False)
    for each in TABLES:
        assert len(table(files, each.file)) == len(list(each.read(chosen)))
    codebook = table(files, "codebook.csv")
    assert {row["file"] for row in codebook} == {each.file for each in TABLES}
    kinds = {(row["file"], row["column"]): row["type"] for row in codebook}
    assert kinds["steps.csv", "hit"] == "boolean"
    assert {row["rules_version"] for row in codebook} == {str(RULES_VERSION)}
    for each in TABLES:
        for row in table(files, each.file):
            for column, cell in row.items():
                check_type(kinds[each.file, column], cell)


def check_type(kind: str, cell: str) -> None:
    if cell and kind in {"integer", "number"}:
        (int if kind == "integer" else float)(cell)
    elif cell and kind == "time":
        assert datetime.fromisoformat(cell).tzinfo is not None
    elif cell and kind == "boolean":
        assert cell in {"true", "false"}
    elif cell and kind == "json":
        json.loads(cell.removeprefix("'"))


def test_the_words_and_confetti_are_those_that_the_page_was_told(world):
    session = walk(
        world.patient,
        "positive",
        [2.5, Change(ChangeKind.VALENCE, "negative"), 1.5, 2.5, 1.0, (Side.RIGHT, 3.0), None],
        phases=(make_phase("training", strides=2), make_phase("training")),
    )
    lead = world.people[Role.LEAD]
    one = Selection(lead, TrainingSession.everywhere.filter(pk=session.pk), named=False)
    told = [row._asdict() for row in FEEDBACK.read(one)]
    assert [row["number"] for row in told] == [1, 2, 3, 4, 6]
    plan = session.to_plan()
    bands = plan.valence.band(1.25), plan.valence.band(0.75)
    assert [row["words"] for row in told[:2]] == [band.phrases[0] for band in bands]
    assert [row["confetti"] for row in told[:2]] == [band.confetti for band in bands]
    steps = {step.number: step.points for step in Step.everywhere.filter(session=session)}
    assert all(row["points"] == steps[row["number"]] for row in told[:4])
    assert told[3]["points"] < 0  # by the type that it was changed to
    assert told[-1]["kind"] == "missing"


def test_parquet_has_the_same_rows_with_types_and_units(world, tmp_path):
    parquet = pytest.importorskip("pyarrow.parquet")
    session = walk(world.patient, "positive", [2.5, 1.5, None])
    files = unpack(export(world.people[Role.LEAD], tmp_path / "x"))
    stored = parquet.read_table(io.BytesIO(files[f"parquet/steps/session-{session.pk}.parquet"]))
    assert stored.column("value").to_pylist() == [2.5, 1.5, None]
    assert str(stored.schema.field("received_at").type) == "timestamp[us, tz=UTC]"
    assert stored.schema.field("time").metadata[b"unit"] == b"s"
    assert stored.num_rows == 3


def test_a_replay_of_the_exported_recording_scores_the_same(world, tmp_path):
    walk(world.patient, "positive", [2.5])
    session = visit(world.patient, "positive", seed=7, days_ago=1, count=200)
    files = unpack(export(world.people[Role.LEAD], tmp_path / "x"))
    copy = tmp_path / "again.csv"
    copy.write_bytes(files[f"recordings/session-{session.pk}.csv"])
    recording = read_recording(copy, trained_side=Side.LEFT)
    fold, scored = SessionFold(session.to_plan()), []
    fold.change(Change(ChangeKind.START))
    changes = {e.after_number: e.value for e in session.events.filter(kind=ChangeKind.GOAL)}
    for stride in recording:
        step = fold.step(stride)
        scored.append((step.number, step.value, step.shown, step.goal, step.hit, step.points))
        if stride.number in changes:
            fold.change(Change(ChangeKind.GOAL, changes[stride.number]))
    names = ("number", "value", "shown", "goal", "hit", "points")
    steps = Step.everywhere.filter(session=session).order_by("number")
    assert scored == list(steps.values_list(*names))
    shown = [(s.recorded_shown, s.recorded_hit) for s in recording.strides]
    assert shown == list(steps.values_list("shown", "hit"))
    assert fold.score == session.metrics.get(slug="score").value


# --- who sees what --------------------------------------------------------------------------------


def test_a_researchers_archive_names_nobody(world, tmp_path):
    files = unpack(export(world.people[Role.RESEARCHER], tmp_path / "x", shift_dates=True))
    everything = b"\n".join([*files.values(), *(name.encode() for name in files)]).decode("latin-1")
    for secret in (world.patient.nickname, world.patient.code, world.people[Role.PT].username):
        assert secret not in everything
    assert world.patient.pseudonym in everything


def test_the_allocation_is_sealed_until_the_study_is_closed(world, tmp_path):
    study = running_study(world)
    enrollment = enrolled(study, new_patient(world))
    session = walked_visit(enrollment)
    lead = world.people[Role.LEAD]

    def told() -> dict[str, str]:
        files = unpack(export(lead, tmp_path / "x", study=study))
        [row] = table(files, "study_visits.csv")
        return row

    row = told()
    assert (row["session"], row["participant"]) == (str(session.pk), enrollment.code)
    assert (row["group"], row["arm"]) == ("", "")
    close(study, lead, NOW)
    assert told()["group"] == enrollment.allocation.group


def test_data_of_who_left_go_or_stay_as_was_agreed(world, tmp_path):
    study = running_study(world)
    kept, removed = (
        enrolled(study, new_patient(world, n), keep_data=keep)
        for n, keep in ((1, True), (2, False))
    )
    stays, goes = walked_visit(kept), walked_visit(removed)
    lead = world.people[Role.LEAD]
    package = export(lead, tmp_path / "x", study=study)
    assert set(package.keys) == {stays.pk, goes.pk}
    withdraw(kept, lead, NOW)
    withdraw(removed, lead, NOW)
    # Also from an export that was written before.
    files = unpack(package)
    assert {row["session"] for row in table(files, "sessions.csv")} == {str(stays.pk)}
    assert [row["withdrawn_at"] for row in table(files, "study_visits.csv")] == [""]
    again = unpack(export(lead, tmp_path / "y", study=study))
    assert [row["after_withdrawal"] for row in table(again, "study_visits.csv")] == ["true"]


@pytest.mark.parametrize("keep_data", [True, False])
def test_who_leaves_while_walking_walks_on_and_the_data_go_as_agreed(world, tmp_path, keep_data):
    patient = new_patient(world)
    enrollment = enrolled(running_study(world), patient, keep_data=keep_data)
    session = start_session(enrollment, Place(), None, NOW)
    aggregate = SessionAggregate(session)
    store(aggregate, aggregate.change(Change(ChangeKind.START), None, NOW))

    def stride(number: int) -> None:
        stored = Measurement(number, float(number), Side.LEFT, 2.0)
        store(aggregate, [aggregate.record_step(stored, NOW)])

    stride(1)
    withdraw(enrollment, world.people[Role.PT], NOW, reason="wants to stop the study")
    session.refresh_from_db()
    assert session.state == "running"
    assert not Patient.everywhere.get(pk=patient.pk).blinded
    stride(2)
    store(aggregate, aggregate.change(Change(ChangeKind.FINISH), None, NOW))
    session.refresh_from_db()
    assert (session.state, session.steps.count()) == ("finished", 2)
    files = unpack(export(world.people[Role.LEAD], tmp_path / "x"))
    told = {row["session"] for row in table(files, "steps.csv")}
    assert (str(session.pk) in told) == keep_data
    assert next_visit(enrollment) is not None
    with pytest.raises(InvalidSetting, match="has withdrawn"):
        start_session(enrollment, Place(), None, NOW)


def test_what_was_withdrawn_or_erased_after_it_was_written_is_not_given_out(world, tmp_path):
    researcher = world.people[Role.RESEARCHER]
    package = export(researcher, tmp_path / "x")
    assert table(unpack(package), "sessions.csv")
    withdraw_consent(world.patient, Purpose.RESEARCH, None, NOW)
    assert table(unpack(package), "sessions.csv") == []
    lead = export(world.people[Role.LEAD], tmp_path / "y")
    erase(Patient.everywhere.get(pk=world.patient.pk), ErasureReason.ASKED, None, NOW)
    assert table(unpack(lead), "sessions.csv") == []
    assert not [name for name in unpack(lead) if name.startswith(("bids", "fhir"))]


# --- dates ----------------------------------------------------------------------------------------


def test_dates_are_shifted_by_the_same_weeks_for_all_of_a_patient(world, tmp_path):
    first = walk(world.patient, "positive", [2.5, 1.5], days_ago=30)
    other = new_patient(world)
    walk(other, "positive", [2.5])
    lead = world.people[Role.LEAD]
    files = unpack(export(lead, tmp_path / "x", shift_dates=True))
    plain = unpack(export(lead, tmp_path / "y"))
    moved = set()
    for name in ("sessions.csv", "steps.csv", "events.csv", "answers.csv"):
        pairs = zip(table(files, name), table(plain, name), strict=True)
        for shifted, true in pairs:
            for column, cell in true.items():
                if column in {"at", "created_at", "started_at", "received_at", "asked_at"} and cell:
                    gap = datetime.fromisoformat(shifted[column]) - datetime.fromisoformat(cell)
                    moved.add((true["patient"], gap))
    assert dict(moved) == {p.pseudonym: shift_of(p.pseudonym) for p in (world.patient, other)}
    assert all(gap % timedelta(weeks=1) == timedelta() for _, gap in moved)
    assert all(gap < timedelta() for _, gap in moved)
    fhir = json.loads(files[f"fhir/session-{first.pk}.json"])
    assert (
        fhir["timestamp"][:10] == f"{first.began_at + shift_of(world.patient.pseudonym):%Y-%m-%d}"
    )
    everything = b"\n".join(files[n] for n in files if n != "README.txt")
    assert f"{NOW:%Y-%m-%d}".encode() not in everything


def test_a_clock_since_1970_tells_no_date(world, tmp_path, settings):
    session = walk(world.patient, "positive", [2.5, 1.5])
    for step in Step.everywhere.filter(session=session):
        with append_only_triggers.lifted("default"):
            Step.everywhere.filter(pk=step.pk).update(time_s=1.7e9 + step.number)
    user = world.people[Role.LEAD]
    files = unpack(export(user, tmp_path / "x", shift_dates=True))
    steps = [row for row in table(files, "steps.csv") if row["session"] == str(session.pk)]
    assert [float(row["time"]) for row in steps] == [0, 1]
    assert without_clocks({"a": [1.7e9, 2, True], "b": "x"}) == {"a": [None, 2, True], "b": "x"}
    before = shift_of("P-1")
    settings.SECRET_KEY = "another key of another server, long enough"
    assert shift_of("P-1") != before


# --- resuming -------------------------------------------------------------------------------------


def no_room(*_args: Any, **_options: Any) -> None:
    raise OSError("No room left on the disk.")


def test_an_export_goes_on_where_it_was_stopped(world, tmp_path, monkeypatch):
    for _ in range(3):
        walk(world.patient, "positive", [2.5, 1.5])
    user = world.people[Role.LEAD]
    whole = unpack(export(user, tmp_path / "whole"))
    package = Package.create(tmp_path / "x", user, None, shift_dates=False, now=NOW)
    assert [p.done for p in package.advance(0)] == [1]
    with monkeypatch.context() as patch:
        patch.setattr(packages, "write_part", no_room)
        with pytest.raises(OSError, match="No room"):
            list(package.advance(9))
    (package.folder / f"{package.keys[1]}.part").mkdir()  # as a power cut leaves it
    found = Package.find(package.folder, user, NOW)
    assert found.progress == (1, len(package.keys))
    list(found.advance(1e9))
    assert unpack(found) == whole
    assert Package.find(package.folder, world.people[Role.RESEARCHER], NOW) is None
    user.role = Role.RESEARCHER  # who is told less than a lead was
    assert Package.find(package.folder, user, NOW) is None
    user.role = Role.LEAD
    assert Package.find(package.folder, user, NOW + timedelta(hours=25)) is None
    assert not package.folder.exists()


def test_exports_that_nobody_fetches_go_by_when_they_were_begun(world, tmp_path):
    user = world.people[Role.LEAD]
    for name in ("kept", "old"):
        Package.create(tmp_path / name, user, None, shift_dates=False, now=NOW)
    (tmp_path / "old" / "export.json").unlink()  # a power cut: its folder tells when
    os.utime(tmp_path / "old", (0, 0))
    packages.discard_old(tmp_path, NOW + timedelta(hours=23))
    assert [one.name for one in tmp_path.iterdir()] == ["kept"]
    packages.discard_old(tmp_path, NOW + timedelta(hours=24))
    assert not list(tmp_path.iterdir())


def test_the_page_prepares_shows_progress_and_gives_it_out_on_the_record(world, settings, tmp_path):
    settings.DATA_DIR = tmp_path
    lead = client_of(world, Role.LEAD)
    assert lead.get(reverse("download-research"))["Location"] == reverse("export")
    assert lead.post(reverse("advance-research")).status_code == 404
    lead.post(reverse("prepare-research"), {"study": "", "shift_dates": "on"})
    page = lead.get(reverse("export")).content.decode()
    assert f'data-advance="{reverse("advance-research")}"' in page
    told = lead.post(reverse("advance-research")).json()
    assert told["done"] == told["total"] == 1
    answer = lead.get(reverse("download-research"))
    with zipfile.ZipFile(io.BytesIO(body_of(answer))) as archive:
        assert archive.testzip() is None
        assert "sessions.csv" in archive.namelist()
    about = AuditEntry.everywhere.filter(act=Act.EXPORT).values_list("about", flat=True)
    assert {reverse("prepare-research"), reverse("download-research")} <= set(about)
    lead.post(reverse("prepare-research"), {"discard": ""})
    assert not list((tmp_path / "exports").iterdir())
    assert client_of(world, Role.PT).post(reverse("prepare-research")).status_code == 403


def test_the_command_writes_the_same_and_goes_on(world, tmp_path, capsys):
    study = running_study(world)
    walked_visit(enrolled(study, new_patient(world)))
    user, file = world.people[Role.LEAD], tmp_path / "out.zip"
    named = {"username": user.username, "research": True}
    call_command("export", file, study="VAL", shift_dates=True, **named)
    with zipfile.ZipFile(file) as archive:
        rows = list(csv.DictReader(io.StringIO(archive.read("study_visits.csv").decode())))
    assert [row["participant"] for row in rows] == ["VAL-001"]
    assert "1 / 1 sessions" in capsys.readouterr().err
    assert not (tmp_path / "out.zip.parts").exists()
    (tmp_path / "out.zip.parts").mkdir()
    (tmp_path / "out.zip.parts" / "mine.txt").touch()
    for wrong, cure in (
        ({}, "Move it"),
        ({"study": "NONE"}, "short name"),
        ({"patient": "x"}, "go with --research"),
        ({"research": False, "study": "VAL"}, "go with --research"),
    ):
        with pytest.raises(CommandError, match=cure):
            call_command("export", file, **named | wrong)
    assert (tmp_path / "out.zip.parts" / "mine.txt").exists()
