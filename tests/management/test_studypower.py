"""The process that simulates a study beside a server."""

from __future__ import annotations

import subprocess
import sys

import pytest

from tests.support.servers import ROOT, SETTINGS, clean_environment


@pytest.mark.server
def test_a_child_that_cannot_simulate_says_why_and_does_not_abort(tmp_path):
    """It waits for its server's end at standard input meanwhile, which is no reason to abort."""
    with subprocess.Popen(
        [sys.executable, "manage.py", "studypower", "--run", "7", "--child"],
        cwd=ROOT,
        env=clean_environment(tmp_path, 8000) | {"DJANGO_SETTINGS_MODULE": SETTINGS},
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    ) as child:
        said = child.stdout.read()
        assert child.wait(60) == 1, said
    assert "There is no run 7." in said
