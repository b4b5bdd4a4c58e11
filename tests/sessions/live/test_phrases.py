"""What a patient reads varies, and follows from the session's plan and log alone."""

from __future__ import annotations

from rehab.sessions.models import TrainingSession
from rehab.training.phrases import APART
from tests.support.callers import restart


async def test_phrases_take_turns_and_a_restart_changes_none(place, sourced):
    session, source = await sourced(place, valence="positive", words_vary=True)
    tablet = await place.tablet(session).open()
    await source.walk(*[3.4] * 14)
    await tablet.until_step(14)
    said = [event["words"] for event in tablet.events if event["kind"] == "step"]
    assert len(said) == 14
    for start in range(14 - APART):
        assert len(set(said[start : start + APART])) == APART
    fresh = await place.tablet(session).watch()
    assert fresh["last"]["words"] == said[-1]
    plan = (
        await TrainingSession.everywhere.select_related("measure").aget(pk=session.pk)
    ).to_plan()
    band = plan.valence.band(3.4 / 3.0)
    assert said == [plan.choose_words(band, shown) for shown in range(14)]

    await restart()
    again = await place.tablet(session).watch()
    assert again["last"]["words"] == said[-1]


async def test_a_plan_may_fix_the_phrase_of_a_band(place, sourced):
    session, source = await sourced(place, valence="positive")
    tablet = await place.tablet(session).open()
    await source.walk(3.4, 3.4, 3.4)
    await tablet.until_step(3)
    said = {event["words"] for event in tablet.events if event["kind"] == "step"}
    assert said == {"Above goal!"}
