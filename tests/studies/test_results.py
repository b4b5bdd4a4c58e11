"""Results of studies: by the real path what the fold gives, told to whom they may be told."""

from __future__ import annotations

import asyncio
from datetime import timedelta

import pytest
from django.db import connection
from django.test.utils import CaptureQueriesContext
from django.urls import reverse

from rehab.exports.research.resumable_export import sessions_for
from rehab.people.audit.audit_log import Act, AuditEntry
from rehab.people.models import Clinic
from rehab.people.roles import Role
from rehab.sessions.live.headless import (
    GIVE_WAY_S,
    Pace,
    run_session,
    simulate_strides,
)
from rehab.sessions.log import SessionMetric
from rehab.sessions.models import TrainingSession
from rehab.sources.synthetic import GOOD, SyntheticWalker
from rehab.studies.allocation.scheme import Secret
from rehab.studies.blinding import Task, give_mark
from rehab.studies.models import Arm, Study
from rehab.studies.registration.allocation_secret import seal
from rehab.studies.registration.lifecycle import close, register, start
from rehab.studies.results.drawing import FIGURES, TABLES, write_table
from rehab.studies.results.results import label_arms, read_results
from rehab.studies.results.tables import HEADERS
from rehab.studies.simulation.example import example_trial
from rehab.studies.simulation.study import find_or_plan
from rehab.studies.simulation.study import walk_study as study_walks
from rehab.studies.simulation.trial import simulate
from rehab.studies.simulation.walkers import Population
from rehab.studies.visits import Place, start_session
from rehab.training.measures import InvalidSetting
from rehab.training.plans import SessionPlan
from rehab.training.schedules import Schedule, ScheduleKind
from rehab.training.steps import Side
from tests.support.simulated_studies import figures_of, walk_study
from tests.support.studies import SEED, draft_study, enrolled, new_patient, running_study, text_of
from tests.support.world import NOW, client_of

pytestmark = pytest.mark.django_db


@pytest.mark.wide
@pytest.mark.django_db(transaction=True)  # the writer has its own connection
def test_three_seeds_by_the_real_path_agree_with_the_fold_to_the_last_digit():
    trial = example_trial(4, visits=2, population=Population(dropout=0.2))
    for seed in (1, 2, 3):
        results = walk_study(trial, seed)
        assert figures_of(results.participants) == figures_of(simulate(trial, seed))


@pytest.mark.wide
@pytest.mark.django_db(transaction=True)
def test_a_simulated_study_goes_on_where_it_was_broken_off_and_writes_the_same_files():
    trial = example_trial(4)
    one, other = (Clinic.everywhere.create(name=name) for name in ("one", "other"))
    study = find_or_plan(one, trial, 5, NOW)
    next(study_walks(study, trial, 5, NOW))  # the first participant, then the power fails
    broken, whole = walk_study(trial, 5, one.name), walk_study(trial, 5, other.name)
    assert broken.study.enrollments.count() == 4
    for name, draw in FIGURES.items():
        assert draw(broken) == draw(whole), name
    for name, rows in TABLES.items():
        assert write_table(rows(broken)) == write_table(rows(whole)), name
    with pytest.raises(InvalidSetting, match="has 4 participants"):
        find_or_plan(one, example_trial(8), 5, NOW)


@pytest.mark.django_db(transaction=True)
def test_a_simulated_study_leaves_the_database_to_a_server_between_its_batches():
    trial = example_trial(4)
    study = find_or_plan(Clinic.everywhere.create(name="busy"), trial, 5, NOW)
    rests: list[float] = []

    async def sleep(seconds: float) -> None:
        rests.append(seconds)

    for _done in study_walks(study, trial, 5, NOW, Pace(rest_s=GIVE_WAY_S, sleep=sleep)):
        pass
    assert rests == [GIVE_WAY_S] * len(rests)
    assert len(rests) >= 4  # a session each, at least


@pytest.mark.django_db(transaction=True)
def test_only_who_changed_is_read_again():
    first = walk_study(example_trial(4), 6)
    study = first.study

    def read():
        return read_results(Study.everywhere.get(pk=study.pk), NOW)

    with CaptureQueriesContext(connection) as asked:
        again = read()
    assert again.analysis is first.analysis
    assert not [query for query in asked if "rehab_step" in query["sql"]]
    one, *others = study.enrollments.order_by("pk")
    TrainingSession.everywhere.filter(study_visit__enrollment=one).update(excluded=True)
    corrected = read()
    assert not corrected.participants[0].visits[0].is_walked
    for before, now in zip(first.participants[1:], corrected.participants[1:], strict=True):
        assert before is now
    TrainingSession.everywhere.filter(study_visit__enrollment=one).update(excluded=False)
    assert figures_of(read().participants) == figures_of(first.participants)
    type(one).everywhere.filter(pk=others[0].pk).update(withdrawn_at=NOW, keep_data=False)
    left = read().participants[1]
    assert (left.has_left, left.is_analyzed, left.visits[0].is_walked) == (True, False, False)
    SessionMetric.everywhere.filter(session__study_visit__enrollment=others[1]).update(value=0.5)
    [visit] = read().participants[2].visits
    assert visit.outcomes["hit_rate"] == 0.5


@pytest.mark.django_db(transaction=True)
def test_a_session_that_ended_early_counts_as_far_as_it_was_walked(world):
    study = running_study(world)
    session = start_session(enrolled(study, new_patient(world)), Place(), None, NOW)
    walker = SyntheticWalker(GOOD, 1, Side.LEFT)

    def some_strides(fold):
        yield from simulate_strides(walker, fold, 150)
        raise ConnectionAbortedError

    with pytest.raises(ConnectionAbortedError):
        asyncio.run(run_session(session.pk, some_strides, Pace()))
    session.refresh_from_db()
    assert session.state == "aborted"
    [one] = read_results(study, NOW).participants
    first = one.visits[0]
    assert first.attendance == "unfinished"
    assert first.outcomes["training_change"] == pytest.approx(
        first.outcomes["improvement_over_baseline"]
    )
    assert "washout_change" not in first.outcomes
    results = read_results(study, NOW)
    assert sum(row.visits_unfinished for row in results.flow) == 1
    assert sum(row.completed for row in results.flow) == 0
    assert "1 session ended early" in FIGURES["flow"](results)
    assert {row["attendance"] for row in TABLES["phases"](results)} == {"unfinished"}


def test_a_name_of_an_arm_is_no_formula_in_a_table():
    told = write_table([{"arm": "A: =1+1", "why": "x;=1+1"}, {"arm": "\r＝1", "why": None}])
    assert told == "arm,why\r\nA: =1+1,x;'=1+1\r\n\"'\r'＝1\",\r\n"


@pytest.mark.django_db(transaction=True)
def test_a_table_without_rows_has_the_heading_of_one_with_rows():
    results = walk_study(example_trial(4), 7)
    for name, header in HEADERS.items():
        rows = list(TABLES[name](results)) if name in TABLES else []
        assert write_table(rows, header).startswith(",".join(list(rows[0]) if rows else header))
        assert not rows or set(rows[0]) == set(header), name


# --- who may look ---------------------------------------------------------------------------------


def test_before_the_end_only_the_marked_look_and_each_look_is_recorded(world):
    study = running_study(world)
    enrolled(study, new_patient(world))
    url = reverse("study-results", args=[study.pk])
    for role in (Role.LEAD, Role.PT, Role.RESEARCHER):
        assert client_of(world, role).get(url).status_code == 403
    give_mark(study, world.people[Role.RESEARCHER], Task.INTERIM, None, NOW)
    researcher = client_of(world, Role.RESEARCHER)
    page = text_of(researcher.get(url))
    assert "this look is recorded" in page
    assert "Group 1" in page
    assert "positive" not in page.lower()
    assert "negative" not in page.lower()
    told = researcher.get(reverse("study-results-file", args=[study.pk]), {"file": "flow.csv"})
    assert "positive" not in text_of(told).lower()
    assert AuditEntry.everywhere.filter(act=Act.EXPORT, about="VAL flow.csv").count() == 1
    assert study.events.filter(kind="looked").count() == 1  # a day
    for role in (Role.LEAD, Role.PT):
        assert client_of(world, role).get(url).status_code == 403


@pytest.mark.django_db(transaction=True)
def test_before_the_end_a_look_shows_aggregates_alone_that_lead_to_no_arm(world):
    trial = example_trial(8)
    clinic = world.clinic
    study = find_or_plan(clinic, trial, 5, NOW)
    for _done in study_walks(study, trial, 5, NOW):
        pass
    reader = world.people[Role.RESEARCHER]
    give_mark(study, reader, Task.INTERIM, None, NOW)
    client = client_of(world, Role.RESEARCHER)
    # Whoever could read a session's type and figures could tell which group is which arm.
    of_study = {"study_visit__enrollment__study": study}
    assert not TrainingSession.objects.visible_to(reader).filter(**of_study).exists()
    assert not sessions_for(reader, study).exists()
    file = reverse("study-results-file", args=[study.pk])
    for name in ("outcomes.csv", "phases.csv", "curves.csv", "occurrences.csv"):
        assert client.get(file, {"file": name}).status_code == 403
    for name in ("primary.svg", "learning.svg", "exploratory.svg"):
        assert client.get(file, {"file": name}).status_code == 403
    codes = set(study.enrollments.values_list("code", flat=True))
    page = text_of(client.get(reverse("study-results", args=[study.pk])))
    for name in ("differences.csv", "flow.csv", "conduct.csv", "changes.csv"):
        page += text_of(client.get(file, {"file": name}))
    assert not [code for code in codes if code in page]
    # Two people in a group are no aggregate, and points tell the feedback type.
    assert all(mean is None for mean in means_of(read_results(study, NOW)))
    close(study, None, NOW)
    for name in ("outcomes.csv", "primary.svg"):
        assert client.get(file, {"file": name}).status_code == 200
    assert any(means_of(read_results(study, NOW)))


def means_of(results):
    return [one.mean for slug in results.registered for one in results.find(slug).arms]


def test_before_the_end_no_figure_is_shown_that_tells_the_feedback_type(world):
    outcomes = {"primary_outcome": "score", "secondary_outcomes": ["hit_rate"]}
    study = draft_study(world, **outcomes)
    study.arms.filter(code="B").update(valence="positive", gain=0.9)
    register(study, None, NOW)
    start(study, None, NOW)
    assert list(read_results(study, NOW).registered) == ["hit_rate"]
    close(study, None, NOW)
    assert list(read_results(study, NOW).registered) == ["score", "hit_rate"]


def test_groups_are_numbered_by_the_sealed_seed_until_the_study_is_closed(world):
    sealed = seal(Secret(SEED, (4, 8)))
    study = running_study(world, "positive", "negative", "binary", "explicit", sealed=sealed)
    labels = label_arms(study)
    assert sorted(labels.values()) == [f"Group {number}" for number in (1, 2, 3, 4)]
    assert list(labels) != ["A", "B", "C", "D"]  # of the tests' own seed
    close(study, None, NOW)
    assert label_arms(study)["A"] == "A: feedback positive"


def test_of_a_closed_study_everybody_sees_names_registered_outcomes_first(world):
    study = running_study(world, secondary_outcomes=["late_change"])
    enrolled(study, new_patient(world))
    close(study, None, NOW)
    for role in (Role.LEAD, Role.PT, Role.RESEARCHER):
        page = text_of(client_of(world, role).get(reverse("study-results", args=[study.pk])))
        assert "feedback positive" in page
        assert page.index("Change in washout") < page.index("Late change")
    assert study.events.filter(kind="looked").count() == 0
    client = client_of(world, Role.LEAD)
    for name in ("outcomes.csv", "learning.svg"):
        answer = client.get(reverse("study-results-file", args=[study.pk]), {"file": name})
        assert answer["Content-Disposition"] == f'attachment; filename="VAL-{name}"'
    for name in ("learning.csv", "outcomes.svg", "../flow.csv", "learning"):
        answer = client.get(reverse("study-results-file", args=[study.pk]), {"file": name})
        assert answer.status_code == 404


def test_visits_that_are_due_and_those_that_are_not_are_told_apart(world):
    study = running_study(world)
    enrolled(study, new_patient(world))
    assert sum(one.visits_planned for one in read_results(study, NOW).flow) == 1
    later = read_results(study, NOW + timedelta(days=1)).flow
    assert sum(one.visits_planned for one in later) == 2
    close(study, None, NOW)
    assert sum(one.visits_planned for one in read_results(study, NOW).flow) == 2


# --- the schedule of an arm -----------------------------------------------------------------------


def test_an_arms_schedule_is_registered_and_walked(world):
    study = draft_study(world, "positive", "positive")
    Arm.everywhere.filter(study=study, code="B").update(schedule="summary", schedule_steps=5)
    version = register(study, None, NOW)
    assert "schedule" not in version.document["arms"][0]
    assert version.document["arms"][1]["schedule"]["interval"] == 5
    start(study, None, NOW)
    for number in range(2):
        enrollment = enrolled(study, new_patient(world, number))
        session = start_session(enrollment, Place(), None, NOW)
        schedule = SessionPlan.from_json(session.plan).schedule
        summary = Schedule(ScheduleKind.SUMMARY, 5)
        expected = summary if enrollment.allocation.group == "B" else Schedule()
        assert schedule == expected
    lead = client_of(world, Role.LEAD)
    assert "summary of 5 steps" in text_of(lead.get(reverse("study", args=[study.pk])))
    told = lead.get(reverse("study-protocol-pdf", args=[study.pk])).content.decode("latin-1")
    assert "summary" in told
