"""What stands in deploy/ names commands, settings and figures that exist."""

from __future__ import annotations

import json
import re
import shlex
import shutil
import subprocess
from configparser import RawConfigParser
from pathlib import Path
from types import SimpleNamespace

import pytest
from django.conf import settings
from django.core.management import get_commands, load_command_class
from prometheus_client import generate_latest

from rehab.management.commands import upkeep
from rehab.sessions.live import runtime
from rehab.sessions.live.database.trouble import Trouble
from rehab.sessions.live.process import STOP_S
from rehab.sessions.live.pulse import SILENT_S
from rehab.sessions.live.session import prometheus_metrics
from rehab.sessions.pages.server import metrics
from rehab.sources import SOURCES
from rehab.sources.arguments import make_parser as make_source_parser
from robot.__main__ import make_parser
from tests.support.servers import ROOT

DEPLOY = ROOT / "deploy"
UNITS = sorted((DEPLOY / "systemd").glob("*.service"))


class Unit(RawConfigParser):
    """A unit of systemd: keys have capitals, and may stand more than once."""

    optionxform = staticmethod(str)  # type: ignore[assignment]


@pytest.mark.parametrize("unit", UNITS, ids=lambda unit: unit.stem)
def test_a_unit_starts_a_command_that_exists(unit: Path) -> None:
    read = Unit(strict=False)
    read.read(unit)
    program, *arguments = shlex.split(read["Service"]["ExecStart"].replace(" %i", " weekly"))
    assert program == "/opt/garry/.venv/bin/python"
    if arguments[0] == "manage.py":
        command = load_command_class(get_commands()[arguments[1]], arguments[1])
        command.create_parser("manage.py", arguments[1]).parse_args(arguments[2:])
    elif arguments[:2] == ["-m", "robot"]:
        make_parser().parse_args(arguments[2:])
    else:
        assert arguments[:2] == ["-m", "rehab.sources"]
        parse_source([one for one in arguments[3:] if one != "$OPTIONS"])
    written = [one for one in arguments if one.startswith("/var/lib/")]
    assert all(one.startswith(f"/var/lib/{read['Service']['StateDirectory']}/") for one in written)


def test_containers_of_others_are_named_by_digest() -> None:
    """A tag can be given to another image; what stands in a digest cannot."""
    texts = [(DEPLOY / name).read_text() for name in ("Dockerfile", "compose.yaml")]
    named = re.findall(r"^(?:FROM|\s*image:) (\S+)", "\n".join(texts), re.MULTILINE)
    others = {name for name in named if name != "garry"}
    assert {name.partition(":")[0] for name in others} == {"node", "python", "postgres", "haproxy"}
    assert all(re.fullmatch(r"\w+:[\w.-]+@sha256:[0-9a-f]{64}", name) for name in others)


def parse_source(arguments: list[str]) -> None:
    """Parse a source's options as its command does."""
    options = ["--listen", "tcp://127.0.0.1:9101", "--mass", "75"]
    make_source_parser("rows", SOURCES["rows"]).parse_args([*arguments, *options])


def read_words(text: str, program: str) -> list[str]:
    """Return a command's arguments behind its program, as the script writes them."""
    assert text.startswith(program)
    plain = text.replace("$Options", "").replace("`", "").replace("\\", "/")
    return shlex.split(plain.removeprefix(program))


def test_the_script_for_windows_starts_commands_that_exist() -> None:
    """It was never run there: this reads what it would run."""
    script = (DEPLOY / "windows" / "garry.ps1").read_text()
    source, robot = re.findall(r'^    "(-m .*)"$', script, re.MULTILINE)
    parse_source(read_words(source, "-m rehab.sources $Name "))
    make_parser().parse_args(read_words(robot.replace("$Name", "avatar"), "-m robot "))
    assert script.count("{") == script.count("}")
    assert script.count("(") == script.count(")")


def test_the_server_has_longer_to_stop_than_it_takes() -> None:
    read = Unit(strict=False)
    read.read(DEPLOY / "systemd" / "garry-server.service")
    assert float(read["Service"]["TimeoutStopSec"]) > STOP_S
    grace = re.search(r"stop_grace_period: (\d+)s", (DEPLOY / "compose.yaml").read_text())
    assert float(grace[1]) > STOP_S


def test_systemd_ends_a_server_that_is_silent_as_long_as_a_supervisor_waits() -> None:
    read = Unit(strict=False)
    read.read(DEPLOY / "systemd" / "garry-server.service")
    service = read["Service"]
    assert (service["Type"], float(service["WatchdogSec"])) == ("notify", SILENT_S)
    check = (DEPLOY / "haproxy" / "haproxy.cfg").read_text()
    assert "option httpchk GET /livez" in check
    assert "on-marked-down shutdown-sessions" in check


@pytest.mark.skipif(shutil.which("systemd-analyze") is None, reason="apt-get install systemd")
@pytest.mark.parametrize("unit", UNITS, ids=lambda unit: unit.stem)
def test_a_unit_may_do_little_beside_its_work(unit: Path) -> None:
    judged = subprocess.run(
        ["systemd-analyze", "security", "--offline=yes", str(unit)],
        capture_output=True,
        text=True,
        check=False,
    )
    exposure = re.search(r"exposure level for .*: ([\d.]+)", judged.stdout)
    assert exposure is not None, judged.stderr
    assert float(exposure[1]) <= 3


def test_a_robots_port_may_owe_its_base_a_stop_after_the_service_has_ended() -> None:
    read = Unit(strict=False)
    read.read(DEPLOY / "systemd" / "garry-robot.service")
    assert read["Service"]["KillMode"] == "process"


def test_settings_that_are_named_exist() -> None:
    named = set()
    for file in (*DEPLOY.rglob("*"), ROOT / "docs" / "hosting.md"):
        if file.is_file() and file.suffix != ".pyc":
            named |= set(re.findall(r"\bGARRY_[A-Z_]+\b", file.read_text()))
    clients = {"GARRY_SERVER", "GARRY_TOKEN", "GARRY_ROBOT_CALIBRATION", "GARRY_TEST_ALL"}
    assert named - clients <= set(settings.VARIABLES)


@pytest.mark.django_db
def test_alarms_and_the_board_ask_for_figures_that_exist(monkeypatch) -> None:
    monkeypatch.setattr(metrics, "_connections", lambda: (1, 100))  # of PostgreSQL
    idle = SimpleNamespace(
        sessions={},
        is_ready=True,
        clinics=SimpleNamespace(epochs={}),
        servers=None,
        writer=SimpleNamespace(backlog=0, trouble=Trouble.NONE),
    )
    monkeypatch.setattr(runtime, "peek", lambda: idle)
    shown = generate_latest(prometheus_metrics.REGISTRY).decode()
    there = set(re.findall(r"^# TYPE (\w+)", shown, re.MULTILINE))
    board = json.loads((DEPLOY / "grafana" / "garry.json").read_text())
    asked = [target["expr"] for panel in board["panels"] for target in panel["targets"]]
    asked += re.findall(r"expr: (.*)", (DEPLOY / "prometheus" / "alerts.yml").read_text())
    assert len(asked) > 15
    for expression in asked:
        for name in re.findall(r"\b(?:garry|process)_\w+", expression):
            assert {name, name.removesuffix("_bucket")} & there, expression


def test_each_time_of_upkeep_has_a_timer_and_a_turn_in_the_container() -> None:
    timers = {"hourly", "nightly", "weekly"}
    assert set(upkeep.TIMES) == timers
    compose = (DEPLOY / "compose.yaml").read_text()
    for name in timers:
        read = Unit(strict=False)
        read.read(DEPLOY / "systemd" / f"garry-{name}.timer")
        assert read["Timer"]["Unit"] == f"garry-upkeep@{name}.service"
        assert f"manage.py upkeep {name}" in compose
