"""What stands in a row of a board, and which sessions count for it."""

from __future__ import annotations

import pytest

from rehab.training.changes import ChangeKind
from rehab.training.phases import make_phase
from tests.support.boards import board_of, figures_of, patient_of, people_of, see, told, walk_down
from tests.support.walks import strides, walk

pytestmark = pytest.mark.django_db


@pytest.mark.parametrize(
    ("aggregation", "value"), [("best", "80%"), ("latest", "40%"), ("mean", "55%")]
)
def test_what_stands_in_a_row(clinic, aggregation, value):
    board = board_of(clinic, aggregation=aggregation, mean_of=2)
    person = patient_of(clinic, "A")
    for days_ago, hits in ((3, 8), (2, 7), (1, 4)):
        walk(person, "positive", strides(hits, 10 - hits), days_ago=days_ago)
    assert f"{figures_of(board)[person.pk]}%" == value


def test_only_sessions_that_are_long_enough_ended_and_walked_count(clinic):
    board = board_of(
        clinic, min_valid_strides=10, aggregation="sum", metric="attended", types="all"
    )
    person = patient_of(clinic, "A")
    walk(person, "positive", strides(9, 0))
    walk(person, "positive", strides(90, 0), simulated=True)
    walk(person, "positive", strides(90, 0), end=ChangeKind.ABORT)
    walk(person, "positive", strides(90, 0), end=None)
    assert not figures_of(board)
    walk(person, "binary", strides(10, 0))
    assert figures_of(board)[person.pk] == 1
    board.min_minutes = 1
    board.include_simulated = True
    board.save()
    assert figures_of(board)[person.pk] == 2
    walk(person, "positive", strides(70, 0), phases=(make_phase("washout"),))
    assert figures_of(board)[person.pk] == 3


def test_minutes_of_a_day_are_counted_up_to_an_hour_and_targets_by_the_day(clinic):
    minutes = board_of(clinic, aggregation="sum", metric="active_minutes", types="all")
    days = board_of(clinic, name="Days", aggregation="sum", metric="target_met", types="all")
    person = patient_of(clinic, "A")
    for _ in range(2):
        walk(person, "positive", strides(2400, 0), days_ago=2, wanted=0.5)
    walk(person, "positive", strides(600, 0), days_ago=1, wanted=0.5)
    walk(person, "positive", strides(0, 600), wanted=0.5)
    assert figures_of(minutes)[person.pk] == 60 + 10 + 10
    assert figures_of(days)[person.pk] == 2


def test_a_total_is_reached_together_and_hidden_below_five(clinic):
    board_of(
        clinic, display="total", aggregation="sum", metric="steps", types="all", total_goal=200
    )
    people = people_of(clinic, 5, boards="total")
    sessions = walk_down(people[:4])
    alone = see(sessions[1])
    assert (alone.total, alone.rows[0].value, alone.rows[0].you) == (None, "20", True)
    walk(people[4], "positive", strides(20, 0))
    total = see(sessions[0]).total
    assert (total.value, total.goal, total.bar, total.people) == ("100", "200", 50, 5)
    assert total.mine == "20"


def test_lower_may_be_better(clinic):
    board_of(clinic, higher_is_better=False, display="top")
    people = people_of(clinic, 5)
    sessions = walk_down(people)
    assert told(see(sessions[4])) == [(1, "80%", True), (2, "85%", False), (3, "90%", False)]
