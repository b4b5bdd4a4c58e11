"""A FHIR client of other origin reads what a session wrote, over a real socket."""

from __future__ import annotations

import json
import shutil
import subprocess
from pathlib import Path

import pytest

from tests.support.servers import ROOT, run_python, serve

pytestmark = [pytest.mark.server, pytest.mark.long]
READER = ROOT / "tests" / "support" / "fhir_client.mjs"
WALK = [
    "runsession",
    "--synthetic",
    "7",
    "--valence",
    "positive",
    "--strides",
    "100",
    "--speed",
    "max",
]


def test_it_reads_a_session_and_finds_nothing_wrong(tmp_path: Path) -> None:
    node = shutil.which("node")
    if node is None:
        pytest.skip("no node here, which runs the client")
    for _ in range(2):
        run_python(tmp_path, "manage.py", *WALK)
    token = run_python(tmp_path, "-m", "tests.support.api_seed", "pt").strip()
    with serve(tmp_path) as server:
        words = [node, str(READER), f"{server.url}/api/v1/fhir", token]
        done = subprocess.run(words, capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout)
    assert told["problems"] == []
    found = told["found"]
    assert told["abilities"]["rest"][0]["mode"] == "server"
    assert len(found["Encounter"]) == 2  # a page each
    figures = {one["code"]["coding"][0]["code"] for one in found["Observation"]}
    assert {"score", "hit_rate"} <= figures
    assert {one["subject"]["reference"] for one in found["Observation"]} == {
        f"Patient/{found['Patient'][0]['id']}"
    }
