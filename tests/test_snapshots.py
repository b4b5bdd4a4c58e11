"""A test database is brought back by its pages, or it is said why it cannot be."""

import sqlite3

import pytest
from django.db import connection

from rehab.people.models import Clinic
from tests.support import snapshots
from tests.support.snapshots import Snapshot

pytestmark = [
    pytest.mark.django_db(transaction=True),
    pytest.mark.skipif(connection.vendor != "sqlite", reason="of SQLite"),
]


@pytest.fixture
def snapshot():
    taken = Snapshot()
    yield taken
    taken.close()


@pytest.fixture
def other():
    """Another connection, as a thread has one."""
    opened = sqlite3.connect(connection.settings_dict["NAME"], isolation_level=None)
    yield opened
    opened.close()


def test_rows_are_gone_and_keys_given_again(snapshot, other):
    first = Clinic.everywhere.create(name="one").pk
    other.execute("BEGIN")
    assert other.execute("SELECT count(*) FROM rehab_clinic").fetchone() == (1,)  # and reads on
    snapshot.restore()
    assert not Clinic.everywhere.exists()
    assert Clinic.everywhere.create(name="two").pk == first


def test_a_thread_that_goes_on_writing_is_told_of(snapshot, other, monkeypatch):
    monkeypatch.setattr(snapshots, "PATIENCE_S", 0.1)
    [(usual_ms,)] = connection.connection.execute("PRAGMA busy_timeout").fetchall()
    connection.connection.execute("PRAGMA busy_timeout = 10")
    other.execute("BEGIN IMMEDIATE")
    with pytest.raises(TimeoutError, match="still writing"):
        snapshot.restore()
    connection.connection.execute(f"PRAGMA busy_timeout = {usual_ms}")
