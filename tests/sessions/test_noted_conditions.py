"""How a patient walks: what a treadmill reports, and what holds for how many steps."""

from __future__ import annotations

import pytest

from rehab.sessions.log import SessionEvent
from rehab.sessions.models import TrainingSession
from rehab.sessions.noted_conditions import find_reported, format_noted, summarize_conditions
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
        ("pain", 4, "4 of 10"),
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
