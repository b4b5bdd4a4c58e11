"""No simulated walk counts as a person's, wherever its source runs."""

from __future__ import annotations

import pytest

from rehab.training.changes import ChangeKind
from tests.support.callers import a_step, change, reread, rows_of


@pytest.mark.parametrize("says", ["hello", "sensor"])
async def test_a_simulated_source_marks_the_session_of_a_real_patient(place, begun, says):
    session = await begun(place)
    source = await place.source().open(simulated=says == "hello")
    if says == "sensor":
        await source.say({"type": "sensor", "trouble": "", "plays": "simulated"})
    assert not (await reread(session)).simulated
    await source.walk(4.0)
    assert (await reread(session)).simulated


async def test_a_person_s_session_takes_no_simulated_step(place, begun):
    session = await begun(place)
    person = await place.source().open()
    await person.walk(4.0)
    await person.hang_up()
    source = await place.source().open(simulated=True)
    await source.say(a_step(2))
    code, error = await source.sent_away()
    assert (code, error["code"]) == (4400, "simulated")
    assert "Begin another session" in error["message"]
    await change(session, ChangeKind.FINISH)
    assert not (await reread(session)).simulated
    assert await rows_of(session, "number") == [1]


async def test_a_simulated_session_remains_one(place, begun):
    session = await begun(place)
    source = await place.source().open(simulated=True)
    await source.walk(4.0)
    await source.hang_up()
    person = await place.source().open()
    await person.walk(4.0)
    await change(session, ChangeKind.FINISH)
    assert (await reread(session)).simulated
