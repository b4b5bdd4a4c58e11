"""Clinical tests as outcomes: registered, taken by blinded assessors, analyzed like the others."""

from __future__ import annotations

from datetime import timedelta
from typing import Any

import pytest
from django.core.exceptions import ValidationError
from django.urls import reverse

from rehab.people.models import User
from rehab.people.roles import Role
from rehab.sessions.assessment_results import Assessment
from rehab.sessions.available_tests import ClinicTest
from rehab.sessions.questionnaires import QuestionnaireResponse, ask
from rehab.sessions.setup.protocol_models import Protocol
from rehab.studies.analysis.outcomes import OUTCOMES
from rehab.studies.blinding import Task, give_mark
from rehab.studies.models import Study
from rehab.studies.participants import Enrollment
from rehab.studies.power_runs import build_trial
from rehab.studies.registration.estimands import estimands
from rehab.studies.registration.lifecycle import close, register
from rehab.studies.registration.protocol_pdf import write_pdf
from rehab.studies.results.results import read_results
from rehab.studies.results.tables import outcome_rows
from rehab.training.measures import InvalidSetting
from tests.support.studies import draft_study, enrolled, new_patient, running_study
from tests.support.trials import walk_visit
from tests.support.world import NOW, World, build_world, client_of, signed_in

pytestmark = pytest.mark.django_db
PLAN = {
    "primary_outcome": "10mwt_after",
    "secondary_outcomes": ["10mwt_follow_up", "tug_after"],
    "follow_up_days": 28,
}
BEFORE, AFTER, FOLLOW_UP = -2.0, 1.5, 29.5  # days; the second visit is at day 1


def take(one: Enrollment, by: Any, day: float, value: float, test: str = "10mwt") -> Assessment:
    return Assessment.everywhere.create(
        clinic=one.clinic,
        patient=one.patient,
        test=test,
        value=value,
        at=NOW + timedelta(days=day),
        by=by,
    )


@pytest.fixture
def trial(world: World):
    """Return a running study of six people who walked once, and its assessor."""
    study = running_study(world, **PLAN)
    assessor = User.everywhere.create_user("assessor", role=Role.PT, clinic=world.clinic)
    give_mark(study, assessor, Task.ASSESSOR, None, NOW - timedelta(days=20))
    people = [enrolled(study, new_patient(world, number)) for number in range(1, 7)]
    for one in people:
        walk_visit(one)
    return study, assessor, people


def values_of(study: Study, slug: str) -> dict[str, float]:
    found = (row for row in outcome_rows(read_results(study, NOW)) if row["outcome"] == slug)
    return {row["participant"]: row["value"] for row in found if row["value"] is not None}


def test_a_test_of_an_assessor_is_the_primary_outcome_as_its_change_in_the_window(trial):
    study, assessor, people = trial
    for number, one in enumerate(people):
        faster = 0.3 if one.allocation.group == "B" else 0.1
        take(one, assessor, BEFORE, 0.5 + number / 10)
        take(one, assessor, AFTER, 0.5 + number / 10 + faster + number % 3 / 100)
        take(one, assessor, FOLLOW_UP, 0.5 + number / 10)
    close(study, None, NOW)
    results = read_results(study, NOW)
    found = results.find("10mwt_after")
    assert [arm.participants for arm in found.arms] == [3, 3]
    (pair,) = found.differences
    assert pair.difference.estimate == pytest.approx(0.2, abs=0.02)
    assert [arm.mean.estimate for arm in results.find("10mwt_follow_up").arms] == pytest.approx(
        [0, 0], abs=1e-9
    )
    rows = [row for row in outcome_rows(results) if row["outcome"] == "10mwt_after"]
    of_first = [row for row in rows if row["participant"] == people[0].code and row["value"]]
    assert [(row["visit"], row["unit"], row["baseline"]) for row in of_first] == [(2, "m/s", 0.5)]
    assert "tug_after" in results.registered
    # A test is no walk: visits of which it is all there is stay missed.
    assert sum(arm.visits_walked for arm in results.flow) == 6


@pytest.mark.parametrize(
    ("days", "expected"),
    [
        ((BEFORE, AFTER), 0.3),
        ((-15.0, AFTER), None),  # too long before
        ((AFTER,), None),  # no baseline
        ((BEFORE, 0.2), None),  # of the first visit, after which training goes on
        ((BEFORE, 9.5), None),  # more than a week after the last visit
    ],
)
def test_a_result_counts_in_its_window_alone(trial, days, expected):
    study, assessor, (one, *_others) = trial
    for number, day in enumerate(days):
        take(one, assessor, day, 0.5 + 0.3 * number)
    close(study, None, NOW)
    found = values_of(study, "10mwt_after")
    assert found == ({} if expected is None else {one.code: pytest.approx(expected)})


def test_only_what_an_assessor_recorded_counts_and_nothing_struck_out(trial, world):
    study, assessor, (one, other, *_others) = trial
    for person in (one, other):
        take(person, assessor, BEFORE, 0.5)
    take(one, world.people[Role.PT], AFTER, 0.9)  # who may know the arm
    struck = take(other, assessor, AFTER, 0.9)
    close(study, None, NOW)
    assert values_of(study, "10mwt_after") == {other.code: pytest.approx(0.4)}
    struck.struck_at = NOW
    struck.save()
    assert values_of(study, "10mwt_after") == {}


def test_unit_direction_and_window_are_registered(world):
    study = running_study(world, **PLAN)
    (first, *_others) = estimands(study.versions.get().document)
    assert "assessor" in first["variable"]
    assert "higher is better" in first["variable"]
    units = [OUTCOMES[slug].unit for slug in ("10mwt_after", "tug_after", "berg_after")]
    assert units == ["m/s", "s", "points"]
    better = [OUTCOMES[slug].higher_is_better for slug in ("tug_after", "fma_le_follow_up")]
    assert better == [False, True]
    page = client_of(world, Role.LEAD).get(reverse("study", args=[study.pk]))
    assert b"10-meter walk, comfortable, after training" in page.content


def test_a_questionnaire_that_the_protocol_asks_is_an_outcome(world):
    Protocol.everywhere.filter(clinic=None).update(questionnaires=["sus"])
    study = running_study(world, secondary_outcomes=["sus"])
    one, other = (enrolled(study, new_patient(world, number)) for number in (1, 2))
    for each in (one, other):
        ask(walk_visit(each), ["sus"], NOW)
    asked = QuestionnaireResponse.everywhere.get(session__patient=one.patient)
    assert values_of(study, "sus") == {}
    asked.answers, asked.finished_at = [5, 1] * 5, NOW
    asked.save()
    assert values_of(study, "sus") == {one.code: 100.0}  # read anew, though no session changed


def test_power_says_that_simulated_people_take_no_tests(world):
    study = running_study(world, **PLAN)
    with pytest.raises(InvalidSetting, match="take no clinical tests and answer no questions"):
        build_trial(study, {"effects": {"B": 10.0}})


def test_an_assessor_takes_a_test_and_sees_no_arm(trial):
    _study, assessor, (one, *_others) = trial
    url = reverse("assess", args=[one.patient.pk, "10mwt"])
    client = signed_in(assessor)
    assert b"feedback positive" not in client.get(url).content
    assert client.post(url, {"meters": "10", "measured": "12.5"}).status_code == 302
    assert Assessment.everywhere.get(patient=one.patient).value == pytest.approx(0.8)


@pytest.fixture
def form(world: World):
    ClinicTest.everywhere.all().delete()
    items = "Bends | 0 | 20\nTone | none, some, much\nShoes | text"
    return ClinicTest.everywhere.create(
        clinic=world.clinic, code="knee", name="Knee of ours", items=items, higher_is_better=False
    )


def test_a_form_of_the_clinics_own_is_an_outcome_and_fixed_by_its_registration(world, form):
    study = running_study(world, **PLAN | {"primary_outcome": "own-knee_after"})
    document = study.versions.get().document
    assert [one["slug"] for one in document["tests"]] == ["own-knee"]
    form.refresh_from_db()
    assert form.fixed_at is not None
    form.items = "Bends | 0 | 30"
    with pytest.raises(ValidationError, match="Make a new one"):
        form.full_clean()
    (first, *_others) = estimands(document)
    assert first["variable"].startswith("Knee of ours, after training: Last result of an assessor")
    assert first["variable"].endswith("lower is better. The result is the sum of: Bends; Tone.")
    page = client_of(world, Role.LEAD).get(reverse("study", args=[study.pk]))
    assert b"Knee of ours, after training" in page.content
    assert write_pdf(study)

    assessor = User.everywhere.create_user("assessor", role=Role.PT, clinic=world.clinic)
    give_mark(study, assessor, Task.ASSESSOR, None, NOW - timedelta(days=20))
    people = [enrolled(study, new_patient(world, number)) for number in range(1, 7)]
    for number, one in enumerate(people):
        walk_visit(one)
        less = 6 if one.allocation.group == "B" else 2
        take(one, assessor, BEFORE, 15, "own-knee")
        take(one, assessor, AFTER, 15 - less - number % 2, "own-knee")
    close(study, None, NOW)
    results = read_results(study, NOW)
    (pair,) = results.find("own-knee_after").differences
    assert pair.difference.estimate == pytest.approx(-4, abs=1.1)
    rows = [row for row in outcome_rows(results) if row["outcome"] == "own-knee_after"]
    assert {(row["unit"], row["status"]) for row in rows} == {("points", "primary")}
    page = client_of(world, Role.LEAD).get(reverse("study-results", args=[study.pk]))
    assert b"Knee of ours, after training" in page.content


def test_a_form_that_was_deleted_is_not_registered(world, form):
    study = draft_study(world, **PLAN | {"primary_outcome": "own-knee_after"})
    form.delete()
    study = Study.everywhere.get(pk=study.pk)
    with pytest.raises(InvalidSetting, match="own-knee_after.*is not there any more"):
        register(study, None, NOW)


def test_a_form_is_chosen_among_the_outcomes_of_its_clinic_alone(world, form):
    page = client_of(world, Role.LEAD).get(reverse("new-study"))
    assert b'value="own-knee_follow_up"' in page.content
    page = client_of(build_world("other"), Role.LEAD).get(reverse("new-study"))
    assert b"own-knee" not in page.content
