"""`python -m rehab.sources` as it is typed: strides arrive, errors say the cure, Ctrl-C ends it."""

import asyncio
import json
import os
import signal
import sys
import time
from pathlib import Path

import pytest

from rehab.sources import SOURCES
from rehab.sources.__main__ import main
from rehab.sources.synthetic import PROFILES, walk
from rehab.training.phases import make_phase
from rehab.training.steps import Side
from tests.sources.fake_garry import TOKEN, FakeGarry, serve_garry
from tests.support.commands import finish, hear_sigint

REPO = Path(__file__).parents[2]
UNREACHABLE = ["--server", "http://127.0.0.1:9", "--token", TOKEN]


@pytest.fixture(autouse=True)
def _no_environment(monkeypatch):
    for name in ("GARRY_TOKEN", "GARRY_SERVER"):
        monkeypatch.delenv(name, raising=False)


@pytest.fixture
def recording(tmp_path):
    path = tmp_path / "walk.csv"
    rows = "".join(f"{n},{3 + n / 100},0.99\n" for n in range(1, 31))
    path.write_text(f"time_s,value,belt_m_s\n{rows}", "utf-8")
    return path


async def start(*arguments, **environment):
    return await asyncio.create_subprocess_exec(
        *(sys.executable, "-W", "error", "-m", "rehab.sources", *map(str, arguments)),
        cwd=REPO,
        env=os.environ | environment,
        stderr=asyncio.subprocess.PIPE,
        preexec_fn=None if sys.platform == "win32" else hear_sigint,
    )


async def test_a_simulated_patient_dials_in_and_walks(tmp_path):
    garry = FakeGarry()
    log = tmp_path / "acks.jsonl"
    began = time.time()
    async with serve_garry(garry):
        server = garry.url.replace("ws:", "http:").replace("/ws/source/", "/")
        process = await start(
            *("synthetic", "--seed", 5, "--strides", 20, "--speed", "max"),
            *("--server", server, "--log", log),
            GARRY_TOKEN=TOKEN,
        )
        status, said = await finish(process)

    assert status == 0, said
    expected = walk(PROFILES["good"], 5, [make_phase("training", "Push")], 20, Side.RIGHT)
    assert [(s["number"], s["time_s"], s["value"]) for s in garry.log] == [
        (m.number, m.time_s, m.value) for m in expected
    ]
    assert "Joined session 7." in said
    assert "20 strides acknowledged" in said
    acks = [json.loads(line) for line in log.read_text("utf-8").splitlines()]
    assert [ack["number"] for ack in acks] == list(range(1, 21))
    assert {ack["session"] for ack in acks} == {7}
    assert all(began <= ack["time"] <= time.time() for ack in acks)


async def test_a_recording_is_played(recording, tmp_path):
    garry = FakeGarry()
    token_file = tmp_path / "token"
    token_file.write_text(f"{TOKEN}\n")
    async with serve_garry(garry):
        process = await start(
            *("recording", recording, "--speed", "max", "--side", "left", "--strides", 25),
            *("--server", garry.url.removesuffix("/ws/source/"), "--token-file", token_file),
        )
        status, said = await finish(process)

    assert status == 0, said
    assert garry.numbers == list(range(1, 26))
    assert garry.log[4] == {
        "number": 5,
        "time_s": 5.0,
        "side": "left",
        "value": 3.05,
        "extra": {"belt_m_s": 0.99},
    }
    assert "trains the right leg" in said


async def test_a_refusal_ends_it_with_status_3():
    garry = FakeGarry()
    async with serve_garry(garry):
        process = await start("synthetic", "--server", garry.url[:-11], "--token", "wrong")
        status, said = await finish(process)

    assert status == 3, said
    assert "Unknown token. Make a new one." in said
    assert "Traceback" not in said


@pytest.mark.skipif(sys.platform == "win32", reason="Windows sends Ctrl-C to whole consoles only")
@pytest.mark.parametrize("is_up", [True, False], ids=["walking", "out of reach"])
async def test_ctrl_c_ends_it_cleanly(is_up):
    garry = FakeGarry()
    async with serve_garry(garry):
        server = garry.url.removesuffix("/ws/source/") if is_up else "http://127.0.0.1:9"
        process = await start("synthetic", "--server", server, "--token", TOKEN)
        line = b""
        while b"is running" not in line and b"dialing in again" not in line:
            line = await asyncio.wait_for(process.stderr.readline(), 20)
        process.send_signal(signal.SIGINT)
        status, said = await finish(process)
        if is_up:
            await asyncio.wait_for(garry.sockets[0].wait_closed(), 5)
            assert garry.sockets[0].close_code == 1000

    assert status == 130, said
    assert "Stopped." in said
    assert "Traceback" not in said


@pytest.mark.parametrize("name", SOURCES)
def test_every_source_tells_how_to_start_it(name, capsys):
    with pytest.raises(SystemExit) as ended:
        main([name, "--help"])

    assert ended.value.code == 0
    assert "--token-file" in capsys.readouterr().out


def test_the_menu_names_every_source(capsys):
    with pytest.raises(SystemExit):
        main(["--help"])

    said = capsys.readouterr().out
    assert all(f"  {name} " in said for name in SOURCES)


@pytest.mark.parametrize(
    ("arguments", "cure"),
    [
        (["synthetic"], "--token-file"),
        (["synthetic", "--token", "a b"], "Copy it"),
        (["synthetic", "--token-file", "no-such-file"], "cannot be read"),
        (["synthetic", "--token", TOKEN, "--server", "127.0.0.1:8000"], "http://127.0.0.1:8000"),
        (["synthetic", *UNREACHABLE, "--stay", "--session", "7"], "give only one"),
        (["synthetic", *UNREACHABLE, "--log", "no/such/folder/log"], "cannot be written"),
        (["recording", "no-such-file.csv", *UNREACHABLE], "Check the path"),
    ],
)
def test_what_cannot_be_done_is_said_with_the_cure(arguments, cure, capsys, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)

    assert main(arguments) == 2
    assert cure in capsys.readouterr().err


def test_a_recording_that_cannot_be_sent_is_refused_before_anything_is(tmp_path, capsys):
    path = tmp_path / "walk.csv"
    path.write_text("time_s,value,belt speed\n1,3,\n2,3,0.99\n", "utf-8")

    assert main(["recording", str(path), *UNREACHABLE]) == 2
    assert "'belt speed'" in capsys.readouterr().err


@pytest.mark.parametrize(
    "arguments",
    [
        [],
        ["weather"],
        ["recording"],
        ["synthetic", "--speed", "0"],
        ["synthetic", "--speed", "inf"],
        ["synthetic", "--speed", "quick"],
        ["synthetic", "--strides", "0"],
        ["synthetic", "--profile", "no-such"],
        ["synthetic", "--token", "a", "--token-file", "b"],
    ],
)
def test_a_wrong_command_line_has_status_2(arguments, capsys):
    with pytest.raises(SystemExit) as ended:
        main(arguments)

    assert ended.value.code == 2
    assert "usage:" in capsys.readouterr().err
