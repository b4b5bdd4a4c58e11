"""Raw signals, one command, and the patient sees the strides that are measured from them."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys

import pytest
from playwright.sync_api import expect

from tests.support.browsers import Visit
from tests.support.patient_page import stored as stored_steps
from tests.support.servers import ROOT, Server
from tests.support.walk_seed import make_walks

pytestmark = pytest.mark.browser

STRIDES = 24


def test_a_session_from_raw_signals_on_the_tablet(server: Server, visit: Visit) -> None:
    (walk,) = make_walks(server, {"valence": "explicit", "goal": 3.0})
    page = visit(walk.path, walk, "tablet-landscape", has_touch=True)
    monitor = visit(walk.monitor_path, walk, "laptop")
    command = f"-m rehab.sources synthetic --signals --speed 20 --strides {STRIDES} --seed 5"
    source = subprocess.Popen(
        [sys.executable, *command.split(), "--server", server.url],
        cwd=ROOT,
        env=os.environ | {"GARRY_TOKEN": walk.source},
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        page.tap("[data-change=start]")
        page.wait_for_function("() => document.body.dataset.step >= 20")
        _, said = source.communicate(timeout=30)
    finally:
        source.kill()
        source.wait()
    assert f"{STRIDES} strides acknowledged" in said
    # Explicit feedback shows what was measured.
    expect(page.locator("body")).to_contain_text(re.compile(r"in W/kg\s*\d\.\d\d"))
    text = page.locator("body").text_content() or ""
    (value,) = re.search(r"in W/kg\s*(\d\.\d\d)", text).groups()
    number = page.locator("body").get_attribute("data-step")
    stored = {step["number"]: step for step in stored_steps(server, walk)}
    assert stored[int(number)]["side"] == "left"
    assert f"{stored[int(number)]['value']:.2f}" == value
    assert sum(bool(step["valid"]) for step in stored.values()) > STRIDES // 2
    assert 0.5 < json.loads(stored[int(number)]["extra"])["stance_s"] < 0.9
    # The therapist sees what else was measured of the last stride.
    newest = stored[max(stored)]
    expect(monitor.locator("[data-show=number]")).to_have_text(f"no. {newest['number']}")
    extras = monitor.locator("[data-show=extras]").inner_text().splitlines()
    measured = json.loads(newest["extra"])
    assert len(extras) == len(measured)
    (stance,) = (line for line in extras if re.fullmatch(r"stance [\d.]+ s", line))
    assert float(stance.split()[1]) == pytest.approx(measured["stance_s"], rel=0.01)
