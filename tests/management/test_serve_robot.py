"""`make run` brings a robot: it answers a session, its doings are in the log, nothing is left."""

from __future__ import annotations

import asyncio
import json
import os
import signal
import time
from typing import Any

import psutil
import pytest
from django.core.management import CommandError, call_command
from websockets.asyncio.client import connect

from tests.support.servers import run_python, serve

PREPARE = """
import django; django.setup()
from rehab.people.sign_in.first_start import first_clinic, first_password, prepare_database
prepare_database()
first_password()
from django.test import Client
from rehab.people.models import User
browser = Client()
browser.force_login(User.everywhere.get())
print(browser.cookies["sessionid"].value)
from rehab.people.models import Patient
from rehab.sessions.services import SessionRequest, create_session
from rehab.stations.builtin import first_station
from rehab.stations.models import Device
from rehab.training.goals import GoalRule
from rehab.training.phases import make_phase
clinic = first_clinic()
station = first_station(clinic)
for kind in KINDS:
    device = Device(clinic=clinic, station=station, kind=kind, name=kind)
    token = device.new_token()
    device.save()
    print(token)
patient = Patient.everywhere.create(clinic=clinic, code="1", nickname="A", paretic_side="left")
create_session(SessionRequest(patient=patient, valence="positive", goal=GoalRule(value=3.0),
               phases=[make_phase("training")], station=station))
"""
READ_LOG = """
import django, json; django.setup()
from rehab.sessions.log import SessionEvent
events = SessionEvent.everywhere.filter(kind__startswith="robot_").order_by("pk")
print(json.dumps([[event.kind, event.data] for event in events]))
"""


def children(folder) -> list[dict[str, Any]]:
    report = folder / "children.json"
    return json.loads(report.read_text())["children"] if report.exists() else []


def wait_for_child(folder) -> dict[str, Any]:
    for _ in range(200):
        told = children(folder)
        if told and told[0]["pid"]:
            return told[0]
        time.sleep(0.05)
    raise AssertionError("no robot was started")


def family(pid: int) -> list[psutil.Process]:
    """Return the robot's process and all that it has started: its port, a guard, its twin."""
    robot = psutil.Process(pid)
    return [robot, *robot.children(recursive=True)]


async def perform(url: str, cookie: str, token: str) -> list[dict[str, Any]]:
    """Start the session, walk until a gesture has ended, stop the robot; return its reports."""
    page = {"Cookie": f"sessionid={cookie}", "Origin": url.replace("ws", "http")}
    source = {"Authorization": f"Bearer {token}"}
    reports: list[dict[str, Any]] = []
    async with (
        asyncio.timeout(60),
        connect(f"{url}/ws/session/1/monitor/", additional_headers=page) as monitor,
        connect(f"{url}/ws/source/", additional_headers=source) as sensor,
    ):

        async def hear(is_enough) -> None:
            while not is_enough():
                frame = json.loads(await monitor.recv())
                if "frame" in frame:
                    await monitor.send(json.dumps({"type": "seen", "frame": frame["frame"]}))
                reports.extend(e["report"] for e in frame.get("events", []) if e["kind"] == "robot")

        async def step() -> None:
            hello = {"type": "hello", "version": 1, "run": "x", "last": 0, "speed": None}
            await sensor.send(json.dumps(hello))
            for number in range(1, 10_000):
                step = {"type": "step", "number": number, "time_s": number, "side": "left"}
                await sensor.send(json.dumps(step | {"value": 3.5}))
                await sensor.recv()
                await asyncio.sleep(0.1)

        await hear(lambda: any(report.get("state") == "idle" for report in reports))
        await monitor.send(json.dumps({"type": "change", "kind": "start", "id": "s"}))
        await hear(lambda: reports[-1].get("reason") == "")
        walking = asyncio.create_task(step())
        await hear(lambda: any(report.get("phase") == "ended" for report in reports))
        await monitor.send(json.dumps({"type": "robot", "order": "stop"}))
        await hear(lambda: reports[-1].get("state") == "stopped")
        walking.cancel()
    return reports


def still_running(started, within_s):
    """Return the processes that have not ended in time; one may wait for an init to reap it."""
    left = psutil.wait_procs(started, within_s)[1]
    return [one for one in left if one.is_running() and one.status() != psutil.STATUS_ZOMBIE]


@pytest.mark.essential
@pytest.mark.realtime
def test_the_robot_answers_stops_and_leaves_with_the_server(tmp_path):
    cookie, source = run_python(tmp_path, "-c", 'KINDS = ["source"]\n' + PREPARE).split()
    with serve(tmp_path, "--robot", "twin") as server:
        robot = wait_for_child(tmp_path)
        assert robot["name"] == "robot"
        assert max(map(len, robot["command"][1:])) < 40  # no token for all to see
        url = server.url.replace("http", "ws")
        reports = asyncio.run(perform(url, cookie, source))
        started = family(robot["pid"])
        assert len(started) == 4
        os.kill(server.process.pid, signal.SIGINT)
        assert server.process.wait(15) == 0
    assert still_running(started, 2) == []
    assert list(tmp_path.glob("black_box/*/incident-*-stopped.jsonl"))
    ended = [report for report in reports if report.get("phase") == "ended"]
    assert ended[0]["outcome"] == "done"
    poses = [report["pose"] for report in reports if report["kind"] == "status"]
    farthest_m = max(pose["x_m"] for pose in poses)
    assert farthest_m > 0.07 or max(abs(pose["heading_rad"]) for pose in poses) > 0.6
    log = json.loads(run_python(tmp_path, "-c", READ_LOG))
    kept = {name: value for name, value in ended[0].items() if name != "kind"}
    assert ["robot_gesture", kept] in log
    kinds = {kind for kind, _ in log}
    assert kinds == {"robot_decision", "robot_gesture", "robot_stop"}


@pytest.mark.server
def test_a_killed_server_leaves_no_robot(tmp_path):
    with serve(tmp_path, "--robot", "twin") as server:
        robot = wait_for_child(tmp_path)
        started = family(robot["pid"])
        server.process.kill()
        assert still_running(started, 10) == []


@pytest.mark.long
@pytest.mark.server
def test_a_station_with_a_robot_of_its_own_gets_no_other(tmp_path):
    run_python(tmp_path, "-c", 'KINDS = ["robot"]\n' + PREPARE)
    with serve(tmp_path, "--robot", "kinematic"):
        time.sleep(0.5)
        assert children(tmp_path) == []


def test_a_hosted_server_runs_no_robot(settings):
    settings.HOSTED = True
    with pytest.raises(CommandError, match="python -m robot"):
        call_command("serve", "--robot", "kinematic")
