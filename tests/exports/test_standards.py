"""BIDS and FHIR, checked by the validators of those who make the standards."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from rehab.exports.research.package import Package
from rehab.people.models import Patient
from rehab.people.roles import Role
from rehab.sessions.questionnaires import answer, ask, next_response
from tests.support.walks import visit, walk
from tests.support.world import NOW, World

pytestmark = pytest.mark.django_db
VALIDATOR = shutil.which("bids-validator-deno", path=str(Path(sys.executable).parent))


@pytest.fixture
def files(world: World, tmp_path: Path) -> Path:
    """Return the folder of an unpacked export with strides, events, answers and covariates."""
    Patient.everywhere.filter(pk=world.patient.pk).update(birth_year=1955, severity="mild")
    session = visit(world.patient, "positive", seed=3, days_ago=1, count=160)
    walk(world.patient, "negative", [2.5, None, 1.5])
    user = world.people[Role.RESEARCHER]
    ask(session, ["tlx"], NOW)
    response = next_response(world.people[Role.PT], session)
    for number, value in enumerate((5, None, 20, 0, 100, 35)):
        answer(response, number, value, NOW)
    package = Package.create(tmp_path / "parts", user, None, shift_dates=True, now=NOW)
    list(package.advance(1e9))
    out = tmp_path / "out"
    for name, pieces in package.files():
        place = out / name
        place.parent.mkdir(parents=True, exist_ok=True)
        place.write_bytes(b"".join(p.encode() if isinstance(p, str) else p for p in pieces))
    return out


@pytest.mark.skipif(VALIDATOR is None, reason="bids-validator-deno is not installed")
@pytest.mark.server  # starts a program
def test_the_bids_validator_finds_no_error(files):
    done = subprocess.run(
        [VALIDATOR, "--json", str(files / "bids")], capture_output=True, text=True, timeout=120
    )
    told = json.loads(done.stdout)
    issues = told["issues"]["issues"]
    assert [issue for issue in issues if issue["severity"] == "error"] == []
    assert told["summary"]["totalFiles"] > 8
    assert told["summary"]["tasks"] == ["walking"]
    # The detector detects: without its sidecar the run is refused.
    next((files / "bids").rglob("*_motion.json")).unlink()
    spoiled = subprocess.run(
        [VALIDATOR, "--json", str(files / "bids")], capture_output=True, text=True, timeout=120
    )
    found = json.loads(spoiled.stdout)["issues"]["issues"]
    assert any(issue["severity"] == "error" for issue in found)


def test_bundles_are_valid_fhir_r4b(files):
    bundle = pytest.importorskip("fhir.resources.R4B.bundle").Bundle
    made = sorted((files / "fhir").glob("*.json"))
    assert len(made) == 3
    kinds = set()
    for file in made:
        read = bundle.model_validate_json(file.read_text())
        kinds |= {entry.resource.get_resource_type() for entry in read.entry}
        known = {entry.fullUrl for entry in read.entry}
        for entry in read.entry:
            subject = getattr(entry.resource, "subject", None)
            assert subject is None or subject.reference in known
    assert kinds == {"Patient", "Encounter", "Observation", "QuestionnaireResponse"}
    spoiled = json.loads(made[0].read_text())
    del spoiled["entry"][1]["resource"]["status"]
    with pytest.raises(ValueError, match="status"):
        bundle.model_validate(spoiled)
