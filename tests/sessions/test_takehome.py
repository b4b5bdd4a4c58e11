"""The page to take home: figures that equal the log, in words that blame nobody."""

from __future__ import annotations

import re
from datetime import time, timedelta

import pytest
from django.urls import reverse

from rehab.patients.visits import plan_visit
from rehab.people.models import Patient
from rehab.people.roles import Role
from rehab.training.phases import make_phase
from tests.support.clock import HERE
from tests.support.page_text import article_words
from tests.support.walks import HIT, MISS, RIGHT, walk
from tests.support.world import World, client_of

pytestmark = pytest.mark.django_db


def read(world: World, patient: Patient, role: Role = Role.PT) -> str:
    """Return the page's words."""
    url = reverse("take-home", kwargs={"patient_id": patient.pk})
    return article_words(client_of(world, role).get(url).content.decode())


def test_it_counts_what_was_walked(world, patient):
    walk(patient, "positive", [HIT] * 6 + [MISS] * 4 + [None, (RIGHT, HIT)], days_ago=14)
    walk(patient, "binary", [HIT] * 3 + [MISS] + [HIT] * 6, days_ago=7)
    walk(patient, "explicit", [HIT] * 4 + [MISS] * 6)
    walk(patient, "positive", [HIT] * 5, simulated=True)  # nobody walked that
    walk(patient, "positive", [HIT] * 5, end=None)  # not finished
    words = read(world, patient)
    assert "3 sessions" in words
    assert "30 steps with your trained leg" in words
    assert "In your last session you reached the goal with 4 of 10 steps" in words
    assert "9 of 10" not in words  # of a session that may have had another goal
    assert "Your longest run of steps at the goal: 6" in words


@pytest.mark.parametrize(
    ("first", "last", "said"),
    [
        (2.0, 2.5, "Your push-off was 25 % stronger than in your first session."),
        (2.0, 1.5, "Your push-off was 25 % less than in your first session."),
        (2.0, 2.02, "Your push-off is about as in your first session."),
    ],
)
def test_it_says_how_the_mean_has_changed(world, patient, first, last, said):
    phases = (make_phase("baseline", strides=2), make_phase("training"))
    walk(patient, "positive", [9.0, 9.0] + [first] * 5, days_ago=40, phases=phases)
    walk(patient, "positive", [1.0] * 5, days_ago=20)
    walk(patient, "positive", [9.0, 9.0] + [last] * 5, phases=phases)
    words = read(world, patient)
    assert said in words  # of the feedback phases alone
    assert "First session, " in words
    assert not re.search(r"fail|bad|worse|poor|only", words)


def test_one_session_has_nothing_to_be_compared_with(world, patient):
    walk(patient, "negative", [HIT] * 4)
    words = read(world, patient)
    assert "1 session " in words
    assert "Your progress" not in words


def test_it_says_when_the_next_visit_is_and_what_it_is_all_for(world, patient):
    walk(patient, "positive", [HIT] * 4)
    Patient.everywhere.filter(pk=patient.pk).update(own_goal="Walk to the bakery")
    plan_visit(patient, HERE.date(), None)
    assert "We’ll see you again" not in read(world, patient)
    plan_visit(patient, HERE.date() + timedelta(days=7), None)
    words = read(world, patient)
    assert f"We’ll see you again on {HERE + timedelta(days=7):%A %-d %B}." in words
    plan_visit(patient, HERE.date(), time.max)
    assert "23:59" not in read(world, patient)  # today's training is done
    assert "Your goal: Walk to the bakery" in words


def test_the_next_visit_is_todays_until_its_time(world, patient):
    walk(patient, "positive", [HIT] * 4, days_ago=1)
    plan_visit(patient, HERE.date(), time.max)
    assert f"We’ll see you again on {HERE:%A %-d %B}, 23:59." in read(world, patient)
    plan_visit(patient, HERE.date(), time.min)
    assert "see you again" not in read(world, patient)


def test_nothing_walked_yet(world, patient):
    assert "No finished session yet." in read(world, patient)
