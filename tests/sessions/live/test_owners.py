"""Which process writes a session: owners, recovery after a crash, the drain."""

from __future__ import annotations

import asyncio
import os
import re
import shutil
import socket
import subprocess
import sys
import threading
from collections.abc import Collection
from typing import Any

import pytest
from asgiref.sync import sync_to_async
from django.db import DatabaseError

from rehab.sessions.live import runtime as runtimes
from rehab.sessions.live.consumers.base import Socket
from rehab.sessions.live.database import owners
from rehab.sessions.live.session import loading
from rehab.sessions.log import SessionEvent, Step
from rehab.sessions.models import TrainingSession
from tests.support.callers import a_step, change, reread, turns

pytestmark = pytest.mark.postgres


HOST = socket.gethostname()


def dead_pid() -> int:
    gone = subprocess.Popen([sys.executable, "-c", ""])
    gone.wait()
    return gone.pid


@pytest.mark.parametrize(
    ("owner", "alive"),
    [
        ("", False),
        ("nonsense", False),
        (f"{HOST}|1", False),
        ("elsewhere|1|1", False),  # one machine that was given another name
        (f"{HOST}|{os.getpid()}|1", False),  # the number was given to another process since
    ],
    ids=["nobody", "nonsense", "no start", "another name", "another process"],
)
def test_which_owners_live(owner, alive):
    assert owners.is_alive(owner) == alive


def test_a_process_that_has_ended_is_dead_and_this_one_lives():
    assert not owners.is_alive(f"{HOST}|{dead_pid()}|5")
    assert owners.is_alive(owners.own_name())
    parent = os.getppid()
    assert owners.is_alive(f"{HOST}|{parent}|{owners._start_time(parent)}")


def call_processes(monkeypatch: pytest.MonkeyPatch) -> threading.local:
    """Let threads stand for processes that all live; each says its name in what this gives."""
    process = threading.local()
    monkeypatch.setattr(owners, "own_name", lambda: process.name)
    monkeypatch.setattr(owners, "is_alive", lambda owner: owner.startswith("process"))
    return process


async def test_of_two_that_claim_a_session_at_once_one_has_it(place, ready, monkeypatch):
    session = await ready(place)
    process = call_processes(monkeypatch)
    one, two = [await reread(session) for _ in range(2)]
    refresh, refused = TrainingSession.refresh_from_db, list[Any]()

    def refresh_late(read: TrainingSession, *args: Any, **options: Any) -> None:
        if read is one and not refused:  # the other one comes as the first one reads back
            process.name = "process|2|0"
            with pytest.raises(owners.OwnedElsewhere) as problem:
                owners.claim(two)
            refused.append(problem)
            process.name = "process|1|0"
        refresh(read, *args, **options)

    def claim() -> None:
        process.name = "process|1|0"
        owners.claim(one)

    monkeypatch.setattr(TrainingSession, "refresh_from_db", refresh_late)
    await sync_to_async(claim)()
    stored = await reread(session)
    assert (stored.owner, stored.epoch) == ("process|1|0", session.epoch + 1)
    assert (one.owner, one.epoch) == (stored.owner, stored.epoch)
    assert refused


FAKE_PS = """#!/bin/sh
test "$*" = "-o lstart= -p {pid}" || exit 1
echo "$LC_ALL $TZ  {when}  "
"""


def test_where_no_folder_tells_of_processes_ps_tells_when_they_started(tmp_path, monkeypatch):
    monkeypatch.setattr(owners, "PROC_DIR", tmp_path / "none")
    monkeypatch.setenv("PATH", str(tmp_path), prepend=":")
    pid = os.getppid()
    ps = tmp_path / "ps"
    ps.write_text(FAKE_PS.format(pid=pid, when="Sat Nov  7 09:05:01 2026"))
    ps.chmod(0o755)
    started = owners._start_time(pid)
    assert started == "C UTC Sat Nov 7 09:05:01 2026"
    owner = f"{HOST}|{pid}|{started}"
    assert owners.is_alive(owner)
    # After a crash and a restart of the computer the number is another process's.
    ps.write_text(FAKE_PS.format(pid=pid, when="Sun Nov  8 08:00:00 2026"))
    assert not owners.is_alive(owner)
    assert owners._start_time(1) == ""
    ps.unlink()
    monkeypatch.setenv("PATH", str(tmp_path))
    assert owners._start_time(pid) == ""


@pytest.mark.skipif(shutil.which("ps") is None, reason="this machine has no ps")
def test_what_the_real_ps_tells(tmp_path, monkeypatch):
    monkeypatch.setattr(owners, "PROC_DIR", tmp_path / "none")
    started = owners._start_time(os.getpid())
    assert re.fullmatch(r"\w{3} \w{3} \d{1,2} [\d:]{8} \d{4}", started)
    assert owners._start_time(dead_pid()) == ""


async def own(session: TrainingSession, owner: str) -> None:
    await TrainingSession.everywhere.filter(pk=session.pk).aupdate(owner=owner)


async def test_a_session_is_claimed_from_the_dead_and_given_up_at_the_drain(place, ready):
    session = await ready(place)
    await own(session, f"{HOST}|{dead_pid()}|5")
    await runtimes.current().session(session.pk)
    claimed = await reread(session)
    assert (claimed.owner, claimed.epoch) == (owners.own_name(), session.epoch + 1)
    await runtimes.current().drain()
    assert (await reread(session)).owner == ""


# --- recovery -------------------------------------------------------------------------------------


async def left_running(place: Any, begun: Any, steps: int) -> TrainingSession:
    """Leave a session as a process that was killed leaves it."""
    session: TrainingSession = await begun(place)
    source = await place.source().open()
    await source.walk(*[4.0] * steps)
    await source.hang_up()
    await runtimes.current().drain()
    runtimes._current = None
    await own(session, f"{HOST}|{dead_pid()}|5")
    return session


async def test_sessions_left_running_come_back_paused_and_complete(place, begun, ready):
    session = await left_running(place, begun, 5)
    waiting = await ready(place, at_station=False)
    assert await runtimes.current().recover() == 1
    assert (await reread(session)).state == "paused"
    assert (await reread(waiting)).state == "ready"
    event = await SessionEvent.everywhere.filter(session=session).alast()
    assert (event.kind, event.after_number, event.by_id) == ("pause", 5, None)
    source = await place.source().dial()
    welcome = await source.hello(session=session.pk)
    assert (welcome["state"], welcome["next"]) == ("paused", 6)
    await change(session, "resume")
    await source.walk(4.0)
    tablet = place.tablet(session)
    assert (await tablet.watch())["score"] == 6
    assert await runtimes.current().recover() == 0


async def test_a_session_that_was_given_up_in_good_order_goes_on(place, begun):
    session = await begun(place)
    await runtimes.current().drain()
    runtimes._current = None
    assert await runtimes.current().recover() == 0
    assert session.pk in runtimes.current().sessions  # with the source that the server runs, if any
    source = await place.source().dial()
    assert (await source.hello())["state"] == "running"
    assert not await SessionEvent.everywhere.filter(session=session, kind="pause").aexists()


async def test_a_session_of_a_dead_server_is_paused_by_whoever_takes_it_over(
    place, begun, stall, caplog
):
    session = await left_running(place, begun, 3)
    stall.problem = DatabaseError("disk")
    source = await place.source().dial()
    await source.say({"type": "hello", "version": 1, "run": "r1", "last": 3})
    assert (await source.sent_away())[0] == 4011
    stall.problem = None
    assert (await reread(session)).owner == owners.own_name()
    source = await place.source().dial()
    welcome = await source.hello()
    assert (welcome["state"], welcome["next"]) == ("paused", 4)
    assert f"Session {session.pk} was left running" in caplog.text
    events = SessionEvent.everywhere.filter(session=session, kind="pause")
    assert [event.data async for event in events] == [{"value": "restart"}]
    await change(session, "resume")
    await source.walk(4.0)


async def test_a_session_that_runs_elsewhere_is_left_alone(place, begun, settings):
    session = await left_running(place, begun, 1)
    parent = os.getppid()
    settings.HOSTED = True  # there, other machines share the database
    for owner in (f"{HOST}|{parent}|{owners._start_time(parent)}", "elsewhere|1|1"):
        await own(session, owner)
        assert await runtimes.current().recover() == 0
    assert (await reread(session)).state == "running"


async def test_a_session_that_another_server_recovered_meanwhile_is_not_paused_again(
    place, begun, monkeypatch
):
    session = await left_running(place, begun, 1)
    with monkeypatch.context() as patch:

        def fail(session_ids: Collection[int]) -> Any:
            raise DatabaseError("the connection was lost")

        patch.setattr(loading, "load_together", fail)
        assert await runtimes.current().recover() == 1
    epoch = (await reread(session)).epoch + 1
    row = TrainingSession.everywhere.filter(pk=session.pk)
    await row.aupdate(owner=owners.HANDED_ON, epoch=epoch)  # there it was resumed, and handed on
    live = await runtimes.current().session(session.pk)
    assert live.is_running
    assert not await SessionEvent.everywhere.filter(session=session, kind="pause").aexists()


async def test_one_broken_session_keeps_no_other_from_coming_back(place, elsewhere, begun):
    broken = await left_running(place, begun, 1)
    sound = await left_running(elsewhere, begun, 2)
    await TrainingSession.everywhere.filter(pk=broken.pk).aupdate(plan={})
    await runtimes.current().recover()
    assert (await reread(sound)).state == "paused"


# --- drain ----------------------------------------------------------------------------------------


async def test_a_client_that_does_not_listen_keeps_no_session_from_being_handed_on(
    place, begun, monkeypatch
):
    monkeypatch.setattr(runtimes, "FINISH_S", 0.05)
    session, runtime = await begun(place), runtimes.current()
    listening = asyncio.Event()
    monkeypatch.setattr(Socket, "close_now", lambda *_: listening.wait())
    await place.tablet(session).watch()
    await runtime.drain()
    assert (await reread(session)).owner == owners.HANDED_ON
    listening.set()


async def test_a_session_that_opens_again_while_it_is_closed_is_handed_on(
    place, ready, monkeypatch
):
    session, runtime = await ready(place), runtimes.current()
    live = await runtime.session(session.pk)
    release, may_release = owners.release, threading.Event()

    def release_late(session_id: int, epoch: int) -> None:
        assert may_release.wait(10)
        release(session_id, epoch)

    monkeypatch.setattr(owners, "release", release_late)
    closing = asyncio.create_task(runtime.close(live))
    await turns()
    opening = asyncio.create_task(runtime.session(session.pk))
    await turns()
    may_release.set()
    await asyncio.gather(closing, opening)
    await change(session, "start")
    await runtime.drain()
    assert (await reread(session)).owner == owners.HANDED_ON


async def test_the_drain_commits_and_closes_every_socket_with_4012(place, sourced, stall):
    session, source = await sourced(place)
    callers = [place.tablet(session), place.monitor(session), place.robot()]
    for caller in callers:
        await caller.dial()
    await callers[2].hello()
    stall.begin()
    await source.say({"type": "steps", "steps": [a_step(n) for n in range(1, 101)]})
    await turns()
    draining = asyncio.create_task(runtimes.current().drain())
    await turns()
    late = await place.source().dial()
    assert (await late.sent_away())[0] == 4012
    stall.end()
    await draining
    for caller in (source, *callers):
        assert (await caller.sent_away())[0] == 4012
    assert await Step.everywhere.filter(session=session).acount() == 100
    assert runtimes.peek() is None


async def test_a_session_that_opens_during_the_drain_is_released(place, begun, monkeypatch):
    session = await begun(place)
    await runtimes.current().drain()
    runtimes._current = None
    reading, may_read = threading.Event(), threading.Event()
    load = loading.load_together

    def load_late(session_ids: Collection[int]) -> Any:
        loaded = load(session_ids)
        reading.set()
        assert may_read.wait(10)
        return loaded

    monkeypatch.setattr(loading, "load_together", load_late)
    source = await place.source().dial()
    await source.say({"type": "hello", "version": 1, "run": "r1", "last": 0})
    await asyncio.get_running_loop().run_in_executor(None, reading.wait)
    draining = asyncio.create_task(runtimes.current().drain())
    await turns()
    with pytest.raises(runtimes.Draining):
        await runtimes.current().session(session.pk + 1)
    may_read.set()
    await draining
    left = await reread(session)
    assert (left.owner, left.state) == (owners.HANDED_ON, "running")
