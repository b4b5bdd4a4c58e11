"""How a patient walks: what a treadmill reports, what holds for how many steps, where it is read."""

from __future__ import annotations

import pytest

from rehab.sessions.conditions import find_reported, format_noted, summarize_conditions
from rehab.sessions.log import Remark, SessionEvent
from rehab.sessions.models import TrainingSession
from rehab.sessions.reports.insight import Walked, compare
from tests.support.world import NOW


def mark(kind, after, value):
    return SessionEvent(kind=kind, after_number=after, value=value)


@pytest.mark.parametrize(
    ("now", "extra", "changed"),
    [
        ({}, {"belt_speed_m_s": 0.8}, [("belt_speed", 0.8)]),
        ({"belt_speed": 0.8}, {"belt_speed_m_s": 0.83}, []),  # the belt's own unsteadiness
        ({"belt_speed": 0.8}, {"belt_speed_m_s": 0.9}, [("belt_speed", 0.9)]),
        ({}, {"belt_speed_m_s": 12.0}, []),  # kilometers an hour, or a fault
        ({}, {"belt_speed_m_s": float("nan")}, []),
        ({"weight_support": 20}, {"weight_support_percent": 10}, [("weight_support", 10)]),
        ({}, {"stride_s": 1.1}, []),
    ],
)
def test_a_treadmill_changes_what_it_reports_and_no_more(now, extra, changed):
    assert find_reported(now, extra) == changed


def test_a_session_has_the_mean_over_its_steps():
    session = TrainingSession(belt_speed_m_s=0.5, weight_support_percent=None, last_number=100)
    events = [
        mark("belt_speed", 50, 0.7),
        mark("handrail", 75, 1),
        mark("borg", 20, 3),
        mark("borg", 90, 6),
        mark("pain", 90, None),  # noted before it had a strength
        mark("near_fall", 90, None),
    ]
    means = summarize_conditions(session, events)
    assert means == pytest.approx({"belt_speed": 0.6, "handrail": 0.25, "borg": 6})
    assert summarize_conditions(TrainingSession(last_number=9), []) == {}
    before_any_step = TrainingSession(belt_speed_m_s=0.5, last_number=0)
    assert summarize_conditions(before_any_step, []) == {"belt_speed": 0.5}


@pytest.mark.parametrize(
    ("kind", "value", "text"),
    [
        ("belt_speed", 0.8, "0.80 m/s"),
        ("weight_support", 20, "20 %"),
        ("orthosis", 1, "from here on"),
        ("orthosis", 0, "no longer"),
        ("pain", 4, "4"),
        ("pain", None, ""),
        ("rest", None, ""),
    ],
)
def test_a_noted_value_has_its_unit(kind, value, text):
    assert format_noted(kind, value).replace("\N{NO-BREAK SPACE}", " ") == text


@pytest.mark.django_db
def test_sessions_are_compared_by_what_they_were_walked_with(world):
    def walked(**conditions):
        return Walked(world.session, NOW, 0.5, conditions=conditions)

    some = [
        walked(belt_speed=0.6, handrail=1.0),
        walked(belt_speed=0.75, handrail=0.2),
        walked(belt_speed=0.0),
        walked(),
    ]
    labels = [one.label.replace("\N{NO-BREAK SPACE}", " ") for one in compare(some, "speed")]
    assert labels == ["not noted", "0 m/s", "0.6–0.8 m/s"]
    assert [one.sessions for one in compare(some, "speed")] == [1, 1, 2]
    assert {one.label: one.sessions for one in compare(some, "help")} == {
        "handrail": 1,
        "without help, as far as noted": 3,
    }


async def test_a_reported_speed_is_a_mark_and_holds_after_a_restart(place, begun):
    session = await begun(place)
    monitor = await place.monitor(session).open()
    source = await place.source().open()
    await source.hear("welcome")
    for number, speed in enumerate((0.8, 0.81, 1.0), 1):
        step = {"number": number, "time_s": number * 1.1, "side": "left", "value": 4.0}
        await source.say({"type": "steps", "steps": [step | {"extra": {"belt_speed_m_s": speed}}]})
    await monitor.until_step(3)
    marks = [event for event in monitor.events if event["kind"] == "remark"]
    assert [(one["what"], one["value"], one["number"]) for one in marks] == [
        ("belt_speed", 0.8, 1),
        ("belt_speed", 1.0, 3),
    ]
    snapshot = await place.monitor(session).watch()
    assert snapshot["conditions"] == {"belt_speed": 1.0}
    rows = SessionEvent.everywhere.filter(session=session, kind=Remark.BELT_SPEED)
    assert [row.by_id async for row in rows] == [None, None]
