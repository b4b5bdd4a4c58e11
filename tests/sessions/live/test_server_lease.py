"""Leases of hosted servers: judged by the database's clock, renewed; whose a clinic is."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Iterator
from typing import Any

import pytest
from django.db import connection
from django.test.utils import CaptureQueriesContext

from rehab.people.models import Clinic
from rehab.sessions.live.database import clinic_owners, server_lease
from rehab.sessions.live.database.server_lease import Lease, Server
from tests.support.world import set_owner

pytestmark = [pytest.mark.django_db(transaction=True), pytest.mark.postgres]


@pytest.fixture(autouse=True)
def quick(monkeypatch: pytest.MonkeyPatch, settings: Any) -> Iterator[None]:
    if connection.vendor != "postgresql":
        pytest.skip("only hosted servers have leases")
    settings.HOSTED = True
    monkeypatch.setattr(server_lease, "RENEW_S", 0.05)
    monkeypatch.setattr(server_lease, "LEASE_S", 0.6)
    sql("DELETE FROM rehab_server")
    yield
    sql("DELETE FROM rehab_server")


def sql(statement: str, *values: Any) -> list[Any]:
    with connection.cursor() as cursor:
        cursor.execute(statement, values)
        return cursor.fetchall() if cursor.description else []


def valid_ids() -> set[str]:
    return {server.id for server in server_lease.valid_servers()}


def enter(port: int = 1, *, is_ready: bool = False) -> Lease:
    one = Lease(f"127.0.0.1:{port}")
    one.is_ready = is_ready
    one.acquire()
    return one


def test_a_server_knows_the_others_as_long_as_they_are_there():
    one, two = enter(1), enter(2)
    assert valid_ids() == {one.id, two.id}
    assert {server.id for server in two.servers} == {one.id, two.id}
    one.release()
    assert valid_ids() == {two.id}
    two.release()
    assert server_lease.held() is None


def test_a_server_that_enters_forgets_those_that_ended_long_ago():
    for name, ended in (("of today", "1 minute"), ("of yesterday", "1 day")):
        sql(
            "INSERT INTO rehab_server (id, address, ready, expires_at) "
            "VALUES (%s, '', true, clock_timestamp() - %s::interval)",
            *(name, ended),
        )
    one = enter()
    assert {name for (name,) in sql("SELECT id FROM rehab_server")} == {one.id, "of today"}
    one.release()


def test_others_learn_of_a_server_that_takes_clinics():
    one = enter()
    assert [server.ready for server in server_lease.valid_servers()] == [False]
    one.is_ready = True
    time.sleep(0.2)
    assert [server.ready for server in server_lease.valid_servers()] == [True]
    one.release()


def make_servers(count: int) -> list[Server]:
    return [Server(str(number), f"10.0.0.{number}:8000", True) for number in range(count)]


def test_clinics_are_spread_and_few_move_where_a_server_comes():
    before, after = make_servers(4), make_servers(5)
    places = [
        (server_lease.find_place(key, before), server_lease.find_place(key, after))
        for key in range(1000)
    ]
    assert max(Counter(first for first, _ in places).values()) < 350
    moved = [second for first, second in places if first != second]
    assert set(moved) == {after[4]}
    assert 120 < len(moved) < 280
    assert server_lease.find_place(1, [one._replace(ready=False) for one in before]) is None


def test_a_clinic_that_nobody_has_is_claimed_by_the_server_that_it_belongs_to(
    two_servers, monkeypatch
):
    other, _ = two_servers
    clinics = [Clinic.everywhere.create(name=f"clinic {number}").pk for number in range(40)]
    sql("UPDATE rehab_server SET ready = true, expires_at = clock_timestamp() + interval '9 s'")
    servers = server_lease.valid_servers()
    theirs = [key for key in clinics if server_lease.find_place(key, servers).id == other.id]
    mine = [key for key in clinics if key not in theirs]
    assert theirs
    assert mine
    assert clinic_owners.claim(mine[0]).epoch == 1
    with pytest.raises(clinic_owners.OwnedElsewhere) as problem:
        clinic_owners.claim(theirs[0])
    assert problem.value.server == other.address
    sql("UPDATE rehab_clinicowner SET owner = %s WHERE clinic_id = %s", other.id, mine[0])
    with pytest.raises(clinic_owners.OwnedElsewhere) as problem:
        clinic_owners.claim(mine[0])
    assert problem.value.server == other.address
    with monkeypatch.context() as in_a_command:
        in_a_command.setattr(server_lease, "_held", None)
        with pytest.raises(clinic_owners.OwnedElsewhere):
            clinic_owners.claim(mine[0])
    sql("DELETE FROM rehab_server WHERE id = %s", other.id)
    assert clinic_owners.claim(mine[0]) == (mine[0], 2, [], True)
    assert clinic_owners.claim(theirs[0]) == (theirs[0], 1, [], False)


def test_a_lease_is_renewed_and_outlives_its_connection():
    one = enter()
    time.sleep(0.8)
    assert valid_ids() == {one.id}
    assert one._connection is not None
    pid = one._connection.connection.info.backend_pid
    sql("SELECT pg_terminate_backend(%s, 5000)", pid)
    time.sleep(0.4)
    assert valid_ids() == {one.id}
    one.release()


def test_an_owner_lives_as_long_as_its_lease_whatever_its_host_is_called():
    other, own = enter(), enter()
    time.sleep(0.2)  # from then on it judges
    assert own.may_judge
    assert clinic_owners.is_alive(other.id)
    other._closing.set()  # it hangs
    other._thread.join()
    assert clinic_owners.is_alive(other.id)
    time.sleep(0.7)
    assert not clinic_owners.is_alive(other.id)
    other.release()
    own.release()


def test_what_a_beat_costs_does_not_depend_on_how_many_servers_there_are(two_servers):
    live, own = two_servers
    dead = [f"{number:032}" for number in range(20)]
    gone = "a server that has no lease any more"
    owned_by = {}
    for owner in (live.id, own.id, "", clinic_owners.HANDED_ON, gone, *dead):
        owned_by[owner] = Clinic.everywhere.create(name=f"of {owner}").pk
        set_owner(owned_by[owner], owner)
    sql("UPDATE rehab_server SET expires_at = clock_timestamp() + interval '9 s'")
    for owner in dead:
        sql("INSERT INTO rehab_server VALUES (%s, '', true, now() - interval '1 s')", owner)
    with CaptureQueriesContext(connection) as asked:
        found = clinic_owners.find_ownerless(thorough=False)
    left = [owned_by[owner] for owner in dead]
    assert found == (left, [owned_by[clinic_owners.HANDED_ON]])
    assert len(asked) == 1
    assert clinic_owners.find_ownerless() == (
        [owned_by[gone], *left],
        [owned_by[clinic_owners.HANDED_ON]],
    )


def test_after_an_outage_of_the_database_nobody_is_taken_for_dead_at_once(monkeypatch):
    own = enter()
    monkeypatch.setattr(server_lease, "RENEW_S", 5.0)
    own._unbroken_since_s = time.monotonic()  # it has just come back
    judged_before = own.may_judge
    monkeypatch.setattr(server_lease, "_held", own)
    assert clinic_owners.is_alive("f" * 32)
    own._unbroken_since_s -= 2 * server_lease.RENEW_S  # the others have had time to come back
    own._renewed_s = time.monotonic()
    assert (judged_before, own.may_judge) == (False, True)
    own.release()


@pytest.fixture
def two_servers(monkeypatch: pytest.MonkeyPatch) -> Iterator[tuple[Lease, Lease]]:
    """Two servers, the second of them ours and judging; none renews its lease in the meantime."""
    other, own = enter(1), enter(2)
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
    assert clinic_owners.is_alive(other.id)  # own lease has expired with it


def test_a_dead_server_does_not_live_on_when_the_databases_clock_is_set_back(two_servers):
    other, own = two_servers
    sql("UPDATE rehab_server SET expires_at = expires_at + interval '1 hour'")
    assert clinic_owners.is_alive(other.id)  # until own lease is renewed by the new time
    assert own._execute(server_lease.RENEW) == 0
    own._enter()
    own._unbroken_since_s -= 1
    assert not clinic_owners.is_alive(other.id)
    assert valid_ids() == {own.id}


def test_the_lease_of_a_server_whose_event_loop_hangs_expires(monkeypatch):
    """Though its thread goes on: others take the clinics over."""
    monkeypatch.setattr(server_lease, "PULSE_MAX_S", 0.2)
    one = enter()
    one.show_pulse()
    time.sleep(1.0)
    assert (valid_ids(), one.is_current) == (set(), False)
    one.show_pulse()
    time.sleep(0.2)
    assert (valid_ids(), one.is_current, one.entered) == ({one.id}, True, 2)
    one.release()
