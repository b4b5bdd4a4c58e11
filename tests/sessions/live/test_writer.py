"""What is committed has happened, and nothing else: the writer, owners, recovery, the drain."""

from __future__ import annotations

import asyncio
import os
import socket
import subprocess
import sys
from typing import Any

import pytest
from asgiref.sync import sync_to_async
from django.db import DatabaseError

from rehab.sessions.live import owners
from rehab.sessions.live import runtime as runtimes
from rehab.sessions.live import writer as writers
from rehab.sessions.live.actor import SessionActor
from rehab.sessions.live.writer import Fenced, Job, Refolded, Writer
from rehab.sessions.log import SessionEvent, Step
from rehab.sessions.models import TrainingSession
from rehab.training.changes import Change, ChangeKind
from rehab.training.steps import Measurement, Side
from tests.sessions.live.callers import a_step, change, turns
from tests.world import NOW


class Bench:
    """A writer on its own, the transactions it made, and what it reported."""

    def __init__(self, stall: Any, monkeypatch: pytest.MonkeyPatch) -> None:
        self.stall = stall
        self.batches: list[list[int]] = []
        self.done: list[tuple[int, Exception | None]] = []
        commit = writers.commit

        def counted(jobs: Any) -> None:
            self.batches.append([job.session_id for job in jobs])
            commit(jobs)

        monkeypatch.setattr(writers, "commit", counted)
        self.writer = Writer(lambda function: function())

    def submit(self, actor: SessionActor, rows: list[Any]) -> None:
        session = actor.session
        self.writer.submit(
            Job(
                actor,
                session.pk,
                session.epoch,
                rows,
                actor.summary(),
                lambda problem: self.done.append((session.pk, problem)),
            )
        )

    def walk(self, actor: SessionActor, value: float = 4.0) -> None:
        number = actor.fold.last_number + 1
        stride = Measurement(number, number * 1.1, Side.LEFT, value)
        self.submit(actor, [actor.take(stride, NOW)])


@pytest.fixture
def bench(live_path, stall, monkeypatch):
    bench = Bench(stall, monkeypatch)
    yield bench
    stall.end()
    bench.writer.close()


@pytest.fixture
async def actors(place, ready, bench) -> list[SessionActor]:
    actors = [SessionActor(await ready(place, at_station=False)) for _ in range(3)]
    for actor in actors:
        bench.submit(actor, actor.change(Change(ChangeKind.START), None, NOW))
    return actors


async def until_done(bench: Bench, count: int) -> None:
    async with asyncio.timeout(5):
        while len(bench.done) < count:  # noqa: ASYNC110
            await asyncio.sleep(0.001)


def fail_on(monkeypatch: pytest.MonkeyPatch, session_id: int, problem: Exception) -> None:
    """Let writes of one session fail until ``monkeypatch`` takes it back."""
    insert = writers._insert_steps

    def failing(rows: Any) -> None:
        if any(row.session_id == session_id for row in rows):
            raise problem
        insert(rows)

    monkeypatch.setattr(writers, "_insert_steps", failing)


async def test_what_is_queued_is_committed_in_one_transaction(bench, actors):
    await until_done(bench, 3)
    bench.batches.clear()
    bench.stall.begin()
    bench.walk(actors[0])
    while not bench.batches:  # noqa: ASYNC110
        await asyncio.sleep(0.001)
    for actor in actors * 10:
        bench.walk(actor)
    bench.stall.end()
    await until_done(bench, 34)
    assert [len(batch) for batch in bench.batches] == [1, 30]
    assert await Step.everywhere.acount() == 31
    assert all(problem is None for _, problem in bench.done)


@pytest.mark.parametrize("problem", [DatabaseError("disk"), RuntimeError("bug"), OverflowError()])
async def test_a_session_that_fails_harms_no_other(bench, actors, monkeypatch, problem):
    await until_done(bench, 3)
    bench.done.clear()
    bad, good, other = actors
    bench.stall.begin()
    fail_on(monkeypatch, bad.session.pk, problem)
    for _ in range(5):
        for actor in (bad, good, other):
            bench.walk(actor)
    bench.stall.end()
    await until_done(bench, 15)
    assert await Step.everywhere.filter(session=bad.session).acount() == 0
    assert await Step.everywhere.filter(session=good.session).acount() == 5
    assert await Step.everywhere.filter(session=other.session).acount() == 5
    problems = [found for pk, found in bench.done if pk == bad.session.pk]
    assert problems[0] is problem
    assert all(isinstance(found, Refolded) for found in problems[1:])


async def test_nothing_is_written_after_a_failed_job_of_the_same_owner(bench, actors, monkeypatch):
    actor = actors[0]
    with monkeypatch.context() as patch:
        fail_on(patch, actor.session.pk, DatabaseError("disk"))
        bench.walk(actor)
        await until_done(bench, 4)
    bench.walk(actor)  # the disk is well again, but step 1 is not there
    await until_done(bench, 5)
    assert isinstance(bench.done[-1][1], Refolded)
    assert await Step.everywhere.acount() == 0
    session = await TrainingSession.everywhere.aget(pk=actor.session.pk)
    rebuilt = await sync_to_async(SessionActor.load)(session)
    bench.walk(rebuilt)
    await until_done(bench, 6)
    assert bench.done[-1][1] is None
    assert await Step.everywhere.acount() == 1


async def test_a_session_that_was_taken_over_is_fenced(bench, actors):
    await until_done(bench, 3)
    bench.done.clear()
    lost, kept, _ = actors
    await TrainingSession.everywhere.filter(pk=lost.session.pk).aupdate(epoch=7)
    bench.stall.begin()
    for actor in (lost, kept, lost):
        bench.walk(actor)
    bench.stall.end()
    await until_done(bench, 3)
    assert [(pk, type(problem)) for pk, problem in bench.done] in (
        [
            (lost.session.pk, Fenced),
            (kept.session.pk, type(None)),
            (lost.session.pk, Refolded),
        ],
        [
            (lost.session.pk, Fenced),
            (kept.session.pk, type(None)),
            (lost.session.pk, Fenced),
        ],
    )
    assert await Step.everywhere.filter(session=kept.session).acount() == 1
    assert await Step.everywhere.filter(session=lost.session).acount() == 0


async def test_close_commits_everything_that_is_queued(bench, actors):
    for _ in range(200):
        bench.walk(actors[0])
    bench.writer.close()
    assert await Step.everywhere.acount() == 200
    assert len(bench.done) == 203
    assert not bench.writer._thread.is_alive()
    bench.writer.close()


# --- owners ---------------------------------------------------------------------------------------

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
    assert owners.is_alive(owners.my_name())
    parent = os.getppid()
    assert owners.is_alive(f"{HOST}|{parent}|{owners._started(parent)}")


async def own(session: TrainingSession, owner: str) -> None:
    await TrainingSession.everywhere.filter(pk=session.pk).aupdate(owner=owner)


async def reread(session: TrainingSession) -> Any:
    return await TrainingSession.everywhere.aget(pk=session.pk)


async def test_a_session_is_claimed_from_the_dead_and_given_up_at_the_drain(place, ready):
    session = await ready(place)
    await own(session, f"{HOST}|{dead_pid()}|5")
    await runtimes.current().session(session.pk)
    claimed = await reread(session)
    assert (claimed.owner, claimed.epoch) == (owners.my_name(), session.epoch + 1)
    await runtimes.current().drain()
    assert (await reread(session)).owner == ""


# --- recovery -------------------------------------------------------------------------------------


async def left_running(place: Any, begun: Any, steps: int) -> TrainingSession:
    """Leave a session as a process that was killed leaves it."""
    session: TrainingSession = await begun(place)
    source = await place.source().dial()
    await source.hello()
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


async def test_a_session_that_runs_elsewhere_is_left_alone(place, begun, settings):
    session = await left_running(place, begun, 1)
    parent = os.getppid()
    settings.HOSTED = True  # there, other machines share the database
    for owner in (f"{HOST}|{parent}|{owners._started(parent)}", "elsewhere|1|1"):
        await own(session, owner)
        assert await runtimes.current().recover() == 0
    assert (await reread(session)).state == "running"


async def test_one_broken_session_keeps_no_other_from_coming_back(place, elsewhere, begun):
    broken = await left_running(place, begun, 1)
    sound = await left_running(elsewhere, begun, 2)
    await TrainingSession.everywhere.filter(pk=broken.pk).aupdate(plan={})
    await runtimes.current().recover()
    assert (await reread(sound)).state == "paused"


# --- drain ----------------------------------------------------------------------------------------


async def test_the_drain_commits_and_closes_every_socket_with_4012(place, begun, stall):
    session = await begun(place)
    source = await place.source().dial()
    await source.hello()
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
