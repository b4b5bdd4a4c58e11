"""A study's files in the export: everybody allocated, all versions, a check of the allocation."""

from __future__ import annotations

import json
import subprocess
import sys
from datetime import timedelta
from pathlib import Path

import pytest

from rehab.exports.research.resumable_export import Package
from rehab.exports.research.study_files import VERIFIER
from rehab.people.consent.models import Purpose
from rehab.people.consent.services import withdraw_consent
from rehab.people.models import User
from rehab.people.roles import Role
from rehab.studies.allocation.scheme import Secret
from rehab.studies.enrolling import withdraw
from rehab.studies.models import Study, StudyMark
from rehab.studies.registration.allocation_secret import seal
from rehab.studies.registration.lifecycle import close, revise
from tests.support.archives import rows_of
from tests.support.studies import SEED, enrolled, new_patient, running_study
from tests.support.walks import visit
from tests.support.world import NOW, World

pytestmark = pytest.mark.django_db
LEVELS = [["severity", ["mild", "m\u00e4\u00dfig"]]]
LISTED = """number,severity,group
1,mild,A
2,mild,B
3,mild,A
1,m\u00e4\u00dfig,B
2,m\u00e4\u00dfig,A
"""


def exported(user: User, folder: Path, study: Study) -> dict[str, str]:
    package = Package.create(folder, user, study, shift_dates=False, now=NOW)
    for _ in package.advance(1e9):
        pass
    return {
        name: b"".join(
            piece.encode() if isinstance(piece, str) else piece for piece in pieces
        ).decode(errors="replace")  # Parquet is no text
        for name, pieces in package.files()
    }


def secret_of(method: str) -> Secret:
    if method == "list":
        from rehab.studies.allocation.groups_and_strata import Factor, Group
        from rehab.studies.allocation.lists import read_list

        groups = (Group(("A",)), Group(("B",)))
        return Secret(
            SEED, (), read_list(LISTED, groups, (Factor("severity", ("mild", "m\u00e4\u00dfig")),))
        )
    return Secret(SEED, (2, 4) if method == "blocks" else ())


def studied(world: World, method: str = "blocks") -> Study:
    """Return a study of five: one left, one was removed, nobody walked."""
    study = running_study(world, method=method, factors=LEVELS, sealed=seal(secret_of(method)))
    people = [
        enrolled(
            study,
            new_patient(world, number),
            levels=(LEVELS[0][1][number % 2],),
            keep_data=number != 3,
        )
        for number in range(5)
    ]
    withdraw(people[1], None, NOW + timedelta(hours=1))
    withdraw(people[3], None, NOW + timedelta(hours=1))
    study.title = "Another title"
    revise(study, "It named an arm.", None, NOW + timedelta(hours=2))
    return study


@pytest.mark.parametrize("method", ["blocks", "minimization", "list"])
def test_an_auditor_allocates_again_from_the_export_alone(world, tmp_path, method):
    study = studied(world, method)
    close(study, None, NOW + timedelta(days=1))
    files = exported(world.people[Role.RESEARCHER], tmp_path / "parts", study)
    folder = tmp_path / "study"
    folder.mkdir()
    for name, text in files.items():
        if name.startswith("studies/VAL/"):
            (folder / Path(name).name).write_bytes(text.encode())
    command = [sys.executable, "-I", folder / VERIFIER.name, folder]
    told = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (told.returncode, told.stderr) == (0, "")
    table = folder / "participants.csv"
    text = table.read_text("utf-8")
    first = rows_of(text)[0]
    changed = {"A": "B", "B": "A"}[first["group"]]
    lines = text.splitlines(keepends=True)
    lines[1] = lines[1].replace(f",{first['group']},", f",{changed},", 1)
    table.write_text("".join(lines), "utf-8", newline="")
    told = subprocess.run(command, capture_output=True, text=True, check=False)
    assert told.returncode == 1
    assert f"VAL-001 is in {changed}, drawn was {first['group']}" in told.stdout


def test_everybody_who_was_allocated_has_a_row_and_every_version_is_there(world, tmp_path):
    study = studied(world)
    close(study, None, NOW + timedelta(days=1))
    files = exported(world.people[Role.RESEARCHER], tmp_path / "parts", study)
    withdraw_consent(study.enrollments.get(code="VAL-001").patient, Purpose.RESEARCH, None, NOW)
    again = exported(world.people[Role.RESEARCHER], tmp_path / "again", study)
    assert len(rows_of(again["studies/VAL/participants.csv"])) == 5
    assert rows_of(again["studies/VAL/participants.csv"])[0]["pseudonym"] == ""
    rows = rows_of(files["studies/VAL/participants.csv"])
    assert [row["participant"] for row in rows] == [f"VAL-00{n}" for n in range(1, 6)]
    assert all(row["group"] in {"A", "B"} for row in rows)
    assert [bool(row["pseudonym"]) for row in rows] == [True, True, True, False, True]
    assert [bool(row["withdrawn_at"]) for row in rows] == [False, True, False, True, False]
    protocol = json.loads(files["studies/VAL/protocol.json"])
    assert [version["number"] for version in protocol["versions"]] == [1, 2]
    assert "8:seedseed" in protocol["draw_rule"]
    defined = {
        row["outcome"]: row["meaning"] for row in rows_of(files["studies/VAL/definitions.csv"])
    }
    assert "last 50" in defined["late_change"]
    assert "first visit's baseline" in defined["washout_change"]
    assert sum(int(row["allocated"]) for row in rows_of(files["studies/VAL/flow.csv"])) == 5


def test_before_the_end_nothing_tells_a_group(world, tmp_path):
    study = studied(world)
    files = exported(world.people[Role.RESEARCHER], tmp_path / "parts", study)
    mine = {name.rpartition("/")[2]: text for name, text in files.items() if "studies/" in name}
    assert set(mine) == {"protocol.json", "participants.csv", "definitions.csv", "checklists.csv"}
    assert {row["group"] for row in rows_of(mine["participants.csv"])} == {""}
    assert "allocation_secret" not in mine["protocol.json"]
    assert SEED not in "".join(files.values())
    assessor = User.everywhere.create_user("assessor", role=Role.PT, clinic=world.clinic)
    StudyMark.everywhere.create(study=study, user=assessor, task="assessor")
    told = exported(assessor, tmp_path / "other", study)
    assert not [name for name in told if name.startswith("studies/")]


def test_motion_data_has_the_arm_and_is_called_by_visits(world, tmp_path):
    study = running_study(world)
    patient = new_patient(world)
    session = visit(patient, "positive", 1, 0, 160)
    enrollment = enrolled(study, patient)
    enrollment.visits.filter(number=1).update(session=session)
    close(study, None, NOW + timedelta(days=1))
    files = exported(world.people[Role.RESEARCHER], tmp_path / "parts", study)
    [row] = files["bids/participants.tsv"].splitlines()[1:]
    assert enrollment.allocation.group in row.split("\t")
    assert "VAL-001" in row
    assert any("/ses-VALvisit01/" in name for name in files)
