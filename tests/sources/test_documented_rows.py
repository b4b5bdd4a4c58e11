"""The loop that docs/sources.md shows for vendors' clients sends what becomes strides."""

from __future__ import annotations

import re
import socket
from types import SimpleNamespace
from typing import Any

from rehab.sources.intake import LineReader
from rehab.sources.synthetic import walk
from rehab.sources.synthetic.signals import Sensors
from tests.sources.intake_harness import MASS, IntakeHarness
from tests.support.servers import ROOT
from tests.support.synthetic_recordings import make_signals


def test_the_documented_loop_sends_strides():
    text = (ROOT / "docs" / "sources.md").read_text("utf-8")
    (code,) = re.findall(r"```python\n(.*?)```", text, re.DOTALL)
    made = make_signals(list(walk(seed=4, strides=12)), MASS, Sensors(rate_hz=100), seed=4)
    names: dict[str, Any] = {}
    with socket.create_server(("127.0.0.1", 0)) as lab:
        exec(code.replace("9101", str(lab.getsockname()[1])), names)  # noqa: S102  # our own page
        names["garry"].close()
    sent: list[bytes] = []
    names["garry"] = SimpleNamespace(sendall=sent.append)
    leg = made.left
    for number, row in enumerate(zip(leg.force_n, leg.moment_nm, leg.angle_rad, strict=True)):
        names["frame"](number, 100, *map(float, row))
    rows, problems = LineReader().read_bytes(b"".join(sent))
    assert problems == []
    harness = IntakeHarness()
    harness.send(rows)
    strides = harness.strides()
    assert len([one for one in strides if one.value is not None and not one.reasons]) >= 10
