"""Supervisor run beside the server, come back when they fail, and never outlive it."""

from __future__ import annotations

import asyncio
import json
import os
import sys
import threading
from collections import deque

import pytest

from rehab.sessions.live.supervisor import Supervisor, _read_output


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
    made = Supervisor(tmp_path / "children.json", first_backoff_s=0.02)
    yield made
    await made.stop_all()


async def test_a_child_that_fails_comes_back_and_its_last_words_are_kept(children, tmp_path):
    child = children.start("robot", python("print('no port'); raise SystemExit(3)"))
    await until(lambda: child.restarts >= 2)
    assert list(child.last_output)[-1] == "no port"
    await until((tmp_path / "children.json").exists)
    told = json.loads((tmp_path / "children.json").read_text())
    assert told["children"][0]["name"] == "robot"


async def test_a_child_that_is_done_is_left_alone(children):
    child = children.start("recording", python("pass"))
    await until(lambda: child.state == "done")
    assert child.restarts == 0


async def test_a_stopped_child_is_gone_even_if_it_does_not_listen(children, monkeypatch):
    monkeypatch.setattr("rehab.sessions.live.supervisor.STOP_S", 0.2)
    deaf = "import signal, time; signal.signal(15, signal.SIG_IGN); print('on'); time.sleep(60)"
    child = children.start("deaf", [sys.executable, "-u", "-c", deaf])
    await until(lambda: "on" in child.last_output)
    pid = child.pid
    await children.stop("deaf")
    with pytest.raises(ProcessLookupError):
        os.kill(pid, 0)


async def test_a_command_that_does_not_exist_is_told_and_not_raised(children):
    child = children.start("typo", ["/no/such/program"])
    await until(lambda: child.restarts >= 1)
    assert "No such file" in child.last_output[0]


async def test_a_name_is_used_once(children):
    children.start("one", python("pass"))
    with pytest.raises(ValueError, match="Stop it first"):
        children.start("one", python("pass"))


async def test_a_child_may_print_without_end_and_without_a_line(children):
    chatty = "print('begins'); print('.' * 300_000, end='', flush=True); raise SystemExit(4)"
    child = children.start("chatty", python(chatty))
    await until(lambda: child.restarts >= 2)
    assert list(child.last_output)[:3] == ["begins", "." * 300, "begins"]


async def test_a_child_that_prints_without_end_still_runs_and_is_ended(children, tmp_path):
    said = tmp_path / "said"  # all of it was taken: more than any pipe holds
    endless = "import pathlib, time; print('.' * 300_000, end='', flush=True); "
    then = f"pathlib.Path({str(said)!r}).touch(); time.sleep(60)"
    child = children.start("endless", python(endless + then))
    await until(said.exists)
    pid = child.pid
    assert (child.state, child.restarts) == ("running", 0)
    await children.stop("endless")
    with pytest.raises(ProcessLookupError):
        os.kill(pid, 0)


@pytest.mark.parametrize("cut", [1, 2, 5, 1000])
async def test_lines_are_kept_whole_however_they_come(cut):
    said = "one\r\n\ntwo – three\n" + "x" * 2000 + "\nlast"
    output = asyncio.StreamReader()
    words: deque[str] = deque(maxlen=20)
    for first in range(0, len(said.encode()), cut):
        output.feed_data(said.encode()[first : first + cut])
    output.feed_eof()
    await _read_output(output, words)
    assert list(words) == ["one", "", "two – three", "x" * 300, "last"]


async def test_a_fault_of_ours_leaves_a_child_supervised_and_no_stop_undone(
    children, monkeypatch, caplog
):
    told = []

    async def listen(output, words):
        told.append(output)
        if len(told) == 1:
            raise RuntimeError("a fault")
        await asyncio.sleep(60)

    monkeypatch.setattr("rehab.sessions.live.supervisor._read_output", listen)
    child = children.start("robot", python("import time; time.sleep(60)"))
    await until(lambda: len(told) == 2)
    assert (child.state, child.restarts) == ("running", 1)
    assert "robot could not be supervised" in caplog.text

    async def stop(name):
        raise RuntimeError("another fault")

    with monkeypatch.context() as patch:
        patch.setattr(children, "stop", stop)
        await children.stop_all()
    assert "A child did not end cleanly" in caplog.text


async def test_a_report_that_cannot_be_written_harms_no_child(tmp_path, caplog):
    children = Supervisor(tmp_path / "nowhere" / "children.json", first_backoff_s=0.02)
    child = children.start("recording", python("pass"))
    await until(lambda: child.state == "done")
    await children.stop("recording")
    await children.stop_all()
    assert "could not be written" in caplog.text


async def test_the_loop_waits_for_no_disk_and_the_last_word_report_is_current(
    children, tmp_path, monkeypatch
):
    disk, written, replace = threading.Event(), [], Supervisor._replace_report

    def replace_late(self, text):
        assert disk.wait(5)
        written.append(text)
        replace(self, text)

    monkeypatch.setattr(Supervisor, "_replace_report", replace_late)
    first = children.start("first", python("import time; time.sleep(60)"))
    await until(lambda: first.pid is not None)
    second = children.start("second", python("import time; time.sleep(60)"))
    await until(lambda: second.pid is not None)
    await children.stop("first")
    assert not written
    disk.set()
    await children.stop_all()
    assert json.loads((tmp_path / "children.json").read_text())["children"] == []
    assert len(written) <= 3  # what was out of date before it could be written is not
