"""A session comes back from its checkpoint and what came after, the same as from its whole log."""

from __future__ import annotations

import pytest
from asgiref.sync import sync_to_async

from rehab.sessions.live import runtime as runtimes
from rehab.sessions.live.session import aggregate as aggregates
from rehab.sessions.live.session.aggregate import SessionAggregate
from rehab.training.phases import make_phase
from tests.support.callers import change, reread, restart
from tests.support.evidence import change_steps

pytestmark = pytest.mark.postgres


@pytest.mark.parametrize(("steps", "kept"), [(9, None), (10, 10), (14, 10), (15, 15), (24, 20)])
async def test_checkpoints_are_stored_and_used(place, sourced, monkeypatch, steps, kept):
    monkeypatch.setattr(aggregates, "CHECKPOINT_STEPS", 10)
    session, source = await sourced(place, make_phase("training", strides=15), make_phase("catch"))
    for number in range(1, steps + 1):
        await source.walk((4.0, 2.0, None)[number % 3])
        if number in (10, 12):
            await change(session, "goal", 3.0 + number / 100)
    fold = (await runtimes.current().session(session.pk)).aggregate.fold
    stored = await reread(session)
    assert (stored.checkpoint or {}).get("last_number") == kept
    rebuilt = await sync_to_async(SessionAggregate.load)(stored)
    stored.checkpoint = None
    whole = await sync_to_async(SessionAggregate.load)(stored)
    assert vars(rebuilt.fold) == vars(whole.fold) == vars(fold)


async def test_what_a_checkpoint_has_is_not_read_again(place, sourced, monkeypatch):
    monkeypatch.setattr(aggregates, "CHECKPOINT_STEPS", 10)
    session, source = await sourced(place)
    await source.walk(*[4.0] * 12)
    await source.hang_up()
    await restart()
    await change_steps({"value": 1.0}, session=session, number__lte=10)
    again = await place.source().dial()
    assert (await again.hello())["next"] == 13
    await again.walk(4.0)
    assert (await runtimes.current().session(session.pk)).aggregate.fold.score == 13


async def test_an_ended_session_has_none(place, sourced, monkeypatch):
    monkeypatch.setattr(aggregates, "CHECKPOINT_STEPS", 2)
    session, source = await sourced(place)
    await source.walk(4.0, 4.0)
    assert (await reread(session)).checkpoint is not None
    await change(session, "finish")
    assert (await reread(session)).checkpoint is None
