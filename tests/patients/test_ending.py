"""The end of a session in the patient's words: true, of its feedback type, and blaming nobody."""

from __future__ import annotations

import html
import re
from datetime import time, timedelta

import pytest
from django.test import Client
from django.urls import reverse

from rehab.patients.visits import plan_visit
from rehab.sessions.models import TrainingSession
from rehab.sessions.reports.better_or_worse import Result
from rehab.sessions.reports.earned_number import next_mark
from rehab.sessions.reports.patient_summary import describe_today, is_milestone
from rehab.training.valences import VALENCES
from tests.support.boards import tablet_at
from tests.support.walks import HIT, MISS, walk
from tests.support.world import NOW, World

pytestmark = pytest.mark.django_db


def read(world: World, session: TrainingSession, client: Client | None = None) -> str:
    """Return the page's words; to a therapist, or in another browser."""
    browser = client or world.pt
    page = browser.get(reverse("ending", args=[session.pk])).content.decode()
    words = html.unescape(re.sub(r"<[^>]+>", " ", page.split("<main")[1]))
    return " ".join(words.replace("\N{NO-BREAK SPACE}", " ").split())


@pytest.mark.parametrize(
    ("rate", "goal", "said"),
    [
        (0.7, 2.0, "More often at the goal than last time."),
        (0.62, 2.0, "As often at the goal as last time."),
        (0.4, 2.0, "Less often at the goal than last time. Every day is different."),
        (0.6, 2.2, "The goal was higher than last time, and you reached it just as often."),
        (0.3, 2.2, "The goal was higher than last time."),
        (0.9, 1.8, ""),
    ],
)
def test_the_sentence_is_true_of_both_days(rate: float, goal: float, said: str) -> None:
    assert describe_today(Result(rate, 2.0, goal), Result(0.6, 2.0, 2.0)) == said


def test_today_stands_beside_last_time(world, patient):
    walk(patient, "binary", [HIT] * 9 + [MISS], days_ago=9)
    walk(patient, "binary", [HIT] * 4 + [MISS] * 6, days_ago=7)
    walk(patient, "positive", [HIT] * 10, days_ago=2, simulated=True)  # nobody walked that
    session = walk(patient, "positive", [HIT] * 5 + [MISS] * 3 + [HIT] * 2)
    day = (NOW + timedelta(days=7)).date()
    plan_visit(patient, NOW.date(), time(9, 30))
    plan_visit(patient, day, time(14, 15))
    words = read(world, session)
    assert "You walked" in words
    assert "Today 7 of 10 Last time 4 of 10" in words
    assert "Last time 4 of 10 More often at the goal than last time." in words
    assert "Most in a row 5 steps at the goal" in words
    assert f"{day:%A} {day.day} {day:%B}, 14:15" in words
    assert "More often at the goal than last time." in words


@pytest.mark.parametrize(
    ("valence", "before", "walked", "said"),
    [
        ("positive", [], [HIT] * 7 + [MISS] * 3, "7 points Next mark: 10."),
        ("positive", [HIT] * 5, [HIT] * 7 + [MISS] * 3, "7 points Your best so far!"),
        ("positive", [HIT] * 9, [HIT] * 7 + [MISS] * 3, "7 points Next mark: 9."),
        # What was lost is no number to take home.
        ("binary", [], [HIT] * 2 + [MISS] * 8, "2 steps at the goal Next mark: 10."),
        ("negative", [], [HIT] * 6 + [MISS] * 4, "6 steps at the goal Next mark: 10."),
        ("negative", [], [MISS] * 10, "10 steps with your left leg You walked"),
        ("explicit", [], [HIT] * 6 + [MISS] * 4, "10 steps with your left leg You walked"),
    ],
)
def test_the_one_number_is_earned_and_shames_nobody(world, patient, valence, before, walked, said):
    if before:
        walk(patient, valence, before, days_ago=7)
    words = read(world, walk(patient, valence, walked))
    assert said in words
    assert "Thank you, " in words
    assert "−" not in words.split("Thank you")[0]


@pytest.mark.parametrize(
    ("number", "best", "mark"),
    [(7, 0, 10), (10, 0, 20), (99, 0, 100), (710, 732, 732), (710, 900, 800), (460, 460, 500)],
)
def test_the_next_mark_is_the_nearest_above(number: int, best: int, mark: int) -> None:
    assert next_mark(number, best) == mark


def test_a_paired_tablet_tells_the_patient_the_same(world, patient):
    walk(patient, "positive", [HIT] * 4 + [MISS] * 6, days_ago=7)
    other = world.add_patient("Omar")
    walk(other, "positive", [HIT] * 10, days_ago=1)
    session = walk(patient, "positive", [HIT] * 7 + [MISS] * 3)
    station = world.add_station()
    TrainingSession.everywhere.filter(pk=session.pk).update(station=station)
    plan_visit(patient, (NOW + timedelta(days=7)).date(), time(14, 15))
    words = read(world, session, tablet_at(station))
    assert "Today 7 of 10 Last time 4 of 10" in words
    assert "Most in a row so far 7 steps at the goal" in words
    assert "Next visit" in words


def test_a_longer_row_than_ever_is_told_as_one(world, patient):
    walk(patient, "binary", [HIT] * 4 + [MISS], days_ago=9)
    walk(patient, "negative", [HIT] * 3 + [MISS] * 9, days_ago=7)
    words = read(world, walk(patient, "positive", [HIT] * 4 + [MISS], days_ago=5))
    assert "4 steps at the goal" in words
    assert "in a row so far" not in words
    words = read(world, walk(patient, "positive", [HIT] * 6 + [MISS]))
    assert "Most in a row so far 6 steps at the goal" in words


@pytest.mark.parametrize("valence", list(VALENCES))
def test_a_round_number_of_sessions_is_told_but_in_the_explicit_type(world, patient, valence):
    for ago in range(9, 5, -1):
        walk(patient, valence, [HIT, MISS], days_ago=ago)
    told = "Sessions so far 5" in read(world, walk(patient, valence, [HIT, MISS]))
    assert told == (valence != "explicit")
    assert "so far" not in read(world, walk(patient, valence, [HIT, MISS], days_ago=-1))


def test_round_numbers_become_rarer():
    assert [n for n in range(1, 301) if is_milestone(n)] == [5, 10, 25, 50, 100, 200, 300]


def test_a_type_that_only_takes_points_praises_no_row(world, patient):
    words = read(world, walk(patient, "negative", [HIT] * 9 + [MISS]))
    assert "Today 9 of 10" in words
    assert "Next mark: " in words
    assert "in a row" not in words


def test_a_value_that_nothing_compares_with_has_no_bar(world, patient):
    ending = [
        world.pt.get(reverse("ending", args=[walk(patient, "explicit", [HIT], days_ago=ago).pk]))
        for ago in (7, 0)
    ]
    assert [page.content.decode().count('class="room"') for page in ending] == [0, 2]


def test_the_explicit_type_shows_values_and_no_verdict(world, patient):
    walk(patient, "explicit", [MISS] * 4, days_ago=7)
    words = read(world, walk(patient, "explicit", [HIT] * 4))
    values = "Today 2.50 W/kg Last time 1.50 W/kg Goal 2.00 W/kg"
    assert f"over the steps with feedback. {values}" in words
    assert words.lower().count("goal") == 1
    assert "of 10" not in words


def test_a_blinded_study_tells_no_figure(world, patient):
    session = walk(patient, "positive", [HIT] * 10)
    patient.blinded = True
    patient.save()
    words = read(world, session)
    assert "You walked" in words
    assert "of 10" not in words
    assert "in a row" not in words
    assert reverse("scores", args=[session.pk]) not in words


def test_an_open_session_goes_on(world, patient):
    session = walk(patient, "positive", [HIT], end=None)
    answer = world.pt.get(reverse("ending", args=[session.pk]))
    assert answer.headers["Location"] == reverse("walk", args=[session.pk])
