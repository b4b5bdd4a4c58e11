"""One server a hosted database: the next waits, and takes over from one that is gone or hangs."""

from __future__ import annotations

import threading
from collections.abc import Iterator

import pytest
from django.db import connection

from rehab.sessions.live import owners, server_lock
from rehab.sessions.live.server_lock import AnotherServer, ServerLock

pytestmark = [pytest.mark.django_db(transaction=True), pytest.mark.postgres]


@pytest.fixture(autouse=True)
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    if connection.vendor != "postgresql":
        pytest.skip("only a hosted server has a lock")
    monkeypatch.setattr(server_lock, "RENEW_S", 0.05)
    monkeypatch.setattr(server_lock, "RETRY_S", 0.02)


@pytest.fixture
def lost() -> threading.Event:
    return threading.Event()


@pytest.fixture
def first(lost: threading.Event) -> Iterator[ServerLock]:
    lock = ServerLock(lost.set)
    lock.acquire()
    yield lock
    lock.release()


def test_a_second_server_is_refused_with_the_cure(first: ServerLock) -> None:
    with pytest.raises(AnotherServer, match="stop the other one"):
        ServerLock(lambda: None).acquire(wait_s=0.2)


def test_a_second_server_starts_once_the_first_has_ended(first: ServerLock) -> None:
    threading.Timer(0.2, first.release).start()
    second = ServerLock(lambda: None)
    second.acquire(wait_s=10)
    assert server_lock.is_held()
    second.release()


def test_a_lock_that_was_lost_is_taken_again_where_nobody_else_has_it(
    first: ServerLock, lost: threading.Event
) -> None:
    end_holder()
    deadline = threading.Event()
    while not holders():
        assert not deadline.wait(0.02)
    assert not lost.is_set()


def test_a_server_whose_lock_another_has_taken_ends(
    monkeypatch: pytest.MonkeyPatch, first: ServerLock, lost: threading.Event
) -> None:
    monkeypatch.setattr(first, "_ping", lambda connection: None)  # it hangs
    end_holder()
    second = ServerLock(lambda: None)
    second.acquire(wait_s=10)
    monkeypatch.undo()
    assert lost.wait(10)
    second.release()


def test_owners_on_other_machines_are_dead_to_the_only_server(settings, first: ServerLock) -> None:
    settings.HOSTED = True
    assert not owners.is_alive("another-host|7|1")
    first.release()
    assert owners.is_alive("another-host|7|1")


def holders() -> list[int]:
    with connection.cursor() as cursor:
        cursor.execute(
            "SELECT pid FROM pg_locks WHERE locktype = 'advisory' AND objid = %s "
            "AND database = (SELECT oid FROM pg_database WHERE datname = current_database())",
            [server_lock.KEY & 0xFFFFFFFF],
        )
        return [pid for (pid,) in cursor.fetchall()]


def end_holder() -> None:
    """End the lock's connection, as PostgreSQL does to one that says nothing for long."""
    (pid,) = holders()
    with connection.cursor() as cursor:
        cursor.execute("SELECT pg_terminate_backend(%s, 5000)", [pid])
