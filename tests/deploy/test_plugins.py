"""The example packages, installed, tried and removed in an environment of their own."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import venv
from pathlib import Path

import pytest

from tests.support.servers import ROOT

pytestmark = [pytest.mark.server, pytest.mark.long, pytest.mark.timeout(300)]
EXAMPLES = ("garry-wagon", "garry-metronome")


class Environment:
    """An environment that sees this repository and its dependencies, and installs by itself."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        venv.create(folder / "venv", with_pip=True)
        self.python = str(folder / "venv" / "bin" / "python")
        code = "import sysconfig; print(sysconfig.get_path('purelib'))"
        own = Path(self._run(self.python, "-c", code).stdout.strip())
        ours = subprocess.run(
            [sys.executable, "-c", code], capture_output=True, text=True, check=True
        )
        (own / "repository.pth").write_text(f"{ROOT}\n{ours.stdout}")
        self.packages = own
        self.pip("uninstall", "-y", "setuptools")  # the repository's is newer

    def _run(self, *command: str) -> subprocess.CompletedProcess[str]:
        rest = {name: value for name, value in os.environ.items() if not name.startswith("GARRY")}
        mine = {"GARRY_DATA_DIR": str(self.folder / "data"), "PYTHONDONTWRITEBYTECODE": "1"}
        return subprocess.run(
            command, cwd=self.folder, env=rest | mine, capture_output=True, text=True
        )

    def run(self, *arguments: str) -> subprocess.CompletedProcess[str]:
        return self._run(self.python, "-m", *arguments)

    def pip(self, *arguments: str) -> None:
        done = self.run("pip", "-q", *arguments)
        assert done.returncode == 0, done.stderr


@pytest.fixture(scope="module")
def garry(tmp_path_factory):
    return Environment(tmp_path_factory.mktemp("plugins"))


def test_a_base_a_source_and_a_measure_come_and_go(garry):
    assert "wagon" not in garry.run("robot", "--help").stdout
    for name in EXAMPLES:
        shutil.copytree(ROOT / "examples" / name, garry.folder / name)
        garry.pip("install", "--no-deps", "--no-build-isolation", str(garry.folder / name))

    # Their promises.
    quiet = ("-q", "-p", "no:cacheprovider", "-p", "no:xdist", "-c", os.devnull)
    tried = garry.run("pytest", *quiet, "--pyargs", "robot.testing", "rehab.testing")
    assert tried.returncode == 0, tried.stdout
    assert "failed" not in tried.stdout

    # They are used as our own.
    played = garry.run("robot", "gesture", "peek", "--base", "wagon")
    assert played.returncode == 0, played.stderr
    assert "a walker who steps to a beat" in garry.run("rehab.sources", "--help").stdout
    assert garry.run("garry_site", "migrate").returncode == 0
    measures = (
        "from rehab.sessions.setup.protocol_models import MeasureDefinition as M; import json;"
        "print(json.dumps(list(M.everywhere.filter(slug='beat_error').values('unit','channel'))))"
    )
    known = garry.run("garry_site", "shell", "-v", "0", "-c", measures)
    assert json.loads(known.stdout) == [{"unit": "%", "channel": "beat_error_percent"}]
    said = garry.run("garry_site", "doctor").stdout
    assert "garry.bases wagon of garry-wagon 1.0: in use" in said
    assert "garry.measures beat_error of garry-metronome 1.0: in use" in said

    # A broken one is named, and stops nothing.
    (garry.packages / "garry_wagon.py").write_text("import no_such_library\n")
    broken = garry.run("garry_site", "doctor")
    assert broken.returncode == 1
    assert "No module named 'no_such_library'" in broken.stdout
    assert garry.run("robot", "--help").returncode == 0
    assert garry.run("garry_site", "check").returncode == 0

    garry.pip("uninstall", "-y", *EXAMPLES)
    assert "garry-wagon" not in garry.run("garry_site", "doctor").stdout
    assert "wagon" not in garry.run("robot", "--help").stdout
    assert "metronome" not in garry.run("rehab.sources", "--help").stdout
