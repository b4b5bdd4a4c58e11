"""No log ever has a hole: a database that lost steps is found out before the next one is stored."""

from __future__ import annotations

import pytest
from asgiref.sync import sync_to_async

from rehab.sessions.live import runtime as runtimes
from rehab.sessions.live.database.clinic_owners import note_ends
from rehab.sessions.log_fold import fold_log
from rehab.sessions.models import TrainingSession
from rehab.training.fold import SessionFold
from tests.support.callers import a_step, change, numbers, restart
from tests.support.evidence import lose_steps

pytestmark = pytest.mark.postgres


async def set_back(session: TrainingSession, after: int) -> None:
    """Set the database back, as a failover to a copy that lagged does."""
    await lose_steps(session=session, number__gt=after)
    await TrainingSession.everywhere.filter(pk=session.pk).aupdate(last_number=after)


async def test_a_lagging_failover_tears_no_hole_into_the_log(place, sourced, bystander, caplog):
    session, source = await sourced(place)
    await source.walk(*[4.0] * 5)
    await set_back(session, after=3)
    await source.say(a_step(6))
    code, error = await source.sent_away()
    assert (code, error["code"]) == (4011, "not_stored")
    assert await numbers(session) == [1, 2, 3]
    assert f"the log of session {session.pk} ends with step 3, before step 6" in caplog.text
    again = await place.source().dial()
    assert (await again.hello(last=5))["next"] == 4  # a client of ours says which steps are lost
    await again.walk(4.0, 4.0)
    assert await numbers(session) == [1, 2, 3, 4, 5]


async def test_a_step_that_is_gone_alone_is_missed_at_the_next_commit(place, sourced, caplog):
    session, source = await sourced(place)
    await source.walk(*[4.0] * 5)
    await lose_steps(session=session, number=5)
    await source.say(a_step(6))
    assert (await source.sent_away())[1]["code"] == "not_stored"
    assert await numbers(session) == [1, 2, 3, 4]
    assert f"the log of session {session.pk} ends with step 4, before step 6" in caplog.text


async def test_nothing_is_folded_over_a_hole(place, sourced, caplog):
    session, source = await sourced(place)
    await source.walk(*[4.0] * 5)
    await source.hang_up()
    await restart()
    await lose_steps(session=session, number=3)
    reread = await TrainingSession.everywhere.aget(pk=session.pk)
    fold = await sync_to_async(fold_log)(SessionFold(session.to_plan()), reread)
    assert (fold.last_number, fold.score) == (2, 2)
    assert f"The log of session {session.pk} has a hole" in caplog.text
    source = await place.source().dial()
    await source.say({"type": "hello", "version": 1, "run": "r1", "last": 5})
    code, error = await source.sent_away()
    assert (code, error["code"]) == (4004, "damaged_log")
    assert "Restore a backup" in error["message"]
    assert session.pk not in runtimes.current().sessions


async def test_a_log_that_lost_its_end_is_not_continued(place, sourced):
    session, source = await sourced(place)
    await source.walk(*[4.0] * 5)
    await source.hang_up()
    await restart()
    await lose_steps(session=session, number=5)
    tablet = await place.tablet(session).dial()
    assert (await tablet.sent_away())[1]["code"] == "damaged_log"


async def test_a_logs_end_is_noted_with_changes_and_at_a_stop_and_never_lowered(place, sourced):
    async def noted() -> int:
        return (await TrainingSession.everywhere.aget(pk=session.pk)).last_number

    session, source = await sourced(place)
    await source.walk(4.0, 4.0)
    await change(session, "pause")
    assert await noted() == 2
    await change(session, "resume")
    await source.walk(4.0)
    await restart()
    assert await noted() == 3
    await lose_steps(session=session, number=3)
    await sync_to_async(note_ends)([session.pk])
    assert await noted() == 3
