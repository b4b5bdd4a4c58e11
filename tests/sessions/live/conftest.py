"""A runtime for each test, drained and looked over when the test has ended."""

from __future__ import annotations

import asyncio
import logging
import threading
from collections.abc import AsyncIterator, Awaitable, Callable, Iterator
from importlib import import_module
from typing import Any

import pytest
from asgiref.sync import sync_to_async
from django.db import connections

from rehab.sessions.live import runtime as runtimes
from rehab.sessions.live.session import commit_transaction
from rehab.sessions.live.session import group_commit as writers
from rehab.sessions.log import Step
from rehab.sessions.models import TrainingSession
from tests.support.callers import (
    Caller,
    Place,
    SourceCaller,
    build_place,
    change,
    open_session,
    remember,
)


class Stall:
    """Holds the writer's commits up, so that a test can look at what is not committed."""

    problem: Exception | None = None  # what they fail with, once they may happen

    def __init__(self) -> None:
        self._open = threading.Event()
        self._open.set()

    def begin(self) -> None:
        """Let no commit happen."""
        self._open.clear()

    def end(self) -> None:
        """Let them happen."""
        self._open.set()

    def wait(self) -> None:
        """Wait until commits may happen (in the writer's thread)."""
        assert self._open.wait(10)
        if self.problem is not None:
            raise self.problem


@pytest.fixture
async def live_path(
    transactional_db: None, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> AsyncIterator[None]:
    """Run what the test dials in to; nothing of it is left afterwards, nothing failed unseen."""
    import_module("garry_site.asgi")  # sets the log up: before caplog looks at this test's
    monkeypatch.setattr(runtimes, "_current", None)
    Caller.open_ones.clear()
    threads = set(threading.enumerate())
    tasks = asyncio.all_tasks()
    yield
    for caller in list(Caller.open_ones):
        await caller.hang_up()
    if (runtime := runtimes._current) is not None:
        await runtime.drain()
        runtimes._current = None
    await sync_to_async(connections.close_all)()
    connections.close_all()
    await asyncio.sleep(0)
    assert asyncio.all_tasks() - tasks == {asyncio.current_task()}
    writing = [t for t in set(threading.enumerate()) - threads if t.name == "garry-writer"]
    assert not writing
    failures = [r for r in caplog.get_records("call") if r.getMessage() == "A socket failed"]
    assert not failures, failures[0].exc_info


@pytest.fixture
def stall(monkeypatch: pytest.MonkeyPatch) -> Iterator[Stall]:
    """Return the hand on the writer."""
    hold, commit = Stall(), commit_transaction.commit

    def commit_when_open(jobs: Any) -> None:
        hold.wait()
        commit(jobs)

    monkeypatch.setattr(writers, "commit", commit_when_open)
    yield hold
    hold.end()


def _build_elm() -> Place:
    return build_place("elm", spares=1)


@pytest.fixture
async def place(live_path: None, keep: Callable[..., Callable[[], Place]]) -> Place:
    """Return a station in a clinic."""
    place = await sync_to_async(keep(_build_elm))()
    remember(place)
    return place


@pytest.fixture
async def elsewhere(place: Place) -> Place:
    """Return a station in another clinic."""
    return await sync_to_async(build_place)("oak")


OpenSession = Callable[..., Awaitable[TrainingSession]]


@pytest.fixture
def ready(live_path: None) -> OpenSession:
    """Return a function that makes a session that is ready."""
    return sync_to_async(open_session)


@pytest.fixture
def begun(ready: OpenSession) -> OpenSession:
    """Return a function that makes a session that runs."""

    async def begin(*args: Any, **options: Any) -> TrainingSession:
        session = await ready(*args, **options)
        await change(session, "start")
        return session

    return begin


@pytest.fixture
def sourced(begun: OpenSession) -> Callable[..., Awaitable[tuple[TrainingSession, SourceCaller]]]:
    """Return a function that makes a session that runs, and connects its source."""

    async def begin(
        place: Place, *args: Any, **options: Any
    ) -> tuple[TrainingSession, SourceCaller]:
        session = await begun(place, *args, **options)
        return session, await place.source().open()

    return begin


@pytest.fixture(autouse=True)
def quiet(caplog: pytest.LogCaptureFixture) -> None:
    """Keep the log for a look at it."""
    caplog.set_level(logging.INFO)


@pytest.fixture
async def bystander(place, elsewhere, begun):
    """Another session that goes on whatever happens in this test."""
    session = await begun(elsewhere)
    source = await elsewhere.source().open()
    tablet = await elsewhere.tablet(session).open()
    await source.walk(4.0)
    yield session
    await source.walk(4.0, 2.0)
    await tablet.until_step(3)
    assert tablet.last("step")["score"] == 1
    assert await Step.everywhere.filter(session=session).acount() == 3
