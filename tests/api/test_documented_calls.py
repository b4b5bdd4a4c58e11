"""The examples of docs/api.md run as they stand there, against a server of their own."""

from __future__ import annotations

import csv
import json
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.support.servers import ROOT, clean_environment, serve

pytestmark = pytest.mark.server


def blocks(language: str) -> str:
    text = (ROOT / "docs" / "api.md").read_text()
    return "\n".join(re.findall(rf"```{language}\n(.*?)```", text, re.DOTALL))


@pytest.mark.long
@pytest.mark.skipif(shutil.which("curl") is None, reason="no curl here")
def test_the_documented_examples_run(tmp_path: Path):
    with serve(tmp_path) as server:
        environment = clean_environment(tmp_path, server.port)
        environment |= {"DJANGO_SETTINGS_MODULE": "garry_site.settings", "URL": server.url}
        environment["TOKEN"] = run(
            [sys.executable, "-m", "tests.support.api_seed", "pt"], environment
        )
        said = run(["bash", "-euo", "pipefail", "-c", blocks("bash")], environment)
        answers = [json.loads(part) for part in re.split(r"(?<=[}\]])(?=[{\[])", said)]
        me, started, steered, finished, session, figures, steps, users = answers
        assert me["role"] == "pt"
        assert (started["state"], steered["goal"], finished["state"]) == (
            "running",
            4.1,
            "finished",
        )
        assert session == finished
        assert {"score", "hit_rate"} <= {figure["slug"] for figure in figures}
        assert [step["number"] for step in steps["items"]] == [1, 2, 3][: len(steps["items"])]
        assert steps["items"]
        assert users == {"items": [], "total": 0}  # nobody walked: the source is simulated
        table = list(csv.DictReader(run_python(environment).splitlines()))
        assert len(table) == len(steps["items"])
        assert {row["pseudonym"] for row in table} == {session["patient"]["pseudonym"]}


def run_python(environment: dict[str, str]) -> str:
    return run([sys.executable, "-c", blocks("python")], environment)


def run(command: list[str], environment: dict[str, str]) -> str:
    done = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout.strip()
