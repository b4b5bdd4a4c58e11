"""After a crash a thousand sessions of half an hour are back within seconds."""

from __future__ import annotations

import json
import os
import subprocess
import sys

from tests.support.servers import ROOT, clean_environment

COUNT = int(os.environ.get("GARRY_TEST_RESTORED", "1000"))
AIM_S = 10.0  # for a thousand


def test_sessions_are_back_soon(tmp_path):
    done = subprocess.run(
        [sys.executable, "-m", "tests.bench.restored", str(COUNT)],
        cwd=ROOT,
        env=clean_environment(tmp_path, 8000) | {"DJANGO_SETTINGS_MODULE": "garry_site.settings"},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout.splitlines()[-1])
    each_ms = 1000 * told["cpu_s"] / told["sessions"]
    print(
        f"\nrestored: {told['sessions']} in {told['seconds']:.1f} s, "
        f"{each_ms:.1f} ms of processor time each"
    )
    assert told["sessions"] == COUNT
    if COUNT >= 1000:
        assert told["seconds"] <= AIM_S
