"""`python -m robot` as it is typed: it performs, errors say the cure, it ends when told."""

import asyncio
import os
import signal
import sys
from pathlib import Path

import pytest

from robot.__main__ import main
from tests.support.commands import finish, hear_sigint
from tests.support.fake_robot_server import TOKEN, FakeGarry, serve_garry

REPO = Path(__file__).parents[2]
POSIX = pytest.mark.skipif(sys.platform == "win32", reason="Windows has no such signals")


@pytest.fixture(autouse=True)
def _no_environment(monkeypatch):
    for name in ("GARRY_ROBOT_TOKEN", "GARRY_SERVER"):
        monkeypatch.delenv(name, raising=False)


async def start(garry, *arguments, token=TOKEN):
    return await asyncio.create_subprocess_exec(
        *(sys.executable, "-W", "error", "-m", "robot", "--base", "kinematic"),
        *("--server", garry.url.replace("ws:", "http:").removesuffix("/ws/robot/"), *arguments),
        cwd=REPO,
        env=os.environ | {"GARRY_ROBOT_TOKEN": token},
        stdin=asyncio.subprocess.PIPE,
        stderr=asyncio.subprocess.PIPE,
        preexec_fn=None if sys.platform == "win32" else hear_sigint,
    )


async def end_with_stdin(process):
    process.stdin.close()


async def end_with_sigterm(process):
    process.send_signal(signal.SIGTERM)


async def end_with_sigint(process):
    process.send_signal(signal.SIGINT)


@pytest.mark.server
@pytest.mark.parametrize(
    ("end", "arguments", "status"),
    [
        (end_with_stdin, ["--child"], 0),
        pytest.param(end_with_sigterm, [], 0, marks=POSIX),
        pytest.param(end_with_sigterm, ["--child"], 0, marks=POSIX),
        pytest.param(end_with_sigint, [], 130, marks=POSIX),
    ],
)
async def test_it_performs_until_it_is_told_to_end(end, arguments, status):
    garry = FakeGarry()
    async with serve_garry(garry):
        process = await start(garry, *arguments)
        await garry.until_hello(1)
        await garry.walk(0, 1, 2, 3, 4, 5)
        await garry.until(lambda report: report.get("state") == "performing")
        await end(process)
        ended, said = await finish(process)
        async with asyncio.timeout(5):
            await garry.sockets[0].wait_closed()
    assert ended == status, said
    assert garry.sockets[0].close_code == 1000
    assert "Joined session 7." in said
    assert "Traceback" not in said


@pytest.mark.server
async def test_ctrl_c_of_the_server_is_the_servers_business():
    garry = FakeGarry()
    async with serve_garry(garry):
        process = await start(garry, "--child")
        await garry.until_hello(1)
        process.send_signal(signal.SIGINT)
        await garry.until(lambda report: report.get("state") == "idle")
        process.stdin.close()
        assert (await finish(process))[0] == 0


@pytest.mark.server
async def test_without_a_server_that_supervises_it_closed_input_is_nothing():
    garry = FakeGarry()
    async with serve_garry(garry):
        process = await start(garry)
        process.stdin.close()
        await garry.until_hello(1)
        await garry.until(lambda report: report.get("state") == "idle")
        process.kill()
        await process.wait()


@pytest.mark.server
async def test_a_refusal_ends_it_with_status_3():
    garry = FakeGarry()
    async with serve_garry(garry):
        status, said = await finish(await start(garry, token="wrong"))
    assert status == 3, said
    assert "Unknown token. Make a new one." in said
    assert "Traceback" not in said


@pytest.mark.parametrize(
    ("arguments", "cure"),
    [
        ([], "--token-file"),
        (["--token", "a b"], "Copy it"),
        (["--token-file", "no-such-file"], "cannot be read"),
        (["--token", TOKEN, "--server", "127.0.0.1:8000"], "http://127.0.0.1:8000"),
    ],
)
def test_what_cannot_be_done_is_said_with_the_cure(arguments, cure, capsys):
    assert main(["--base", "null", *arguments]) == 2
    assert cure in capsys.readouterr().err


@pytest.mark.parametrize("arguments", [[], ["--base", "no-such"], ["--base", "null", "--fast"]])
def test_a_wrong_command_line_has_status_2(arguments, capsys):
    with pytest.raises(SystemExit) as ended:
        main(arguments)
    assert ended.value.code == 2
    assert "usage:" in capsys.readouterr().err
