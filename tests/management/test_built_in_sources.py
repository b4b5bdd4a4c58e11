"""Sources that the server runs itself: each stride of a recording once, whatever happens."""

from __future__ import annotations

import sqlite3
import time
from pathlib import Path
from typing import Any

import pytest

from tests.support.servers import Server, serve

pytestmark = pytest.mark.server

STRIDES = 60  # 9 s: a slow machine takes some of them to kill a server

SEED = """
from rehab.people.sign_in.first_start import first_clinic
from rehab.people.models import Patient
from rehab.sessions.services import SessionRequest, create_session
from rehab.stations.builtin import first_station
from rehab.training.goals import GoalRule
from rehab.training.phases import make_phase
clinic = first_clinic()
patient = Patient.everywhere.create(clinic=clinic, code="R", nickname="R", paretic_side="left")
create_session(SessionRequest(
    patient=patient, valence="positive", goal=GoalRule(value=3.0), phases=[make_phase("training")],
    station=first_station(clinic), source_args={runs!r},
))
"""
CHANGE = """
import asyncio, json, os, sys
from django.test import Client
from websockets.sync.client import connect
from rehab.people.models import User
browser = Client()
browser.force_login(User.everywhere.get(username="pt"))
place = {place!r}
cookie = "sessionid=" + browser.cookies["sessionid"].value
headers = {{"Cookie": cookie, "Origin": "http://" + place}}
with connect("ws://" + place + "/ws/session/1/monitor/", additional_headers=headers) as page:
    page.send(json.dumps({{"type": "change", "kind": {kind!r}, "id": "x"}}))
    while json.loads(page.recv(10)).get("id") != "x":
        pass
    import time; time.sleep({watch})
"""


def run_inside(server: Server, code: str) -> None:
    server.run_shell(code)


def change(server: Server, kind: str, watch: float = 0.0) -> None:
    place = f"127.0.0.1:{server.port}"
    run_inside(server, CHANGE.format(place=place, kind=kind, watch=watch))


def values(folder: Path) -> list[float]:
    with sqlite3.connect(folder / "garry.sqlite3") as database:
        rows = database.execute("SELECT value FROM rehab_step ORDER BY number").fetchall()
    database.close()
    return [value for (value,) in rows]


def until(folder: Path, count: int) -> None:
    deadline = time.monotonic() + 40
    while len(values(folder)) < count:
        assert time.monotonic() < deadline, values(folder)
        time.sleep(0.05)


@pytest.mark.long
def test_a_recording_is_walked_once_also_over_a_killed_server(tmp_path: Path) -> None:
    walked = [round(3.5 + 0.01 * number, 2) for number in range(STRIDES)]
    file = tmp_path / "walk.csv"
    lines = [f"{1 + number * 0.6:.1f},left,{value}" for number, value in enumerate(walked)]
    file.write_text("time_s,side,value\n" + "\n".join(lines) + "\n")
    folder = tmp_path / "data"
    runs: list[Any] = ["recording", str(file), "--speed", "4"]
    with serve(folder) as server:
        run_inside(server, SEED.format(runs=runs))
        change(server, "start")
        until(folder, 4)
    # The server was killed. What it had on the disk stays; the rest of the file is still to come.
    before = values(folder)
    assert before == walked[: len(before)]
    assert len(before) < STRIDES
    with serve(folder) as server:
        change(server, "resume", watch=1.0)
        until(folder, STRIDES)
        time.sleep(2)  # a recording that began again would show by now
    assert values(folder) == walked
