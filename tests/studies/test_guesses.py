"""What people guess about their group at the end, and the indices of it."""

from __future__ import annotations

import pytest
from django.urls import reverse

from rehab.people.models import User
from rehab.people.roles import Role
from rehab.studies.analysis.blinding_index import bang_index, james_index
from rehab.studies.blinding import Task, give_mark
from rehab.studies.enrolling import withdraw
from rehab.studies.guesses import UNKNOWN, Guesser, guess_rows, may_guess, record_guess
from rehab.studies.participants import StudyEvent
from rehab.studies.registration.lifecycle import close
from rehab.studies.visits import Place, start_session
from rehab.training.measures import InvalidSetting
from tests.support.studies import enrolled, new_patient, running_study
from tests.support.world import NOW, signed_in

# The example of the R package BI 1.2.0 (its manual): allocated to treatment or placebo; guessed
# treatment, placebo, do not know.
PUBLISHED = [[48, 4, 330], [22, 30, 319]]


def rounded(interval):
    return tuple(round(one, 3) for one in (interval.estimate, interval.low, interval.high))


def test_the_indices_are_those_of_a_published_example():
    assert rounded(james_index(PUBLISHED)) == (0.896, 0.875, 0.918)
    assert rounded(bang_index(PUBLISHED[0], 0)) == (0.115, 0.08, 0.15)
    assert rounded(bang_index(PUBLISHED[1], 1)) == (0.022, -0.016, 0.06)


@pytest.mark.parametrize(
    ("counts", "james", "bang"),
    [
        ([[9, 0, 0], [0, 9, 0]], 0.0, 1.0),  # all are right
        ([[0, 0, 9], [0, 0, 9]], 1.0, 0.0),  # nobody knows
        ([[5, 5, 0], [5, 5, 0]], 0.5, 0.0),  # as good as chance
        ([[0, 9, 0], [9, 0, 0]], 1.0, -1.0),  # all guess the other
    ],
)
def test_the_indices_at_their_ends(counts, james, bang):
    assert james_index(counts).estimate == pytest.approx(james)
    for group in (0, 1):
        assert bang_index(counts[group], group).estimate == pytest.approx(bang)


def test_without_people_there_is_no_index():
    assert james_index([[0, 0, 0], [0, 0, 0]]) is None
    assert bang_index([0, 0, 0], 0) is None
    assert james_index([[3, 0, 1], [0, 0, 0]]) is None  # of one group, all right: no chance


@pytest.fixture
def trial(db, world):
    """Return a study, its assessor, and four participants whose visits are over."""
    study = running_study(world)
    assessor = User.everywhere.create_user("zz", role=Role.PT, clinic=world.clinic)
    give_mark(study, assessor, Task.ASSESSOR, None, NOW)
    people = [enrolled(study, new_patient(world, number)) for number in range(4)]
    for one in people:
        withdraw(one, None, NOW)
    return study, assessor, people


def guess(client, enrollment, group):
    return client.post(reverse("note-guess", args=[enrollment.pk]), {"group": group})


@pytest.mark.postgres
def test_guesses_are_noted_once_and_shown_once_the_study_is_closed(trial, world):
    study, assessor, people = trial
    blinded = signed_in(assessor)
    for number, one in enumerate(people):
        page = world.pt.get(reverse("participant", args=[one.pk])).content.decode()
        assert "Which group was it?" in page
        assert guess(world.pt, one, one.allocation.group).status_code == 302
        assert guess(world.pt, one, "A").status_code == 403  # once
        assert guess(blinded, one, UNKNOWN if number else "B").status_code == 302
    assert StudyEvent.everywhere.filter(study=study, kind="guessed").count() == 8
    assert (
        "Which group was it?"
        not in world.pt.get(reverse("participant", args=[people[0].pk])).content.decode()
    )
    close(study, None, NOW)
    rows = list(guess_rows(study))
    assert [(row["guesser"], row["group"], row["index"]) for row in rows] == [
        *(("participant", "A", "Bang"), ("participant", "B", "Bang"), ("participant", "", "James")),
        *(("assessor", "A", "Bang"), ("assessor", "B", "Bang"), ("assessor", "", "James")),
    ]
    assert [row["estimate"] for row in rows[:3]] == [1, 1, 0]
    assert rows[-1]["do_not_know"] == 3
    page = world.pt.get(reverse("study-results", args=[study.pk])).content.decode()
    assert "How well it was blinded" in page
    assert "James 0.00 (0.00 … 0.00)" in page
    file = world.pt.get(reverse("study-results-file", args=[study.pk]) + "?file=guesses.csv")
    assert file.content.decode().splitlines()[1].startswith("participant,A,2,0,0,Bang,1")


def test_nobody_is_asked_while_the_last_visit_is_still_walked(world):
    study = running_study(world, visits=1)
    assessor = User.everywhere.create_user("zz", role=Role.PT, clinic=world.clinic)
    give_mark(study, assessor, Task.ASSESSOR, None, NOW)
    one = enrolled(study, new_patient(world))
    session = start_session(one, Place(), world.people[Role.PT], NOW)
    for by in (assessor, world.people[Role.PT]):
        assert may_guess(one, by) is None
    session.state = "finished"
    session.save()
    assert may_guess(one, assessor) == Guesser.ASSESSOR


def test_an_assessor_is_asked_once_all_visits_are_over_and_sees_no_arms_before(trial, world):
    study, assessor, people = trial
    late = enrolled(study, new_patient(world, 9))
    page = reverse("participant", args=[people[0].pk])
    assert "feedback positive" not in signed_in(assessor).get(page).content.decode()
    assert guess(signed_in(assessor), people[0], "A").status_code == 403
    with pytest.raises(InvalidSetting, match="after the last visit"):
        record_guess(late, "A", world.people[Role.PT], NOW)
    withdraw(late, None, NOW)
    assert "feedback positive" in signed_in(assessor).get(page).content.decode()


@pytest.mark.parametrize("group", ["", "C", "A-B", "A" * 500])
def test_no_other_group_is_guessed(trial, world, group):
    answer = guess(world.pt, trial[2][0], group)
    assert answer.status_code == 403
    assert "Choose one of the groups" in answer.content.decode()


def test_nothing_is_guessed_once_the_study_is_closed(trial, world):
    close(trial[0], None, NOW)
    assert guess(world.pt, trial[2][0], "A").status_code == 403
