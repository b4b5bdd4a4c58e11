"""What is noted with one tap, and sessions that a page of the site makes and changes."""

from __future__ import annotations

from asgiref.sync import ThreadSensitiveContext, sync_to_async

from rehab.sessions.live import runtime as runtimes
from rehab.sessions.live.session.aggregate import SessionAggregate
from rehab.sessions.log import REMARK_RANGES, Remark, SessionEvent
from rehab.sessions.services import change_session
from rehab.training.changes import ChangeKind
from rehab.training.phases import make_phase
from tests.support.callers import (
    change,
)
from tests.support.walks import make_session

PHASES = (
    make_phase("training", strides=4),
    make_phase("catch", strides=2),
    make_phase("training", gain=0.9),
)


VALUES = {what: float(min(3, most)) for what, (_least, most) in REMARK_RANGES.items()}


async def test_a_page_of_the_site_may_create_and_change_sessions(place, elsewhere):
    """In the thread and context of a request, as Django runs its views."""
    source = await place.source().open()
    robot = await place.robot().open()

    def view():
        session = make_session(place.patient, phases=PHASES, station=place.station)
        change_session(session, ChangeKind.START, by=place.pt)
        change_session(session, ChangeKind.GOAL, 4.0, by=place.pt)
        return session

    async with ThreadSensitiveContext():
        session = await sync_to_async(view)()
    assert (await source.hear("welcome"))["session"] == session.pk
    assert (await robot.hear("welcome"))["session"] == session.pk
    await source.overhear()
    source.number = 0
    await source.walk(4.0)
    await robot.hear("step")
    assert runtimes.current().sessions[session.pk].aggregate.fold.goal == 4.0


async def test_remarks_are_kept_in_the_log_and_alter_no_score(place, sourced):
    session, source = await sourced(place)
    await source.walk(4.0, 4.0)
    monitor, other, tablet = (
        await place.monitor(session).open(),
        await place.monitor(session).open(),
        await place.tablet(session).open(),
    )
    for index, what in enumerate(Remark):
        value = {"value": VALUES[what]} if what in VALUES else {}
        await monitor.say({"type": "remark", "what": what.value, "id": f"r{index}", **value})
        assert (await monitor.hear("done"))["id"] == f"r{index}"
        seen = await other.until(lambda event, what=what: event.get("what") == what.value)
        assert (seen["number"], seen["value"]) == (2, VALUES.get(what))
    await source.walk(4.0)
    assert (await tablet.until_step(3))["score"] == 3
    assert not [event for event in tablet.events if event["kind"] == "remark"]
    rows = SessionEvent.everywhere.filter(session=session, kind__in=list(Remark)).order_by("pk")
    kept = [row async for row in rows.values_list("kind", "after_number", "value", "by")]
    assert kept == [(what.value, 2, VALUES.get(what), place.pt.pk) for what in Remark]
    rebuilt = await sync_to_async(SessionAggregate.load)(session)
    assert rebuilt.fold.score == 3
    marks = [{"after": 2, "kind": what.value, "value": VALUES.get(what)} for what in Remark]
    assert list(rebuilt.marks) == (await place.monitor(session).watch())["marks"] == marks


async def test_what_cannot_be_noted(place, begun):
    session = await begun(place)
    tablet, monitor = await place.tablet(session).open(), await place.monitor(session).open()
    await tablet.say({"type": "remark", "what": "rest", "id": "r"})
    assert (await tablet.hear("error"))["code"] == "refused"
    await change(session, "abort")
    await monitor.say({"type": "remark", "what": "rest", "id": "r"})
    assert (await monitor.hear("error"))["message"] == "The session has ended."
    for bad in (
        {"what": "joy"},
        {"what": "borg"},
        {"what": "pain"},
        {"what": "handrail", "value": 2},
        {"what": "belt_speed", "value": 12},  # kilometers an hour
        {"what": "borg", "value": 11},
        {"what": "fall_severity", "value": 4},
        {},
    ):
        page = await place.monitor(session).open()
        await page.say({"type": "remark", "id": "r", **bad})
        assert (await page.sent_away())[0] == 4400
