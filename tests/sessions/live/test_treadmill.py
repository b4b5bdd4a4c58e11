"""What a treadmill reports with its strides: a mark for all pages, and a condition that holds."""

from __future__ import annotations

from asgiref.sync import sync_to_async

from rehab.sessions.live.session.aggregate import SessionAggregate
from rehab.sessions.log import Remark, SessionEvent


async def test_a_reported_speed_is_a_mark_and_holds_after_a_restart(place, sourced):
    session, source = await sourced(place)
    monitor = await place.monitor(session).open()
    for speed in (0.8, 0.81, 1.0):
        await source.walk(4.0, extra={"belt_speed_m_s": speed})
    await monitor.until_step(3)
    snapshot = await place.monitor(session).watch()
    assert snapshot["conditions"] == {"belt_speed": 1.0}
    marks = [event for event in monitor.events if event["kind"] == "remark"]
    assert [(one["what"], one["value"], one["number"]) for one in marks] == [
        ("belt_speed", 0.8, 1),
        ("belt_speed", 1.0, 3),
    ]
    rebuilt = await sync_to_async(SessionAggregate.load)(session)
    assert rebuilt.conditions == {"belt_speed": 1.0}
    rows = SessionEvent.everywhere.filter(session=session, kind=Remark.BELT_SPEED)
    assert [row.by_id async for row in rows] == [None, None]
