"""What is committed has happened, and nothing else: the writer."""

from __future__ import annotations

import asyncio
import gc
import threading
import time
from typing import Any

import pytest
from asgiref.sync import sync_to_async
from django.db import DatabaseError
from opentelemetry.sdk.trace import TracerProvider
from opentelemetry.sdk.trace.export import SimpleSpanProcessor
from opentelemetry.sdk.trace.export.in_memory_span_exporter import InMemorySpanExporter

from rehab.sessions.live.session import commit_transaction, prometheus_metrics
from rehab.sessions.live.session import group_commit as writers
from rehab.sessions.live.session.aggregate import SessionAggregate
from rehab.sessions.live.session.commit_transaction import EarlierWriteFailed, Fenced, Job
from rehab.sessions.live.session.group_commit import Writer
from rehab.sessions.log import Step
from rehab.sessions.models import TrainingSession
from rehab.sessions.ownership import ClinicOwner
from rehab.training.changes import Change, ChangeKind
from rehab.training.steps import Measurement, Side
from tests.support.world import NOW

pytestmark = pytest.mark.postgres


class Bench:
    """A writer on its own, the transactions it made, and what it reported."""

    def __init__(self, stall: Any, monkeypatch: pytest.MonkeyPatch) -> None:
        self.stall = stall
        self.batches: list[list[int]] = []
        self.done: list[tuple[int, Exception | None]] = []
        commit = commit_transaction.commit

        def counted(jobs: Any) -> None:
            self.batches.append([job.session_id for job in jobs])
            commit(jobs)

        monkeypatch.setattr(writers, "commit", counted)
        self.writer = Writer(lambda function: function())

    def submit(self, aggregate: SessionAggregate, rows: list[Any]) -> None:
        session = aggregate.session
        self.writer.submit(
            Job(
                aggregate,
                session.pk,
                0,
                rows,
                aggregate.summary(),
                lambda problem: self.done.append((session.pk, problem)),
            )
        )

    def walk(self, aggregate: SessionAggregate, value: float = 4.0) -> None:
        number = aggregate.fold.last_number + 1
        stride = Measurement(number, number * 1.1, Side.LEFT, value)
        self.submit(aggregate, [aggregate.record_step(stride, NOW)])


@pytest.fixture
def bench(live_path, stall, monkeypatch):
    bench = Bench(stall, monkeypatch)
    yield bench
    stall.end()
    bench.writer.close()


@pytest.fixture
async def aggregates(place, ready, bench) -> list[SessionAggregate]:
    aggregates = [SessionAggregate(await ready(place, at_station=False)) for _ in range(3)]
    await ClinicOwner.everywhere.aget_or_create(pk=place.clinic.pk)
    for aggregate in aggregates:
        bench.submit(aggregate, aggregate.change(Change(ChangeKind.START), None, NOW))
    return aggregates


async def until_done(bench: Bench, count: int) -> None:
    async with asyncio.timeout(5):
        while len(bench.done) < count:  # noqa: ASYNC110
            await asyncio.sleep(0.001)


def fail_on(monkeypatch: pytest.MonkeyPatch, session_id: int, problem: Exception) -> None:
    """Let writes of one session fail until ``monkeypatch`` takes it back."""
    insert = commit_transaction._insert_steps

    def failing(rows: Any) -> None:
        if any(row.session_id == session_id for row in rows):
            raise problem
        insert(rows)

    monkeypatch.setattr(commit_transaction, "_insert_steps", failing)


async def test_what_is_queued_is_committed_in_one_transaction(bench, aggregates):
    await until_done(bench, 3)
    bench.batches.clear()
    bench.stall.begin()
    bench.walk(aggregates[0])
    while not bench.batches:  # noqa: ASYNC110
        await asyncio.sleep(0.001)
    for aggregate in aggregates * 10:
        bench.walk(aggregate)
    bench.stall.end()
    await until_done(bench, 34)
    assert [len(batch) for batch in bench.batches] == [1, 30]
    assert await Step.everywhere.acount() == 31
    assert all(problem is None for _, problem in bench.done)


@pytest.mark.parametrize("problem", [DatabaseError("disk"), RuntimeError("bug"), OverflowError()])
async def test_a_session_that_fails_harms_no_other(bench, aggregates, monkeypatch, problem):
    await until_done(bench, 3)
    bench.done.clear()
    bad, good, other = aggregates
    bench.stall.begin()
    fail_on(monkeypatch, bad.session.pk, problem)
    for _ in range(5):
        for aggregate in (bad, good, other):
            bench.walk(aggregate)
    bench.stall.end()
    await until_done(bench, 15)
    assert await Step.everywhere.filter(session=bad.session).acount() == 0
    assert await Step.everywhere.filter(session=good.session).acount() == 5
    assert await Step.everywhere.filter(session=other.session).acount() == 5
    problems = [found for pk, found in bench.done if pk == bad.session.pk]
    assert problems[0] is problem
    assert all(isinstance(found, EarlierWriteFailed) for found in problems[1:])


async def test_nothing_is_written_after_a_failed_job_of_the_same_owner(
    bench, aggregates, monkeypatch
):
    aggregate = aggregates[0]
    with monkeypatch.context() as patch:
        fail_on(patch, aggregate.session.pk, DatabaseError("disk"))
        bench.walk(aggregate)
        await until_done(bench, 4)
    bench.walk(aggregate)  # the disk is well again, but step 1 is not there
    await until_done(bench, 5)
    assert isinstance(bench.done[-1][1], EarlierWriteFailed)
    assert await Step.everywhere.acount() == 0
    session = await TrainingSession.everywhere.aget(pk=aggregate.session.pk)
    rebuilt = await sync_to_async(SessionAggregate.load)(session)
    bench.walk(rebuilt)
    await until_done(bench, 6)
    assert bench.done[-1][1] is None
    assert await Step.everywhere.acount() == 1


async def test_a_fault_of_the_thread_fails_its_jobs_and_does_not_end_it(
    bench, aggregates, monkeypatch
):
    await until_done(bench, 3)

    real_sleep, problems = time.sleep, [OSError("the clock is broken")]

    def sleep(seconds: float) -> None:
        if threading.current_thread() is bench.writer._thread and problems:
            raise problems.pop()
        real_sleep(seconds)

    one, two = aggregates[:2]
    monkeypatch.setattr("rehab.sessions.live.session.group_commit.time.sleep", sleep)
    bench.writer._next_commit_s = time.monotonic() + 1000
    bench.walk(one)
    await until_done(bench, 4)
    assert [type(problem) for _, problem in bench.done[3:]] == [OSError]
    bench.writer._next_commit_s = 0.0
    bench.walk(two)
    await until_done(bench, 5)
    assert bench.done[4] == (two.session.pk, None)


async def test_a_commit_is_traced_with_how_much_it_stored(bench, aggregates, monkeypatch):
    await until_done(bench, 3)
    kept, provider = InMemorySpanExporter(), TracerProvider()
    provider.add_span_processor(SimpleSpanProcessor(kept))
    monkeypatch.setattr(prometheus_metrics, "TRACER", provider.get_tracer("test"))
    bench.walk(aggregates[0])
    await until_done(bench, 4)
    fail_on(monkeypatch, aggregates[0].session.pk, DatabaseError("Failing row contains (Rosa)"))
    bench.walk(aggregates[0])
    await until_done(bench, 5)
    stored, *failed = kept.get_finished_spans()
    assert (stored.name, stored.attributes) == ("commit", {"garry.sessions": 1, "garry.rows": 1})
    assert failed
    assert not any("Rosa" in span.to_json() for span in failed)


async def test_one_report_that_fails_keeps_no_other_from_its_source(bench, aggregates, caplog):
    await until_done(bench, 3)

    def fail(_: Exception | None) -> None:
        raise RuntimeError("a bug of one session")

    session = aggregates[0].session
    bench.stall.begin()
    bench.writer.submit(Job(aggregates[0], session.pk, 0, [], None, fail))
    bench.walk(aggregates[1])
    bench.stall.end()
    await until_done(bench, 4)
    assert bench.done[-1] == (aggregates[1].session.pk, None)
    assert f"Session {session.pk} could not be notified" in caplog.text


async def test_an_owner_that_failed_is_not_kept_for_ever(bench, aggregates, monkeypatch):
    monkeypatch.setattr(writers.log, "exception", lambda *_: None)  # caplog keeps tracebacks
    await until_done(bench, 3)
    with monkeypatch.context() as patch:
        fail_on(patch, aggregates[0].session.pk, DatabaseError("disk"))
        bench.walk(aggregates[0])
        await until_done(bench, 4)
    assert len(bench.writer._failed) == 1
    del aggregates[0]
    bench.done[-1] = (0, None)  # its traceback knows the owner, too
    bench.walk(aggregates[0])  # another one: the thread holds the last batch until the next
    await until_done(bench, 5)
    gc.collect()
    assert len(bench.writer._failed) == 0


async def test_a_clinic_that_was_taken_over_is_fenced(bench, aggregates, elsewhere, ready):
    lost, kept = SessionAggregate(await ready(elsewhere)), aggregates[1]
    await ClinicOwner.everywhere.acreate(pk=elsewhere.clinic.pk)
    bench.submit(lost, lost.change(Change(ChangeKind.START), None, NOW))
    await until_done(bench, 4)
    bench.done.clear()
    await ClinicOwner.everywhere.filter(pk=lost.session.clinic_id).aupdate(epoch=7)
    bench.stall.begin()
    for aggregate in (lost, kept, lost):
        bench.walk(aggregate)
    bench.stall.end()
    await until_done(bench, 3)
    assert [(pk, type(problem)) for pk, problem in bench.done] in (
        [
            (lost.session.pk, Fenced),
            (kept.session.pk, type(None)),
            (lost.session.pk, EarlierWriteFailed),
        ],
        [
            (lost.session.pk, Fenced),
            (kept.session.pk, type(None)),
            (lost.session.pk, Fenced),
        ],
    )
    assert await Step.everywhere.filter(session=kept.session).acount() == 1
    assert await Step.everywhere.filter(session=lost.session).acount() == 0


async def test_commits_keep_a_distance_only_while_several_sessions_walk(
    bench, aggregates, monkeypatch
):
    await until_done(bench, 3)  # the sessions' starts
    for count in range(4, 6):
        bench.walk(aggregates[0])
        await until_done(bench, count)
    waited: list[float] = []
    monkeypatch.setattr("rehab.sessions.live.session.group_commit.time.sleep", waited.append)
    monkeypatch.setattr(writers, "SPACING_S", 1000.0)
    for count in range(6, 8):  # one session's, one after the other
        bench.walk(aggregates[0])
        await until_done(bench, count)
    assert waited == []
    for count, aggregate in enumerate(aggregates[1:] * 2, 8):  # by turns
        bench.walk(aggregate)
        await until_done(bench, count)
    assert len(waited) == 3  # after the first commit of another session
    assert all(0 < seconds <= 1000 for seconds in waited)


async def test_close_commits_everything_that_is_queued(bench, aggregates):
    for _ in range(200):
        bench.walk(aggregates[0])
    bench.writer.close()
    assert await Step.everywhere.acount() == 200
    assert len(bench.done) == 203
    assert not bench.writer._thread.is_alive()
    bench.writer.close()
