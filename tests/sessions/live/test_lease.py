"""Leases of hosted servers: judged by the database's clock, renewed, excluded, taken over."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from typing import Any

import pytest
from django.db import connection
from django.test.utils import CaptureQueriesContext

from rehab.sessions.live.database import lease, owners
from rehab.sessions.live.database.lease import AnotherServer, Lease
from rehab.sessions.models import TrainingSession
from tests.support.callers import build_place, open_session

pytestmark = [pytest.mark.django_db(transaction=True), pytest.mark.postgres]


@pytest.fixture(autouse=True)
def quick(monkeypatch: pytest.MonkeyPatch, settings: Any) -> Iterator[None]:
    if connection.vendor != "postgresql":
        pytest.skip("only hosted servers have leases")
    settings.HOSTED = True
    monkeypatch.setattr(lease, "RENEW_S", 0.05)
    monkeypatch.setattr(lease, "RETRY_S", 0.02)
    monkeypatch.setattr(lease, "LEASE_S", 0.6)
    sql("DELETE FROM rehab_server")
    yield
    sql("DELETE FROM rehab_server")


def sql(statement: str, *values: Any) -> list[Any]:
    with connection.cursor() as cursor:
        cursor.execute(statement, values)
        return cursor.fetchall() if cursor.description else []


def valid_ids() -> set[str]:
    return {server.id for server in lease.valid_servers()}


def enter(*, shares: bool, lost: threading.Event | None = None) -> Lease:
    one = Lease("127.0.0.1:1", shares=shares, on_excluded=(lost or threading.Event()).set)
    one.acquire(wait_s=0.3)
    return one


@pytest.mark.parametrize(("first", "second"), [(False, False), (True, False), (False, True)])
def test_servers_that_cannot_hear_each_other_do_not_share_a_database(first, second):
    one = enter(shares=first)
    with pytest.raises(AnotherServer, match="GARRY_REDIS_URL"):
        enter(shares=second)
    threading.Timer(0.1, one.release).start()
    two = Lease("127.0.0.1:2", shares=second, on_excluded=lambda: None)
    two.acquire(wait_s=10)
    two.release()


def test_servers_with_redis_share_a_database():
    one, two = enter(shares=True), enter(shares=True)
    assert valid_ids() == {one.id, two.id}
    one.release()
    assert valid_ids() == {two.id}
    two.release()
    assert lease.held() is None


def test_a_lease_is_renewed_and_outlives_its_connection():
    one = enter(shares=True)
    time.sleep(0.8)
    assert valid_ids() == {one.id}
    assert one._connection is not None
    pid = one._connection.connection.info.backend_pid
    sql("SELECT pg_terminate_backend(%s, 5000)", pid)
    time.sleep(0.4)
    assert valid_ids() == {one.id}
    one.release()


def test_an_owner_lives_as_long_as_its_lease_whatever_its_host_is_called():
    other, own = enter(shares=True), enter(shares=True)
    time.sleep(0.2)  # from then on it judges
    assert own.may_judge
    assert owners.is_alive(other.id)
    other._closing.set()  # it hangs
    other._thread.join()
    assert owners.is_alive(other.id)
    time.sleep(0.7)
    assert not owners.is_alive(other.id)
    other.release()
    assert not owners.is_alive(owners.HANDED_ON)
    own.release()


def test_what_a_beat_costs_does_not_depend_on_how_many_servers_there_are(two_servers):
    live, _ = two_servers
    dead = [f"{number:032}" for number in range(20)]
    place = build_place("elm")
    owned_by = {owner: open_session(place, at_station=False).pk for owner in (live.id, *dead)}
    for owner, key in owned_by.items():
        row = TrainingSession.everywhere.filter(pk=key)
        row.update(owner=owner, state="running")
    del owned_by[live.id]
    sql("UPDATE rehab_server SET expires_at = clock_timestamp() + interval '9 s'")
    with CaptureQueriesContext(connection) as asked:
        assert owners.find_ownerless() == (sorted(owned_by.values()), [])
    assert len(asked) == 1


def test_after_an_outage_of_the_database_nobody_is_taken_for_dead_at_once(monkeypatch):
    own = enter(shares=True)
    monkeypatch.setattr(lease, "RENEW_S", 5.0)
    own._unbroken_since_s = time.monotonic()  # it has just come back
    assert not own.may_judge
    monkeypatch.setattr(lease, "_held", own)
    assert owners.is_alive("f" * 32)
    own.release()


@pytest.fixture
def two_servers(monkeypatch: pytest.MonkeyPatch) -> Iterator[tuple[Lease, Lease]]:
    """Two servers, the second of them ours and judging; none renews its lease in the meantime."""
    other, own = enter(shares=True), enter(shares=True)
    time.sleep(0.2)
    for one in (other, own):
        one._closing.set()
        one._thread.join()
    monkeypatch.setattr(own, "_renewed_s", time.monotonic() + 60)
    assert own.may_judge
    yield other, own
    own.release()
    other.release()


def test_nobody_is_taken_for_dead_when_the_databases_clock_jumps_ahead(two_servers):
    other, _ = two_servers
    sql("UPDATE rehab_server SET expires_at = expires_at - interval '1 hour'")
    assert owners.is_alive(other.id)  # own lease has expired with it


def test_a_dead_server_does_not_live_on_when_the_databases_clock_is_set_back(two_servers):
    other, own = two_servers
    sql("UPDATE rehab_server SET expires_at = expires_at + interval '1 hour'")
    assert owners.is_alive(other.id)  # until own lease is renewed by the new time
    assert own._execute(lease.RENEW) == 0
    assert own._enter()
    own._unbroken_since_s -= 1
    assert not owners.is_alive(other.id)
    assert valid_ids() == {own.id}


def test_a_server_without_redis_whose_database_another_has_taken_ends(monkeypatch):
    lost = threading.Event()
    one = enter(shares=False, lost=lost)
    monkeypatch.setattr(one, "_execute", lambda _: 0)  # it hangs: its row expires
    sql("UPDATE rehab_server SET expires_at = now() - interval '1 s', id = 'x'")
    sql("INSERT INTO rehab_server VALUES ('y', '127.0.0.1:2', false, now() + interval '9 s')")
    assert lost.wait(10)
    monkeypatch.undo()
    one.release()
