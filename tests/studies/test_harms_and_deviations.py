"""In a study's session what defines the arm is locked; what is done all the same is told."""

from __future__ import annotations

import csv
import io
from datetime import timedelta

import pytest
from django.urls import reverse

from rehab.people.roles import Role
from rehab.sessions.live.session.aggregate import SessionAggregate
from rehab.sessions.log import Remark, RobotEntry, SessionEvent
from rehab.sessions.models import TrainingSession
from rehab.sessions.services import change_session
from rehab.studies.blinding import reveal_arms
from rehab.studies.record.adverse_events import propose
from rehab.studies.registration.lifecycle import close
from rehab.studies.results.results import read_results
from rehab.studies.visits import Place, start_session
from rehab.training.changes import Change, ChangeKind, NotAllowed
from rehab.training.fold import SessionFold
from tests.support.studies import enrolled, new_patient, running_study
from tests.support.world import NOW, client_of

pytestmark = pytest.mark.django_db


def study_session(world, study, number=1):
    enrollment = enrolled(study, new_patient(world, number))
    return start_session(enrollment, Place(), None, NOW)


@pytest.mark.parametrize(
    ("kind", "value"),
    [
        (ChangeKind.GAIN, 0.85),
        (ChangeKind.ROBOT_INTENSITY, 0.5),
        (ChangeKind.ACTIVATION_THRESHOLD, 0.9),
        (ChangeKind.VALENCE, "explicit"),
        (ChangeKind.VALENCE_NOW, "explicit"),
        (ChangeKind.WORDS_SHOWN, 0.0),
        (ChangeKind.GOAL_ADAPTATION, "automatic"),
        (ChangeKind.GOAL, 3.55),
    ],
)
def test_what_defines_the_arm_is_locked_in_a_studys_session_alone(world, kind, value):
    session = study_session(world, running_study(world))
    aggregate = SessionAggregate(session)
    aggregate.change(Change(ChangeKind.START), None, NOW)
    with pytest.raises(NotAllowed, match="belongs to a study"):
        aggregate.change(Change(kind, value), None, NOW)


@pytest.mark.django_db(transaction=True)
def test_no_order_from_outside_changes_a_studys_goal_and_none_is_suggested(world):
    session = study_session(world, running_study(world))
    change_session(session, ChangeKind.START)
    with pytest.raises(NotAllowed, match="belongs to a study"):
        change_session(session, ChangeKind.GOAL, 3.55)
    assert not SessionEvent.everywhere.filter(kind=ChangeKind.GOAL).exists()
    assert session.to_plan().adaptation.mode == "off"
    change_session(session, ChangeKind.ABORT)


def test_a_safety_stop_is_never_locked(world):
    plan = study_session(world, running_study(world)).to_plan()
    for kind, value in (
        (ChangeKind.ROBOT_INTENSITY, 0.0),
        (ChangeKind.PAUSE, None),
        (ChangeKind.FINISH, None),
        (ChangeKind.ABORT, None),
    ):
        fold = SessionFold(plan)
        fold.change(Change(ChangeKind.START))
        fold.change(Change(kind, value))


def test_the_page_of_a_studys_session_does_not_offer_what_is_locked(world):
    session = study_session(world, running_study(world))
    page = client_of(world, Role.LEAD).get(reverse("monitor", args=[session.pk])).content.decode()
    assert "fixed by the study" in page
    assert page.count(" inert") >= 3
    goal = page.partition('data-goal="-1"')[0]
    assert goal[goal.rindex("<div") :].split(">")[0] == '<div class="step" inert'


@pytest.mark.django_db(transaction=True)
def test_harms_and_deviations_are_counted_by_themselves_on_the_page_and_in_files(world):
    study = running_study(world)
    session = study_session(world, study)
    change_session(session, ChangeKind.START)
    for kind, value in (
        (Remark.FALL, None),
        (Remark.FALL_SEVERITY, 2.0),
        (Remark.FALL, None),
        (Remark.FALL_WITHDRAWN, None),
        (Remark.NEAR_FALL, None),
        (Remark.DIZZINESS, None),
        (Remark.PAIN, None),
        (Remark.HANDRAIL, None),
        (RobotEntry.STOP, None),
        (ChangeKind.ROBOT_INTENSITY, 0.0),
        (ChangeKind.GOAL, 2.5),
    ):
        SessionEvent.everywhere.create(
            session=session, after_number=0, kind=str(kind), value=value, at=NOW
        )
    change_session(session, ChangeKind.ABORT)
    enrollment = study.enrollments.get()
    reveal_arms(enrollment, "She fell.", emergency=True, by=world.people[Role.LEAD], now=NOW)
    close(study, None, NOW + timedelta(days=1))
    client = client_of(world, Role.LEAD)
    page = client.get(reverse("study-results", args=[study.pk])).content.decode()
    assert "Harms and deviations" in page
    file = reverse("study-results-file", args=[study.pk])
    told = client.get(file, {"file": "conduct.csv"}).content.decode()
    rows = list(csv.DictReader(io.StringIO(told)))
    counted = {row["what"]: (row["kind"], row["events"]) for row in rows if row["events"] != "0"}
    assert counted == {
        "fall": ("harm", "1"),
        "near_fall": ("harm", "1"),
        "dizziness": ("harm", "1"),
        "pain": ("harm", "1"),
        "robot_stop": ("deviation", "1"),
        "robot_intensity": ("deviation", "1"),
        "goal": ("deviation", "1"),
        "ended_early": ("deviation", "1"),
        "unblinded": ("deviation", "1"),
    }
    arms = {row["group"] for row in rows}
    assert len(arms) == 2  # also the arm in which nothing happened
    listed = client.get(file, {"file": "occurrences.csv"}).content.decode()
    [fall] = [row for row in csv.DictReader(io.StringIO(listed)) if row["what"] == "fall"]
    assert (fall["participant"], fall["visit"], fall["value"]) == (enrollment.code, "1", "2.0")


@pytest.mark.django_db(transaction=True)
def test_a_session_that_was_finished_before_its_last_phase_is_a_deviation(world):
    study = running_study(world)
    session = study_session(world, study)
    change_session(session, ChangeKind.START)
    change_session(session, ChangeKind.FINISH)
    assert [one.what for one in read_results(study, NOW).occurrences] == ["phases_not_walked"]


@pytest.mark.django_db(transaction=True)
def test_pages_tell_a_visit_that_was_simulated_cut_short_changed_or_on_another_day(world):
    study = running_study(world)
    enrollment = enrolled(study, new_patient(world))
    later = NOW + timedelta(days=3)
    session = start_session(enrollment, Place(source_args=("synthetic",)), None, later)
    TrainingSession.everywhere.filter(pk=session.pk).update(created_at=later)
    SessionEvent.everywhere.create(
        session=session, after_number=0, kind=ChangeKind.GOAL.value, value=3.55, at=later
    )
    change_session(session, ChangeKind.START)
    change_session(session, ChangeKind.FINISH)
    client = client_of(world, Role.LEAD)
    told = ["simulated", "finished before the last phase", "changed: goal", "planned days (+3)"]
    for page in (reverse("participant", args=[enrollment.pk]), reverse("study", args=[study.pk])):
        shown = client.get(page).content.decode()
        assert all(f"{words}</span>" in shown for words in told)
        assert "Simulated visits never enter the results" in shown
    results = read_results(study, later)
    assert results.participants[0].visits[0].attendance == "excluded"
    assert not results.occurrences


def test_a_stop_of_a_robot_that_is_off_is_no_harm_and_no_deviation(world):
    study = running_study(world)
    session = study_session(world, study)
    stop = {"session": session, "after_number": 0, "kind": RobotEntry.STOP.value, "at": NOW}
    SessionEvent.everywhere.create(**stop, data={"device": 1, "unasked": "base_silent"})
    assert not propose(study)
    assert not read_results(study, NOW).occurrences
    assert "robot stop</span>" not in page_of(world, study)
    SessionEvent.everywhere.create(**stop, data={"device": 1, "reason": "bump"})
    assert len(propose(study)) == 1
    assert [one.what for one in read_results(study, NOW).occurrences] == ["robot_stop"]
    assert "robot stop</span>" in page_of(world, study)


def page_of(world, study):
    page = reverse("study", args=[study.pk])
    return client_of(world, Role.LEAD).get(page).content.decode()
