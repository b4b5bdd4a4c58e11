"""A session that has ended is on boards at once, and no step waits for a board."""

from __future__ import annotations

import asyncio
import threading

import pytest
from asgiref.sync import sync_to_async
from django.db import connection, transaction

from rehab.boards.models import Leaderboard
from rehab.people.consent.models import Purpose
from rehab.people.consent.services import record_consent
from rehab.people.models import Clinic, Patient
from rehab.sessions.models import TrainingSession
from rehab.training.changes import ChangeKind
from tests.support.boards import board_of, figures_of
from tests.support.callers import change
from tests.support.world import NOW

pytestmark = pytest.mark.postgres


async def test_a_session_that_ends_waits_for_nobody_and_is_on_the_board(place, sourced):
    board = await sync_to_async(board_of)(place.clinic, types="all", metric="steps")
    place.patient.boards = "clinic"
    await place.patient.asave()
    await sync_to_async(record_consent)(place.patient, Purpose.BOARDS, None, NOW, "clinic")
    assert await sync_to_async(figures_of)(board) == {}
    session, source = await sourced(place)
    await source.walk(4.0, 4.0)
    locked, release = threading.Event(), threading.Event()

    def lock() -> None:
        with transaction.atomic():
            for model in (Leaderboard, Clinic, Patient):
                list(model.everywhere.select_for_update())
            locked.set()
            release.wait(10)
        connection.close()

    somebody = threading.Thread(target=lock)
    if connection.vendor == "postgresql":  # SQLite locks no rows
        somebody.start()
        assert await asyncio.to_thread(locked.wait, 5)
    try:
        async with asyncio.timeout(4):
            await change(session, ChangeKind.FINISH)
        assert await sync_to_async(figures_of)(board) == {place.patient.pk: 2}
    finally:
        release.set()
        if somebody.ident is not None:
            await asyncio.to_thread(somebody.join)


async def test_trouble_with_boards_loses_no_step(place, sourced, monkeypatch, caplog):
    def fail(*_: object) -> None:
        raise ValueError("no board today")

    monkeypatch.setattr("rehab.boards.signals.record_changes", fail)
    session, source = await sourced(place)
    await source.walk(4.0, 4.0)
    await change(session, ChangeKind.FINISH)
    ended = await TrainingSession.everywhere.aget(pk=session.pk)
    assert (ended.state, ended.last_number) == ("finished", 2)
    assert await ended.metrics.filter(slug="steps", value=2).aexists()
    assert "no board today" in caplog.text
