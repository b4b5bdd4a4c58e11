"""`manage.py simulatestudy`: the same seed gives the same files, and the export holds them all."""

from __future__ import annotations

import io
import re
import zipfile
from pathlib import Path

import pytest
from django.core.management import CommandError, call_command

from rehab.people.audit.audit_log import Act, AuditEntry
from rehab.people.models import Patient, User
from rehab.studies.record.checklists import ITEMS
from rehab.studies.results.drawing import FIGURES, TABLES
from rehab.studies.simulation.example import PHASES
from tests.support.archives import rows_of

# The writer has a connection of its own.
pytestmark = [pytest.mark.django_db(transaction=True), pytest.mark.long]
PEOPLE = 6
FACTS = Path(__file__).parents[1] / "support/simulated_facts.json"


def simulate(clinic: str, folder: Path) -> str:
    out, progress = io.StringIO(), io.StringIO()
    options = {"seed": 4, "participants": PEOPLE, "clinic": clinic, "to": folder, "facts": FACTS}
    call_command("simulatestudy", **options, stdout=out, stderr=progress)
    assert f"{PEOPLE} of {PEOPLE} participants" in progress.getvalue()
    assert f"{PEOPLE} of {PEOPLE} sessions exported" in progress.getvalue()
    return out.getvalue()


def test_a_seed_gives_the_same_files_twice_and_all_of_it_is_exported(tmp_path):
    told = [simulate(name, tmp_path / name) for name in ("one", "other")]
    digests = {re.search("[0-9a-f]{64}", text).group() for text in told}
    assert len(digests) == 1
    files = {f"{name}.csv" for name in TABLES} | {f"{name}.svg" for name in FIGURES}
    lists = {f"{name}.txt" for name in ITEMS}
    assert {file.name for file in (tmp_path / "one").iterdir()} == {*files, *lists, "export.zip"}
    consort = (tmp_path / "one" / "CONSORT 2025.txt").read_text("utf-8")
    assert "6 assessed, 0 turned away" in consort
    assert "None of the investigators has any." in consort
    assert "A: 0 never began, 0 left later" in consort
    for name in files:
        assert (tmp_path / "one" / name).read_bytes() == (tmp_path / "other" / name).read_bytes()

    with zipfile.ZipFile(tmp_path / "one" / "export.zip") as archive:
        visits, steps = (
            rows_of(archive.read(name).decode()) for name in ("study_visits.csv", "steps.csv")
        )
    walked = {row["participant"]: row["group"] for row in visits}
    outcomes = rows_of((tmp_path / "one" / "outcomes.csv").read_text())
    assert walked == {row["participant"]: row["group"][0] for row in outcomes}
    assert len(walked) == PEOPLE
    assert len(steps) == PEOPLE * sum(phase.strides or 0 for phase in PHASES)
    assert {row["patient"] for row in steps} == {
        patient.pseudonym for patient in Patient.everywhere.filter(clinic__name="one")
    }

    assert AuditEntry.everywhere.filter(act=Act.EXPORT, clinic__name="one").count() == 1
    [exporter] = User.everywhere.filter(clinic__name="one")
    assert not exporter.has_usable_password()


def test_what_cannot_be_simulated_is_refused_with_the_cure(tmp_path):
    with pytest.raises(CommandError, match="2 to 2000"):
        call_command("simulatestudy", participants=1, to=tmp_path)
    with pytest.raises(CommandError, match="whole number from 0"):
        call_command("simulatestudy", seed=-1, to=tmp_path)
