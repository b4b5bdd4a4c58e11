"""BIDS and FHIR, checked by the validators of those who make the standards."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from datetime import timedelta
from pathlib import Path

import pytest

from rehab.exports.research.resumable_export import Package
from rehab.people.models import Patient
from rehab.people.roles import Role
from rehab.sessions.questionnaires import answer, ask, next_response
from rehab.sessions.robot_incidents import RobotIncident
from robot.black_box.recorder import Incident
from robot.wire.incident import unpack
from tests.support.recorded_stage import RecordedStage, read
from tests.support.robot_stage import CUE, WELCOME
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
    for part in move(tmp_path / "box"):
        RobotIncident.everywhere.create(
            session=session,
            at=session.started_at + timedelta(seconds=part.at_s - 1000),
            reason=part.reason,
            recording=part.recording,
        )
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


def move(folder: Path) -> list[Incident]:
    """Return what a robot sends of its motion, of a minute and a half."""
    stage = RecordedStage(folder)
    stage.hear(**WELCOME | {"cue": CUE | {"above": "varied", "below": "varied"}})
    stage.walk(*[1.0, 1.2, 0.4, 0.5] * 22)
    stage.hear(type="state", state="finished")
    stage.wait(7)
    stage.close()
    return list(stage.box.motion)


def test_the_robot_s_motion_is_exported_as_it_was_sent(files, tmp_path):
    pytest.importorskip("mcap.reader", reason="pip install garry[motion]")
    sent = [one for part in move(tmp_path / "again") for one in unpack(part.recording)]
    ticks = [one["tick"] for one in sent if "tick" in one]
    (file,) = (files / "robot").iterdir()
    topics = read(file)
    assert [tuple(message.values()) for _, message in topics["/odometry"]] == [
        (*tick[2:], 0.0) for tick in ticks
    ]
    assert [message["gesture"] for _, message in topics["/decision"]] == [
        one["sent"]["gesture"] for one in sent if one.get("sent", {}).get("kind") == "decision"
    ]
    times_s = [at_ns / 1e9 for at_ns, _ in topics["/odometry"]]
    assert times_s == sorted(times_s)
    (table,) = (files / "bids").rglob("*_tracksys-robot_motion.tsv")
    rows = [[float(cell) for cell in line.split("\t")] for line in table.read_text().splitlines()]
    assert [row[1:] for row in rows] == ticks
    channels = table.with_name(table.name.replace("motion.tsv", "channels.tsv")).read_text()
    assert len(channels.splitlines()) == 1 + len(rows[0])
    sidecar = json.loads(table.with_suffix(".json").read_text())
    assert sidecar["SamplingFrequency"] == pytest.approx(10, rel=0.2)


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
    assert kinds == {
        *("Patient", "Encounter", "Observation", "QuestionnaireResponse"),
        *("Device", "Goal", "Provenance"),
    }
    spoiled = json.loads(made[0].read_text())
    del spoiled["entry"][2]["resource"]["status"]
    with pytest.raises(ValueError, match="status"):
        bundle.model_validate(spoiled)
