"""Boards follow a session that has ended after its commit: no step of anybody waits for them."""

from __future__ import annotations

import asyncio
import threading
from typing import Any

import pytest
from asgiref.sync import sync_to_async
from django.utils import timezone

from rehab.boards.building import entries, scheduler
from rehab.boards.rows import BoardEntry
from rehab.people.consent.models import Purpose
from rehab.people.consent.services import record_consent
from rehab.sessions.models import TrainingSession
from rehab.training.changes import ChangeKind
from tests.support.boards import board_of
from tests.support.callers import change
from tests.support.world import NOW

pytestmark = pytest.mark.postgres


async def test_a_locked_board_holds_up_nobodys_step(place, elsewhere, begun, monkeypatch):
    await sync_to_async(board_of)(place.clinic, types="all", metric="steps")
    place.patient.boards = "clinic"
    await place.patient.asave()
    await sync_to_async(record_consent)(place.patient, Purpose.BOARDS, None, NOW, "clinic")
    free, lock = threading.Event(), entries._lock

    def lock_when_free(board_id: int) -> Any:
        assert free.wait(5), "somebody waited for the board"
        return lock(board_id)

    monkeypatch.setattr(entries, "_lock", lock_when_free)
    ending = await begun(place)
    await begun(elsewhere)
    mine, theirs = await place.source().dial(), await elsewhere.source().dial()
    await mine.hello()
    await theirs.hello()
    await mine.walk(4.0, 4.0)
    async with asyncio.timeout(4):
        await change(ending, ChangeKind.FINISH)
        await theirs.walk(4.0)
    assert not await BoardEntry.everywhere.aexists()
    free.set()
    woken = await TrainingSession.everywhere.filter(boards_due=True).aget()
    assert woken == ending
    assert not await sync_to_async(scheduler.follow_sessions)(5, timezone.now())
    assert await BoardEntry.everywhere.filter(patient=place.patient).acount() == 1
    assert not await TrainingSession.everywhere.filter(boards_due=True).aexists()


async def test_the_boards_thread_is_woken_once_the_figures_are_committed(place, begun, monkeypatch):
    seen: list[int] = []

    def wake() -> None:
        seen.append(TrainingSession.everywhere.filter(boards_due=True).count())

    monkeypatch.setattr(scheduler.board_builder, "wake", wake)
    session = await begun(place)
    await change(session, ChangeKind.FINISH)
    assert seen == [1]
    work = await sync_to_async(scheduler.find_work)(NOW)
    assert work is scheduler.follow_sessions
