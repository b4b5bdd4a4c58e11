"""Who watches a session or orders its robot stands in the audit log; no step waits for that."""

from __future__ import annotations

import asyncio
import threading
from typing import Any

import pytest
from asgiref.sync import sync_to_async
from django.db import DatabaseError, InterfaceError, OperationalError

from rehab.people.audit import audit_log
from rehab.people.audit.audit_log import SIGN_IN_ACTS, Act, AuditEntry, Recent
from rehab.sessions.live import audit_queue as notes_module
from rehab.sessions.live import runtime as runtimes
from tests.support.callers import turns

pytestmark = pytest.mark.django_db(transaction=True)

STOP = {"type": "robot", "order": "stop"}
ARM = {"type": "robot", "order": "arm"}


@pytest.fixture(autouse=True)
def nothing_noted_yet(monkeypatch):
    monkeypatch.setattr(audit_log, "recent_views", Recent())
    monkeypatch.setattr(audit_log, "recent_entries", Recent())


async def noted(count: int) -> list[tuple[Any, ...]]:
    """Return the entries once there are so many; the digest of each is that of its values."""
    names = ("act", "by", "through", "patient", "about")
    entries = AuditEntry.everywhere.exclude(act__in=SIGN_IN_ACTS).order_by("pk")
    for _ in range(500):
        rows = await sync_to_async(lambda: list(entries.all().values_list(*names)))()
        if len(rows) >= count:
            assert all([entry.is_genuine() async for entry in entries])
            return rows
        await turns()
    raise AssertionError(f"{len(rows)} entries instead of {count}: {rows}")


async def test_a_page_that_watches_is_noted_when_it_connects(place, begun):
    session = await begun(place)
    for page in (place.monitor(session), place.tablet(session)):
        await page.open()
    by_person, by_tablet = sorted(await noted(2), key=lambda row: row[1] is None)
    about = f"/ws/session/{session.pk}/"
    assert by_person == (Act.VIEW, place.pt.pk, "", session.patient_id, f"{about}monitor/")
    assert by_tablet[:2] == (Act.VIEW, None)
    assert "Tablet" in by_tablet[2]
    assert by_tablet[3:] == (session.patient_id, f"{about}patient/")


async def test_a_page_that_connects_again_is_not_noted_again(place, begun):
    session = await begun(place)
    for _ in range(3):
        monitor = await place.monitor(session).open()
        await monitor.hang_up()
    await monitor.overhear()
    assert len(await noted(1)) == 1


async def test_who_stops_and_arms_the_robot_is_noted_each_time(place, begun):
    session = await begun(place)
    monitor = await place.monitor(session).open()
    for order in (STOP, ARM, STOP):
        await monitor.say(order)
    acts = [row[0] for row in (await noted(4))]
    assert acts == [Act.VIEW, Act.ROBOT_STOP, Act.ROBOT_ARM, Act.ROBOT_STOP]


async def test_a_tablets_stops_in_some_minutes_are_one_entry_with_their_number(place, begun):
    session = await begun(place)
    tablet = await place.tablet(session).open()
    for _ in range(3):
        for _ in range(20):
            await tablet.say(STOP)
        await tablet.overhear()
        await runtimes.current().audit_queue.join()
    await noted(2)
    stops = AuditEntry.everywhere.filter(act=Act.ROBOT_STOP)
    assert await sync_to_async(lambda: [stop.count for stop in stops])() == [60]


async def test_an_order_is_noted_though_its_page_is_gone_at_once(place, begun):
    session = await begun(place)
    tablet = await place.tablet(session).open()
    await tablet.say(STOP)
    await tablet.hang_up()
    assert (await noted(2))[-1][0] == Act.ROBOT_STOP


async def test_a_log_that_cannot_be_written_stops_no_step_and_no_robot(place, begun, monkeypatch):
    def fail(*args, **kwargs):
        raise DatabaseError("the disk is full")

    monkeypatch.setattr(AuditEntry.everywhere, "bulk_create", fail)
    monkeypatch.setattr(audit_log.log, "exception", lambda *args: None)
    session = await begun(place)
    robot, monitor, source = (
        await place.robot().open(),
        await place.monitor(session).open(),
        await place.source().open(),
    )
    await source.walk(4.0)
    await monitor.say(STOP)
    assert await robot.hear("stop") == {"type": "stop"}


@pytest.mark.parametrize("problem", [OperationalError, InterfaceError])
async def test_entries_wait_while_the_database_is_away(place, begun, monkeypatch, problem):
    away, store = threading.Event(), notes_module._store
    tries = []

    def try_to_store(entries):
        tries.append(len(entries))
        if not away.is_set():
            raise problem("the server is gone")
        store(entries)

    monkeypatch.setattr(notes_module, "RETRY_S", 0.001)
    monkeypatch.setattr(notes_module, "_store", try_to_store)
    session = await begun(place)
    monitor = await place.monitor(session).open()
    while len(tries) < 2:  # noqa: ASYNC110
        await asyncio.sleep(0.001)
    await monitor.say(STOP)
    while tries[-1] < 2:  # noqa: ASYNC110
        await asyncio.sleep(0.001)
    away.set()
    assert [row[0] for row in await noted(2)] == [Act.VIEW, Act.ROBOT_STOP]


@pytest.mark.parametrize("problem", [DatabaseError, OperationalError])
async def test_after_a_log_that_could_not_be_written_it_goes_on(place, begun, monkeypatch, problem):
    """Nor does a server that ends wait for a database that is away."""

    def fail(entries):
        raise problem("the server is gone")

    missed = []
    monkeypatch.setattr(notes_module, "RETRY_S", 0.001)
    monkeypatch.setattr(notes_module.log, "exception", lambda *told: missed.append(told))
    session = await begun(place)
    with monkeypatch.context() as broken:
        broken.setattr(notes_module, "_store", fail)
        await place.monitor(session).watch()
        await runtimes.current().audit_queue.join()
    assert len(missed) == 1
    tablet = await place.tablet(session).open()
    await tablet.say(STOP)
    assert [row[0] for row in await noted(2)] == [Act.VIEW, Act.ROBOT_STOP]
