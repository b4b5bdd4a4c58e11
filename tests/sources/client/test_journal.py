"""What a source has not sent yet outlives its program, the power and a full disk."""

import errno
import json
import os
import re
import stat
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from functools import partial
from threading import Event

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rehab.sources.client import Journal, LiveFeed, SourceClient, StepQueue, StepsLost
from rehab.sources.client import journal as journal_module
from rehab.sources.reporting import SourceError
from rehab.training.steps import Measurement, Side
from robot.link import Link
from tests.sources.fake_garry import TOKEN, FakeGarry, serve_garry
from tests.support.running_client import QUICK, running, until

SERVER = "wss://garry.example/ws/source/"


def stride(number):
    return Measurement(number=number, time_s=1.5 * number, side=Side.LEFT, value=number / 10)


@contextmanager
def opened(path, said=None, size=1_000_000, **more):
    """Open a journal until the power goes: nothing is closed in order."""
    journal = Journal(path, SERVER, size, [].append if said is None else said.append, **more)
    try:
        yield journal
    finally:
        os.close(journal._file)
        os.close(journal._guard)


def values(kept):
    return [step["value"] for step in kept.steps]


def walk(journal, numbers, session=7):
    queue = StepQueue(journal)
    if queue.session is None:
        queue.join(session, 1, "left")
        queue.note_state("running")
    for number in numbers:
        queue.add(stride(number))
    return queue


def test_what_was_not_acknowledged_is_there_again(tmp_path):
    path = tmp_path / "journal"
    with opened(path) as journal:
        queue = walk(journal, range(1, 11))
        queue.acknowledge(4)
    assert stat.S_IMODE(path.stat().st_mode) == 0o600
    said: list[str] = []
    with opened(path, said) as journal:
        assert (journal.saved.session, journal.saved.side, journal.saved.state) == (
            (7, "left", "running")
        )
        again = StepQueue(journal, marks_late=True)
        again.join(7, 6)
        frame = again.next_frame()
    assert [step["number"] for step in frame["steps"]] == [5, 6, 7, 8, 9, 10]
    assert all(step["late"] for step in frame["steps"])
    assert "6 strides of session 7" in said[0]


@settings(deadline=None)
@given(st.integers(0, 400), st.booleans())
def test_a_torn_end_costs_nothing_that_was_whole(tmp_path_factory, cut, is_blank):
    """A cut anywhere leaves a prefix of the strides, whether the rest is missing or blank."""
    path = tmp_path_factory.mktemp("torn") / "journal"
    with opened(path) as journal:
        walk(journal, range(1, 11))
    data = path.read_bytes()
    head = data.index(b"\n", data.index(b"running")) + 1
    at = min(len(data), head + cut)
    path.write_bytes(data[:at] + (b"\0" * 700 if is_blank else b""))
    with opened(path) as journal:
        whole = data[:at].count(b"\n") - 3
        assert values(journal.saved) == [n / 10 for n in range(1, whole + 1)]


def test_a_failing_disk_is_said_and_what_it_holds_is_put_aside(tmp_path):
    path = tmp_path / "journal"
    said: list[str] = []
    with opened(path) as journal:
        walk(journal, range(1, 11))
    damaged = path.read_bytes().replace(b'"value":0.3', b'"value":9.3')
    path.write_bytes(damaged)
    with opened(path, said) as journal:
        assert values(journal.saved) == [0.1, 0.2]
    assert "is damaged from byte" in said[0]
    assert (tmp_path / "journal.damaged").read_bytes() == damaged


def test_a_journal_of_another_server_another_source_or_of_nothing_is_refused(tmp_path):
    path = tmp_path / "journal"
    with opened(path), pytest.raises(SourceError, match="Another source uses"):
        Journal(path, SERVER, 1000, print)
    with pytest.raises(SourceError, match=re.escape(f"for {SERVER}, not for ws://other")):
        Journal(path, "ws://other", 1000, print)
    path.write_text("time_s,value\n")
    with pytest.raises(SourceError, match="is no journal"):
        Journal(path, SERVER, 1000, print)
    with pytest.raises(SourceError, match="cannot be used"):
        Journal(tmp_path / "missing" / "journal", SERVER, 1000, print)


@pytest.mark.parametrize("acknowledged", [2, 3])
def test_numbers_that_the_server_has_already_are_not_given_twice(tmp_path, acknowledged):
    """The power takes strides 4 and 5 from the journal; the server has them."""
    path = tmp_path / "journal"
    with opened(path) as journal:
        walk(journal, [1, 2, 3]).acknowledge(acknowledged)
    for numbers in ([14, 15], [16]):  # walked offline, with another cut between
        with opened(path) as journal:
            walk(journal, numbers)
    with opened(path) as journal:
        queue = StepQueue(journal)
        queue.join(7, 6)
        assert [(kept.number, kept.step["value"]) for kept in queue._kept] == [
            *[(3, 0.3)][acknowledged - 2 :],
            (6, 1.4),
            (7, 1.5),
            (8, 1.6),
        ]
        assert queue.add(stride(17)) == 9


def test_a_restart_gets_over_a_server_that_was_set_back(tmp_path):
    """The number of its session may be another one's now: what is kept is put aside."""
    path = tmp_path / "journal"
    with opened(path) as journal:
        queue = walk(journal, range(1, 8))
        queue.acknowledge(5)
        with pytest.raises(StepsLost):
            queue.join(7, 3)
    before, said = path.read_bytes(), list[str]()
    with opened(path, said) as journal:
        queue = walk(journal, [])
        assert queue.join(7, 3) == 2
        assert queue.add(stride(8)) == 3
    assert (tmp_path / "journal.aside").read_bytes().splitlines()[2:] == [
        line for line in before.splitlines() if b'"number":6' in line or b'"number":7' in line
    ]
    assert "journal.aside" in said[-1]
    with opened(path) as journal:  # it has heard of the server that it has now
        queue = walk(journal, [])
        assert queue.join(7, 3) == 0
        assert [(kept.number, kept.step["value"]) for kept in queue._kept] == [(3, 0.8)]


def test_the_file_stays_small_while_all_is_stored(tmp_path, monkeypatch):
    monkeypatch.setattr(journal_module, "REWRITE_BYTES", 2000)
    path = tmp_path / "journal"
    with opened(path) as journal:
        queue = walk(journal, [])
        for number in range(1, 500):
            queue.add(stride(number))
            queue.acknowledge(number)
            assert path.stat().st_size < 4000


def test_without_room_the_oldest_stay_and_it_is_said(tmp_path):
    path, now = tmp_path / "journal", [0.0]
    said: list[str] = []
    with opened(path, said, size=2000, monotonic=lambda: now[0]) as journal:
        queue = walk(journal, range(1, 101))
        assert path.stat().st_size <= 2000
        assert "in memory only" in said[-1]
        assert "has the" in journal.trouble
        assert queue.unacknowledged == 100  # nothing is dropped
        kept = journal._read()
        assert values(kept) == [n / 10 for n in range(1, len(kept.steps) + 1)]
        queue.acknowledge(95)
        assert journal.trouble
        now[0] = 11.0
        queue.acknowledge(96)
        assert not journal.trouble
        assert values(journal._read()) == [9.7, 9.8, 9.9, 10.0]
        assert said[-1].endswith("has all strides again.")


def test_a_full_disk_is_said_and_tried_again(tmp_path, monkeypatch):
    path, now = tmp_path / "journal", [0.0]
    said: list[str] = []
    with opened(path, said, monotonic=lambda: now[0]) as journal:
        queue = walk(journal, [1, 2])
        write = os.write
        with monkeypatch.context() as full:

            def write_some(file, data):
                if len(data) < 20:
                    raise OSError(errno.ENOSPC, "No space left on device")
                return write(file, data[:19])  # torn, as a full disk does

            full.setattr(os, "write", write_some)
            for number in range(3, 10):
                queue.add(stride(number))
                now[0] += 3.0
        assert len(said) == 1
        assert "No space left on device" in said[0]
        assert values(journal._read()) == [0.1, 0.2]
        now[0] += 11.0
        queue.add(stride(10))
        assert values(journal._read()) == [n / 10 for n in range(1, 11)]


def test_a_disk_that_is_gone_costs_no_other_file(tmp_path, monkeypatch):
    """What this program opens next gets the number that the journal's file had."""
    path, now = tmp_path / "journal", [0.0]
    with opened(path, monotonic=lambda: now[0]) as journal:
        queue = walk(journal, [1])
        open_file = os.open
        with monkeypatch.context() as gone:

            def open_unless_journal(name, flags, *mode):
                if name == path:
                    raise OSError(errno.ENOENT, "No such file or directory")
                return open_file(name, flags, *mode)

            gone.setattr(os, "open", open_unless_journal)
            journal.renew(queue._all())
        assert journal.trouble
        with (tmp_path / "other").open("wb") as other:
            journal.sync()
            now[0] = 11.0
            queue.add(stride(2))
            other.write(b"whole")
        assert values(journal._read()) == [0.1, 0.2]
    assert (tmp_path / "other").read_bytes() == b"whole"


def test_no_stride_waits_for_the_disk(tmp_path, monkeypatch):
    with opened(tmp_path / "journal") as journal, monkeypatch.context() as slow:
        queue = walk(journal, [1])
        is_waiting, has_written = Event(), Event()

        def sync(_file):
            is_waiting.set()
            assert has_written.wait(5)

        slow.setattr(os, "fsync", sync)
        with ThreadPoolExecutor() as threads:
            disk = threads.submit(journal.sync)
            assert is_waiting.wait(5)
            stepping = threads.submit(queue.add, stride(2))
            stepping.result(1)
            has_written.set()
            disk.result(5)
        assert journal.is_dirty  # what came meanwhile is for the next time
        assert values(journal._read()) == [0.1, 0.2]


async def test_hours_offline_over_a_restart_end_up_once_in_the_log(tmp_path):
    """Strides 1 to 5 with a server, 6 to 10 without, 11 to 15 after the program was killed."""
    garry, path = FakeGarry(), tmp_path / "journal"

    def start(journal, said):
        feed = LiveFeed()
        dial = partial(Link, garry.url, TOKEN, timing=QUICK)
        return feed, SourceClient(dial, feed, journal=journal, notify=said.append)

    said: list[str] = []
    async with serve_garry(garry) as server:
        port = server.sockets[0].getsockname()[1]
        with opened(path, said) as journal:
            feed, client = start(journal, said)
            async with running(client):
                await until(lambda: feed.is_running)
                for number in range(1, 6):
                    feed.put(stride(number))
                await until(lambda: client.acknowledged == 5)
                server.close()
                await server.wait_closed()
                for number in range(6, 11):
                    feed.put(stride(number))
                await until(lambda: client.unacknowledged == 5 and not journal.is_dirty)
    with opened(path, said) as journal:
        feed, client = start(journal, said)
        async with running(client) as task:
            for number in range(11, 16):
                feed.put(stride(number))
            await until(lambda: client.unacknowledged == 10)
            assert "Session 7 running, server out of reach" in client.describe()
            async with serve_garry(garry, port):
                await until(lambda: client.acknowledged == 10)
                feed.put(stride(16))
                feed.finish()
                await task
    assert garry.numbers == list(range(1, 17))
    assert [step["value"] for step in garry.log] == [n / 10 for n in range(1, 17)]
    assert [step["number"] for step in garry.log if step.get("late")] == [6, 7, 8, 9, 10]
    with opened(path) as journal:
        assert not journal.saved.steps


def test_the_command_line_names_a_journal_that_cannot_be_used(tmp_path, capsys):
    from rehab.sources.__main__ import EXIT_UNUSABLE, main

    path = tmp_path / "steps.csv"
    path.write_text(json.dumps({"a": 1}) + "\n")
    words = ["rows", "--listen", "tcp://127.0.0.1:0", "--token", "t", "--journal", str(path)]
    assert main(words) == EXIT_UNUSABLE
    assert "is no journal of a source" in capsys.readouterr().err
