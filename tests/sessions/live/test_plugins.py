"""Which parts of other packages made a session stands in its log, once each."""

from __future__ import annotations

import pytest
from asgiref.sync import sync_to_async

from rehab.sessions.log import PartEntry, SessionEvent
from rehab.sessions.reports.review import review_session
from rehab.training.measures import MEASURES
from robot.plugins import Plugin

WAGON = {"kind": "garry.bases", "name": "wagon", "package": "garry-wagon", "version": "1.0"}
METRONOME = WAGON | {"kind": "garry.sources", "name": "metronome", "package": "garry-metronome"}


@sync_to_async
def noted(session):
    rows = SessionEvent.everywhere.filter(session=session, kind=PartEntry.PLUGIN.value)
    return list(rows.order_by("pk").values_list("data", flat=True))


async def test_source_and_robot_are_noted_with_their_packages(place, begun):
    session = await begun(place)
    source = await place.source().open(plugin=METRONOME)
    await source.hang_up()
    source = await place.source().open(plugin=METRONOME)  # again: noted once
    robot = await place.robot().open(base="wagon", plugin=WAGON)
    await source.walk(4.0)
    assert await noted(session) == [METRONOME, WAGON]
    await robot.hang_up()
    review = await sync_to_async(review_session)(place.pt, session)
    assert "garry-wagon 1.0: wagon" in [event.text for event in review.events]


async def test_what_is_no_package_is_refused(place, begun):
    await begun(place)
    source = await place.source().dial()
    bad = {**WAGON, "version": "1 <b>"}
    await source.say({"type": "hello", "version": 1, "run": "r1", "last": 0, "plugin": bad})
    _, error = await source.sent_away()
    assert '"plugin" is an object with kind, name, package, version' in error["message"]


async def test_a_measure_and_a_gesture_are_noted_at_the_start(place, begun, monkeypatch):
    measure = Plugin("garry.measures", "a2", "garry-a2", "3", "")
    monkeypatch.setattr(MEASURES, "find_plugin", lambda _name: measure)
    session = await begun(place)
    assert await noted(session) == [measure.describe()]


@pytest.mark.parametrize("part", ["source", "robot"])
async def test_our_own_parts_are_not(place, begun, part):
    session = await begun(place)
    await getattr(place, part)().open()
    assert await noted(session) == []
