"""A database that is stuck or full is told in words, and stops neither the process nor its end."""

from __future__ import annotations

import asyncio
import faulthandler
import os
import re
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import SimpleNamespace

import pytest
from asgiref.sync import sync_to_async
from django.conf import settings
from django.db import (
    DatabaseError,
    OperationalError,
    connection,
    connections,
    transaction,
)
from django.test import Client

from rehab.sessions.live import periodic_tasks, process
from rehab.sessions.live import runtime as runtimes
from rehab.sessions.live.database import own_connection as own_connections
from rehab.sessions.live.database import server_lease
from rehab.sessions.live.database.own_connection import own_connection
from rehab.sessions.live.session import group_commit as writers
from rehab.sessions.live.session.commit_transaction import Job
from rehab.sessions.live.session.group_commit import LOCK_TIMEOUT_MS, STATEMENT_TIMEOUT_MS, Writer
from rehab.sessions.models import TrainingSession
from tests.support.callers import a_step, numbers, turns

pytestmark = pytest.mark.postgres
only_postgres = pytest.mark.skipif(
    "connection.vendor != 'postgresql'", reason="SQLite locks no single row"
)


async def health(path: str = "/healthz") -> tuple[int, str]:
    answer = await sync_to_async(Client().get)(path)
    return answer.status_code, answer.content.decode()


async def figures() -> str:
    answer = await sync_to_async(Client().get)("/metrics", headers={"Authorization": "a token"})
    return answer.content.decode()


async def test_a_writer_that_is_late_is_told_to_all(place, begun, stall, monkeypatch, caplog):
    monkeypatch.setattr(periodic_tasks, "ROBOT_HEARTBEAT_S", 0.01)
    session = await begun(place)
    monitor, robot = place.monitor(session), await place.robot().dial()
    assert (await monitor.watch())["presence"]["storage"] == ""
    assert (await robot.hello())["state"] == "running"
    source = await place.source().open()
    monkeypatch.setattr(writers, "LATE_COMMIT_S", 0.05)
    stall.begin()
    await source.say(a_step(1))
    await monitor.until(lambda e: e["kind"] == "presence" and e["presence"]["storage"] == "late")
    assert (await robot.hear("state"))["state"] == "paused"  # it stands still
    assert "database does not answer" in caplog.text
    status, words = await health()
    assert status == 503
    assert "database does not answer" in words
    monkeypatch.setattr(writers, "LATE_COMMIT_S", 1.0)
    stall.end()
    await source.acked(1)
    await monitor.until(lambda e: e["kind"] == "presence" and e["presence"]["storage"] == "")
    assert (await robot.hear("state"))["state"] == "running"
    assert await health() == (200, "ok\n")
    assert "Steps are stored again." in caplog.text


async def test_a_full_disk_is_said_in_words(place, sourced, stall, monkeypatch):
    monkeypatch.setattr(periodic_tasks, "ROBOT_HEARTBEAT_S", 0.01)
    session, source = await sourced(place)
    stall.problem = OperationalError("database or disk is full")
    await source.say(a_step(1))
    code, error = await source.sent_away()
    assert (code, error["code"]) == (4011, "not_stored")
    assert "disk of the database is full" in error["message"]
    assert "Make room" in (await health())[1]
    assert (await place.monitor(session).watch())["presence"]["storage"] == "disk_full"
    stall.problem = None
    again = await place.source().open()
    await again.walk(4.0)
    assert await health() == (200, "ok\n")


async def test_readiness_waits_for_the_sessions_of_the_last_run_and_ends_with_the_drain(
    place, monkeypatch
):
    assert (await health("/readyz"))[0] == 503
    runtime = runtimes.current()
    assert (await health("/readyz"))[0] == 503
    await runtime.recover()
    assert await health("/readyz") == (200, "ok\n")
    monkeypatch.setattr(settings, "METRICS_TOKEN", "a token")
    assert "garry_ready 1.0" in await figures()
    with monkeypatch.context() as cut_off:
        cut_off.setattr(runtime, "servers", SimpleNamespace(is_isolated=True))
        assert "cut off" in (await health("/readyz"))[1]
        assert "garry_ready 0.0" in await figures()
    with monkeypatch.context() as expired:
        expired.setattr(server_lease, "held", lambda: SimpleNamespace(is_current=False))
        assert "expired" in (await health("/readyz"))[1]
        assert "garry_ready 0.0" in await figures()
    await runtime.drain()
    assert (await health("/readyz"))[0] == 503


async def test_a_stride_counts_as_heard_when_it_is_stored(place, sourced, stall):
    session, source = await sourced(place)
    live = await runtimes.current().session(session.pk)
    stall.begin()
    await source.say(a_step(1))
    await turns()
    assert live.aggregate.fold.last_number == 1
    assert live.stride_at is None
    stall.end()
    await source.acked(1)
    assert live.stride_at is not None


async def test_a_database_that_never_answers_holds_up_no_end(stall, live_path, monkeypatch):
    monkeypatch.setattr(writers, "CLOSE_S", 0.05)
    writer = Writer(lambda function: function())
    stall.begin()
    writer.submit(Job(threading.Event(), 0, 0, [], None, lambda _: None))
    await asyncio.get_running_loop().run_in_executor(None, writer.close)
    assert writer._thread.is_alive()  # nobody waited for it
    assert writer._thread.daemon
    stall.end()
    writer._thread.join(5)


async def test_a_stop_that_takes_too_long_ends_the_process_and_says_where(monkeypatch, caplog):
    ended, event = asyncio.Event(), asyncio.Event()
    loop = asyncio.get_running_loop()
    monkeypatch.setattr(process, "STOP_S", 0.01)
    monkeypatch.setattr(faulthandler, "dump_traceback", lambda: None)
    monkeypatch.setattr(os, "_exit", lambda status: loop.call_soon_threadsafe(ended.set))

    async def wait_for_ever() -> None:
        await event.wait()

    stuck = asyncio.create_task(wait_for_ever())
    await asyncio.sleep(0)
    process.end_in_time()
    await asyncio.wait_for(ended.wait(), 5)
    assert re.search(r"1 task\(s\) waited in .*wait_for_ever \(\d+\) > Event.wait", caplog.text)
    stuck.cancel()


@contextmanager
def locked(session: TrainingSession) -> Iterator[None]:
    """Hold the lock of a session's row, as a page that hangs does."""
    has_it, done = threading.Event(), threading.Event()

    def hold() -> None:
        with transaction.atomic():
            TrainingSession.everywhere.select_for_update().get(pk=session.pk)
            has_it.set()
            assert done.wait(20)
        connection.close()

    holder = threading.Thread(target=hold)
    holder.start()
    assert has_it.wait(5)
    try:
        yield
    finally:
        done.set()
        holder.join()


@only_postgres
async def test_a_locked_session_holds_up_no_other_for_long(place, elsewhere, begun, monkeypatch):
    monkeypatch.setattr(writers, "LOCK_TIMEOUT_MS", 200)
    session = await begun(place)
    other = await begun(elsewhere)
    mine, theirs = await place.source().open(), await elsewhere.source().open()
    with locked(session):
        await mine.say(a_step(1))
        await theirs.say(a_step(1))
        await theirs.acked(1)
        assert (await mine.sent_away())[0] == 4011
    assert (await numbers(session), await numbers(other)) == ([], [1])


@only_postgres
def test_the_writers_connection_is_its_own_and_gives_up(transactional_db):
    own = own_connection(LOCK_TIMEOUT_MS, STATEMENT_TIMEOUT_MS)
    try:
        assert "pool" not in own.settings_dict["OPTIONS"]
        assert "pool" in connections["default"].settings_dict["OPTIONS"]
        with own.cursor() as cursor:
            cursor.execute("SHOW lock_timeout")
            assert cursor.fetchone() == ("3s",)
            cursor.execute("SHOW statement_timeout")
            assert cursor.fetchone() == ("10s",)
            cursor.execute("SELECT 1")
    finally:
        own.close()


@only_postgres
def test_locks_of_a_server_that_is_gone_are_released(transactional_db, monkeypatch):
    monkeypatch.setattr(own_connections, "IDLE_MS", 200)
    gone = own_connection(LOCK_TIMEOUT_MS, STATEMENT_TIMEOUT_MS)
    try:
        with gone.cursor() as cursor:
            cursor.execute("BEGIN")
            cursor.execute("LOCK TABLE rehab_trainingsession")
        assert TrainingSession.everywhere.update(source="another") == 0  # waits, at most 10 s
        with pytest.raises(DatabaseError, match="idle-in-transaction"), gone.cursor() as cursor:
            cursor.execute("COMMIT")
        with connection.cursor() as cursor:
            cursor.execute("SHOW tcp_user_timeout")
            assert cursor.fetchone() == ("10000",)  # ms
    finally:
        gone.close()
