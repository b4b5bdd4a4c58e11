"""An export of a million strides takes the memory of one of some ten thousand."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

from tests.support.servers import ROOT

pytestmark = [pytest.mark.bench, pytest.mark.timeout(3600)]
FEW, MANY = 20, 500  # sessions of 2000 strides
MORE_MB = 20  # of its own memory, for a list of sessions ten times as long


def run(sessions: int, folder: Path) -> dict[str, float]:
    """Measure on a database of its own."""
    folder.mkdir()
    result = subprocess.run(
        [sys.executable, "-m", "tests.bench.million_strides", str(sessions), str(folder)],
        cwd=ROOT,
        env={
            "DJANGO_SETTINGS_MODULE": "garry_site.settings",
            "GARRY_DATA_DIR": str(folder),
            "PATH": "/usr/bin:/bin",
        },
        capture_output=True,
        text=True,
    )
    assert result.returncode == 0, result.stderr[-3000:]
    return dict(json.loads(result.stdout.splitlines()[-1]))


def test_a_million_strides_are_exported_within_flat_memory(tmp_path):
    few, many = run(FEW, tmp_path / "few"), run(MANY, tmp_path / "many")
    print(f"\n{json.dumps(few)}\n{json.dumps(many)}")
    assert many["strides"] == 1_000_000
    assert 0 < many["peak_own_mb"] < few["peak_own_mb"] + MORE_MB
