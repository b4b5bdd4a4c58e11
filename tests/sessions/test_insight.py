"""Sessions compared at equal goals, with their intervals and what went wrong."""

from __future__ import annotations

import csv
import io

import pytest
from scipy import stats

from rehab.people.models import Patient
from rehab.sessions.log import Remark, SessionEvent
from rehab.sessions.reports.insight import Walked, compare, goal_bands
from rehab.sessions.reports.insight_summary import summarize_groups
from rehab.sessions.reports.intervals import mean_interval
from tests.support.world import NOW, client_of

pytestmark = pytest.mark.django_db


def walked_like(session, **changes):
    """Return a session of these goals, patients and hit rates, stored nowhere."""
    one = type(session).everywhere.select_related("measure", "patient").get(pk=session.pk)
    hit_rate = changes.pop("hit_rate")
    for name, value in changes.items():
        setattr(one, name, value)
    return Walked(one, NOW, hit_rate)


def test_interval_is_that_of_students_t():
    values = [0.4, 0.55, 0.6, 0.7]
    interval = mean_interval(values)
    low, high = stats.t.interval(0.95, 3, loc=interval.mean, scale=stats.sem(values))
    assert (interval.low, interval.high) == pytest.approx((low, high))
    assert mean_interval([0.9, 1.0], (0, 1)).high == 1
    assert mean_interval([0.5]).low is None
    assert mean_interval([]) is None


def test_equal_goals_are_those_within_a_tenth(world):
    rows = [walked_like(world.session, goal=goal, hit_rate=0.5) for goal in (3.9, 4.0, 4.1, 6.0)]
    (_, words, count), (_, _, other) = goal_bands(rows)
    assert words.startswith("3.90–4.10")
    assert (count, other) == (3, 1)


def test_several_patients_are_compared_by_their_means(world):
    other = Patient(pk=world.patient.pk + 1000, nickname="Ana", code="A")
    rows = [
        *(walked_like(world.session, hit_rate=rate) for rate in (0.2, 0.4)),
        *(walked_like(world.session, patient=other, hit_rate=rate) for rate in (0.9, 0.9, 0.9)),
    ]
    (group,) = compare(rows, "type")
    assert group.hit_rate.mean == pytest.approx((0.3 + 0.9) / 2)
    assert group.unit == "2 patients"
    assert group.lacks == "needs 1 more patient"
    ana, mine = compare(rows, "patient")
    assert ana.unit == "3 sessions"
    assert (ana.lacks, mine.lacks) == ("", "needs 1 more session")
    changed = [*rows, walked_like(world.session, changed_to="binary", hit_rate=1.0)]
    types = [(one.label, one.valence) for one in compare(changed, "type")]
    assert types == [("Positive", "positive"), ("changed during the session", "")]


@pytest.mark.parametrize(
    ("rates", "told"),
    [
        (((0.8, 0.82, 0.81), (0.3, 0.31, 0.29)), "Their likely ranges do not overlap."),
        (((0.8, 0.2, 0.81), (0.3, 0.31, 0.29)), "their likely ranges overlap"),
        (((0.8,), (0.3, 0.31, 0.29)), "has too few to compare"),
        (((0.8,), (0.3, 0.3)), ""),  # too little data, which the page says
        (((0.8, 0.7),), ""),
    ],
)
def test_a_sentence_says_what_the_table_shows(world, rates, told):
    types = [
        walked_like(world.session, valence=valence, hit_rate=rate)
        for valence, of_type in zip(("positive", "negative"), rates, strict=False)
        for rate in of_type
    ]
    sentence = summarize_groups(compare(types, "type"))
    assert told in sentence.replace("\xa0", " ")
    assert bool(told) is bool(sentence)
    if "do not" in told:
        assert sentence.startswith("Highest: Positive, ")
        assert "Lowest: Negative, 30 %" in sentence.replace("\xa0", " ")


def test_page_tells_what_went_wrong_and_leads_to_the_moment(world):
    session = world.session
    type(session).everywhere.filter(pk=session.pk).update(simulated=False, active_s=600)
    row = {"session": session, "after_number": 2, "at": session.began_at}
    for kind, value in (
        (Remark.FALL, None),
        (Remark.FALL_SEVERITY, 1),
        (Remark.FALL, None),
        (Remark.FALL_WITHDRAWN, None),
        (Remark.PAIN, None),
    ):
        SessionEvent.everywhere.create(kind=kind, value=value, **row)
    client = client_of(world)
    page = " ".join(client.get("/insight/?weeks=").content.decode().split())
    assert "fall, slightly hurt" in page
    assert page.count("1 × fall") == 2  # in the table, and in what a phone has in place of it
    assert ("Too little data" in page, "Highest" in page) == (True, False)
    assert f"/sessions/{session.pk}/replay/?at=" in page
    assert client.get(f"/sessions/{session.pk}/replay/?at=1").status_code == 200
    lines = client.get("/insight/sessions.csv?weeks=").content.decode()
    (line,) = csv.DictReader(io.StringIO(lines))
    assert (line["fall"], line["pain"], line["code"]) == ("1", "1", world.patient.code)
    assert client.get("/insight/?goal=any&weeks=4&by=nonsense").status_code == 200
