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
from collections.abc import Collection, Mapping
from types import SimpleNamespace
from typing import Any

import pytest
from asgiref.sync import sync_to_async
from django.db import DatabaseError

from rehab.sessions.live import runtime as runtimes
from rehab.sessions.live.consumers.base import Socket
from rehab.sessions.live.database import clinic_owners, server_lease
from rehab.sessions.live.session import loading
from rehab.sessions.live.session.live_session import LiveSession
from rehab.sessions.live.supervisor import source_name
from rehab.sessions.log import SessionEvent, Step
from rehab.sessions.models import TrainingSession
from rehab.sessions.ownership import ClinicOwner
from tests.support.callers import a_step, change, reread, turns
from tests.support.world import set_owner

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
    assert clinic_owners.is_alive(owner) == alive


@pytest.mark.parametrize(
    ("valid", "knows", "alive"),
    [
        (["here", "there"], True, True),
        (["here"], True, False),
        (["here"], False, False),  # a command, which has no lease
        ([], True, True),  # its own has expired, too: the database's clock was set
    ],
    ids=["leased", "expired", "no lease", "all expired"],
)
def test_a_hosted_owner_lives_as_long_as_its_lease(valid, knows, alive, settings, monkeypatch):
    settings.HOSTED = True
    own = SimpleNamespace(may_judge_by=lambda ids: "here" in ids)
    monkeypatch.setattr(server_lease, "held", lambda: own if knows else None)
    monkeypatch.setattr(
        server_lease, "valid_servers", lambda: [SimpleNamespace(id=one) for one in valid]
    )
    assert clinic_owners.is_alive("there") == alive


def test_a_process_that_has_ended_is_dead_and_this_one_lives():
    assert not clinic_owners.is_alive(f"{HOST}|{dead_pid()}|5")
    assert clinic_owners.is_alive(clinic_owners.own_name())
    parent = os.getppid()
    assert clinic_owners.is_alive(f"{HOST}|{parent}|{clinic_owners._start_time(parent)}")


def call_processes(monkeypatch: pytest.MonkeyPatch) -> threading.local:
    """Let threads stand for processes that all live; each says its name in what this gives."""
    process = threading.local()
    monkeypatch.setattr(clinic_owners, "own_name", lambda: process.name)
    monkeypatch.setattr(clinic_owners, "is_alive", lambda owner, _: owner.startswith("process"))
    return process


async def test_of_two_that_claim_a_clinic_at_once_one_has_it(place, monkeypatch):
    process = call_processes(monkeypatch)
    clinic_id, find, refused = place.clinic.pk, clinic_owners.find_elsewhere, list[Any]()

    def find_late(*args: Any) -> Any:
        found = find(*args)
        if process.name == "process|1|0" and not refused:  # the other one comes before it writes
            process.name = "process|2|0"
            clinic_owners.claim(clinic_id)
            process.name = "process|1|0"
            refused.append(found)
        return found

    def claim() -> None:
        process.name = "process|1|0"
        with pytest.raises(clinic_owners.OwnedElsewhere, match=r"another process \(2\)"):
            clinic_owners.claim(clinic_id)

    monkeypatch.setattr(clinic_owners, "find_elsewhere", find_late)
    await sync_to_async(claim)()
    stored = await ClinicOwner.everywhere.aget(pk=clinic_id)
    assert (stored.owner, stored.epoch) == ("process|2|0", 1)
    assert refused == [None]


async def test_a_clinic_released_while_it_is_claimed_is_no_dead_servers(place, begun, monkeypatch):
    session = await begun(place)
    await runtimes.current().drain()
    await own(session, f"{HOST}|{dead_pid()}|5")
    find = clinic_owners.find_elsewhere

    def find_late(clinic_id: int, owner: str) -> Any:
        found = find(clinic_id, owner)
        set_owner(clinic_id, clinic_owners.HANDED_ON)
        return found

    monkeypatch.setattr(clinic_owners, "find_elsewhere", find_late)
    claimed = await sync_to_async(clinic_owners.claim)(place.clinic.pk)
    assert (claimed.running, claimed.is_orphaned) == ([session.pk], False)


FAKE_PS = """#!/bin/sh
test "$*" = "-o lstart= -p {pid}" || exit 1
echo "$LC_ALL $TZ  {when}  "
"""


def test_where_no_folder_tells_of_processes_ps_tells_when_they_started(tmp_path, monkeypatch):
    monkeypatch.setattr(clinic_owners, "PROC_DIR", tmp_path / "none")
    monkeypatch.setenv("PATH", str(tmp_path), prepend=":")
    pid = os.getppid()
    ps = tmp_path / "ps"
    ps.write_text(FAKE_PS.format(pid=pid, when="Sat Nov  7 09:05:01 2026"))
    ps.chmod(0o755)
    started = clinic_owners._start_time(pid)
    assert started == "C UTC Sat Nov 7 09:05:01 2026"
    owner = f"{HOST}|{pid}|{started}"
    assert clinic_owners.is_alive(owner)
    # After a crash and a restart of the computer the number is another process's.
    ps.write_text(FAKE_PS.format(pid=pid, when="Sun Nov  8 08:00:00 2026"))
    assert not clinic_owners.is_alive(owner)
    assert clinic_owners._start_time(1) == ""
    ps.unlink()
    monkeypatch.setenv("PATH", str(tmp_path))
    assert clinic_owners._start_time(pid) == ""


@pytest.mark.skipif(shutil.which("ps") is None, reason="this machine has no ps")
def test_what_the_real_ps_tells(tmp_path, monkeypatch):
    monkeypatch.setattr(clinic_owners, "PROC_DIR", tmp_path / "none")
    started = clinic_owners._start_time(os.getpid())
    assert re.fullmatch(r"\w{3} \w{3} \d{1,2} [\d:]{8} \d{4}", started)
    assert clinic_owners._start_time(dead_pid()) == ""


async def own(session: TrainingSession, owner: str) -> None:
    await sync_to_async(set_owner)(session.clinic_id, owner)


async def owner_of(session: TrainingSession) -> str:
    return (await ClinicOwner.everywhere.aget(pk=session.clinic_id)).owner


async def test_a_clinic_is_claimed_from_the_dead_and_released_at_the_drain(place, ready):
    session = await ready(place)
    await own(session, f"{HOST}|{dead_pid()}|5")
    live = await runtimes.current().session(session.pk)
    assert (await owner_of(session), live.epoch) == (clinic_owners.own_name(), 1)
    await runtimes.current().drain()
    assert await owner_of(session) == ""


async def test_a_clinic_is_released_when_nobody_is_there(place, ready):
    session, runtime = await ready(place), runtimes.current()
    source = await place.source().open()
    for _ in range(3):
        await runtime.close_unused_clinics()
    assert await owner_of(session) == clinic_owners.own_name()
    await source.hang_up()
    await runtime.close(runtime.sessions[session.pk])
    for _ in range(2):
        await runtime.close_unused_clinics()
    assert await owner_of(session) == ""
    assert (await (await place.source().dial()).hello())["session"] == session.pk
    assert await owner_of(session) == clinic_owners.own_name()


async def test_a_device_that_waits_has_its_clinic_here(place):
    robot = await place.robot().dial()
    assert (await robot.hello())["session"] is None
    assert place.clinic.pk in runtimes.current().clinics


async def test_a_clinic_that_another_process_took_is_dropped_with_all_its_sockets(
    place, begun, bystander, monkeypatch
):
    session = await begun(place)
    source, tablet = await place.source().open(), await place.tablet(session).open()
    runtime, parent = runtimes.current(), os.getppid()
    stopped: list[str] = []

    async def stop(name: str) -> None:
        stopped.append(name)

    monkeypatch.setattr(runtime.supervisor, "stop", stop)
    taken = ClinicOwner.everywhere.filter(pk=place.clinic.pk)
    other = f"{HOST}|{parent}|{clinic_owners._start_time(parent)}"
    await taken.aupdate(owner=other, epoch=7)
    await source.say(a_step(1))
    assert (await source.sent_away())[0] == 4011
    assert (await tablet.sent_away())[0] == 4012
    assert place.clinic.pk not in runtime.clinics
    assert session.pk not in runtime.sessions
    assert stopped == [source_name(session.pk)]
    assert not await Step.everywhere.filter(session=session).aexists()
    again = await place.tablet(session).dial()
    assert (await again.sent_away())[0] == 4421


async def test_a_session_that_loads_while_its_clinic_goes_is_not_kept_here(
    place, begun, monkeypatch
):
    """It would hear of no step: pages there would wait for ever."""
    session = await begun(place)
    runtime = runtimes.current()
    del runtime.sessions[session.pk]  # as after a commit that failed
    pause_orphaned, parent = runtime.recovery.pause_orphaned, os.getppid()

    async def lose_clinic(live: LiveSession) -> None:
        monkeypatch.setattr(runtime.recovery, "pause_orphaned", pause_orphaned)
        await runtime.clinics.release(live.clinic_id)
        await own(session, f"{HOST}|{parent}|{clinic_owners._start_time(parent)}")

    monkeypatch.setattr(runtime.recovery, "pause_orphaned", lose_clinic)
    with pytest.raises(clinic_owners.OwnedElsewhere):
        await runtime.session(session.pk)
    assert session.pk not in runtime.sessions


async def test_a_clinic_without_an_open_session_moves_to_another_server(place, sourced):
    session, source = await sourced(place)
    tablet, runtime = await place.tablet(session).open(), runtimes.current()
    await source.walk(4.0, 4.0)
    await change(session, "pause")
    await runtime.give_up(place.clinic.pk)  # it is open: nothing happens
    assert await owner_of(session) == clinic_owners.own_name()
    await change(session, "finish")
    await runtime.give_up(place.clinic.pk)
    assert await owner_of(session) == ""
    assert (await source.sent_away())[0] == 4012
    assert (await tablet.sent_away())[0] == 4012
    assert session.pk not in runtime.sessions
    assert (await place.tablet(session).watch())["number"] == 2


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
    assert await owner_of(session) == clinic_owners.own_name()
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
    for owner in (f"{HOST}|{parent}|{clinic_owners._start_time(parent)}", "elsewhere|1|1"):
        await own(session, owner)
        assert await runtimes.current().recover() == 0
    assert (await reread(session)).state == "running"


async def test_a_session_that_another_server_recovered_meanwhile_is_not_paused_again(
    place, begun, monkeypatch
):
    session = await left_running(place, begun, 1)
    with monkeypatch.context() as patch:

        def fail(epochs: Mapping[int, int]) -> Any:
            raise DatabaseError("the connection was lost")

        patch.setattr(loading, "load_together", fail)
        assert await runtimes.current().recover() == 1
    runtimes.current().lose(place.clinic.pk)
    # There it was resumed, and released.
    await ClinicOwner.everywhere.filter(pk=place.clinic.pk).aupdate(
        owner=clinic_owners.HANDED_ON, epoch=9
    )
    runtimes.current().recovery.forget(session.pk)
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
    assert await owner_of(session) == clinic_owners.HANDED_ON
    listening.set()


async def test_who_asks_for_a_clinic_while_it_is_released_gets_it_again(place, ready, monkeypatch):
    session, runtime = await ready(place), runtimes.current()
    await runtime.session(session.pk)
    await change(session, "abort")
    release, may_release = clinic_owners.release, threading.Event()

    def release_late(clinic_ids: Collection[int]) -> None:
        assert may_release.wait(10)
        release(clinic_ids)

    monkeypatch.setattr(clinic_owners, "release", release_late)
    leaving = asyncio.create_task(runtime.give_up(place.clinic.pk))
    await turns()
    opening = asyncio.create_task(runtime.session(session.pk))
    await turns()
    assert not opening.done()
    may_release.set()
    await asyncio.gather(leaving, opening)
    assert await owner_of(session) == clinic_owners.own_name()


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

    def load_late(epochs: Mapping[int, int]) -> Any:
        loaded = load(epochs)
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
    assert await owner_of(session) == clinic_owners.HANDED_ON
    assert (await reread(session)).state == "running"
