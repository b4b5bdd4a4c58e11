"""Children run beside the server, come back when they fail, and never outlive it."""

from __future__ import annotations

import asyncio
import json
import os
import sys

import pytest

from rehab.sessions.live.children import Children


async def until(condition, seconds: float = 5.0) -> None:
    for _ in range(int(seconds / 0.02)):
        if condition():
            return
        await asyncio.sleep(0.02)
    pytest.fail("it did not happen in time")


def python(code: str) -> list[str]:
    return [sys.executable, "-c", code]


@pytest.fixture
async def children(tmp_path):
    made = Children(tmp_path / "children.json", first_pause_s=0.02)
    yield made
    await made.stop_all()


async def test_a_child_that_fails_comes_back_and_its_last_words_are_kept(children, tmp_path):
    child = children.start("robot", python("print('no port'); raise SystemExit(3)"))
    await until(lambda: child.restarts >= 2)
    assert list(child.last_words)[-1] == "no port"
    told = json.loads((tmp_path / "children.json").read_text())
    assert told["children"][0]["name"] == "robot"


async def test_a_child_that_is_done_is_left_alone(children):
    child = children.start("recording", python("pass"))
    await until(lambda: child.state == "done")
    assert child.restarts == 0


async def test_a_stopped_child_is_gone_even_if_it_does_not_listen(children, monkeypatch):
    monkeypatch.setattr("rehab.sessions.live.children.STOP_S", 0.2)
    deaf = "import signal, time; signal.signal(15, signal.SIG_IGN); print('on'); time.sleep(60)"
    child = children.start("deaf", [sys.executable, "-u", "-c", deaf])
    await until(lambda: "on" in child.last_words)
    pid = child.pid
    await children.stop("deaf")
    with pytest.raises(ProcessLookupError):
        os.kill(pid, 0)


async def test_a_command_that_does_not_exist_is_told_and_not_raised(children):
    child = children.start("typo", ["/no/such/program"])
    await until(lambda: child.restarts >= 1)
    assert "No such file" in child.last_words[0]


async def test_a_name_is_used_once(children):
    children.start("one", python("pass"))
    with pytest.raises(ValueError, match="Stop it first"):
        children.start("one", python("pass"))
