"""The client that the documentation shows is one that works."""

from __future__ import annotations

import json
import re
import subprocess
import sys

import pytest

from tests.support.servers import ROOT, clean_environment, serve

pytestmark = pytest.mark.server


def test_the_documented_python_client_sends_steps(tmp_path):
    text = (ROOT / "docs" / "protocol.md").read_text()
    code = re.search(r"```python\n(.*?)```", text, re.DOTALL).group(1)
    client = tmp_path / "client.py"
    client.write_text(code.replace("time.sleep(1.0)", "time.sleep(0.01)"))
    with serve(tmp_path) as server:
        environment = clean_environment(tmp_path, server.port)
        environment["DJANGO_SETTINGS_MODULE"] = "garry_site.settings"
        made = subprocess.run(
            [sys.executable, "-m", "tests.support.live_seed", "1"],
            cwd=ROOT,
            env=environment,
            capture_output=True,
            text=True,
            check=True,
        )
        row = json.loads(made.stdout)[0]
        process = subprocess.Popen(
            [sys.executable, "-u", str(client)],
            env=environment | {"URL": f"ws://127.0.0.1:{server.port}", "TOKEN": row["source"]},
            stdout=subprocess.PIPE,
            text=True,
        )
        said = [process.stdout.readline() for _ in range(5)]
        process.kill()
        process.wait()
        process.stdout.close()
    assert [json.loads(line)["number"] for line in said] == [1, 2, 3, 4, 5]
