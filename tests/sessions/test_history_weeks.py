"""Past sessions by weeks: which period, and what was noted of falls and exertion."""

from __future__ import annotations

import pytest

from rehab.people.models import Patient
from rehab.people.roles import Role
from rehab.sessions.log import SessionEvent
from rehab.sessions.models import TrainingSession
from tests.support.page_text import plain
from tests.support.page_text import words as page_words
from tests.support.walks import strides, walk
from tests.support.world import NOW, World, client_of

pytestmark = pytest.mark.django_db


def words(world: World, patient: Patient, asked: str = "") -> str:
    page = client_of(world, Role.PT).get(f"/patients/{patient.pk}/sessions/{asked}")
    return plain(page_words(page.content.decode().split("<main")[1].split("</main>")[0]))


def note(session: TrainingSession, *kinds: tuple[str, float | None]) -> None:
    for kind, value in kinds:
        SessionEvent.everywhere.create(
            session=session, kind=kind, value=value, after_number=1, at=NOW
        )


def test_a_period_leaves_older_sessions_out_and_keeps_the_type(world, patient):
    for days_ago in (1, 40, 100, 400):
        walk(patient, "positive", strides(3, 2), days_ago=days_ago)
    walk(patient, "binary", strides(3, 2), days_ago=2)
    for weeks, count in (("4", 2), ("12", 3), ("52", 4), ("", 5), ("3000", 5), ("-1", 5)):
        assert f"All types {count} " in words(world, patient, f"?weeks={weeks}")
    told = words(world, patient, "?type=binary&weeks=12")
    assert told.count("Binary · goal") == 1
    assert "Positive · goal" not in told
    assert "in this period" in words(world, patient, "?type=negative&weeks=4")


def test_a_sentence_compares_the_last_sessions_that_compare(world, patient):
    for days_ago in range(1, 7):
        assert "last three sessions" not in words(world, patient)
        walk(patient, "positive", strides(days_ago, 6 - days_ago), days_ago=days_ago)
    told = "In the last three sessions fewer steps reached the goal than in the three before."
    assert told in words(world, patient)


def test_sessions_stand_under_their_week(world, patient):
    for days_ago in (0, 0, 14):
        walk(patient, "positive", strides(3, 2), days_ago=days_ago)
    assert words(world, patient).count("Week of ") == 2


def test_falls_and_exertion_stand_with_their_session(world, patient):
    first = walk(patient, "positive", strides(3, 2), days_ago=2)
    note(first, ("borg", 3), ("fall", None), ("fall", None), ("fall_withdrawn", None), ("borg", 5))
    other = walk(patient, "positive", strides(3, 2), days_ago=1)
    note(other, ("fall", None), ("fall_withdrawn", None))
    told = words(world, patient)
    assert told.count("fall") == 1
    assert "1 fall · Borg 3–5" in told
