"""A sponsor sees a study's figures, over all arms together, and no person."""

from __future__ import annotations

import re
from datetime import timedelta

import pytest
from django.test import Client
from django.urls import reverse

from rehab.people.models import User
from rehab.people.roles import Role
from rehab.studies.models import Study
from rehab.studies.record.adverse_events import AdverseEvent, Grade, Relation
from rehab.studies.registration.lifecycle import close
from rehab.studies.screening import turn_away
from tests.support.marks import mark
from tests.support.studies import draft_study, enrolled, new_patient, running_study, text_of
from tests.support.trials import walk_visit
from tests.support.world import NOW, World, build_world, client_of, scoped_models, signed_in

pytestmark = pytest.mark.django_db


@pytest.fixture
def sponsor(world: World) -> Client:
    return signed_in(User.everywhere.create_user("payer", role=Role.SPONSOR, clinic=world.clinic))


@pytest.fixture
def study(world: World) -> Study:
    """Return a running study: three took part, one of them walked and was harmed; one declined."""
    study = running_study(world)
    people = [enrolled(study, new_patient(world, number)) for number in (1, 2, 3)]
    walk_visit(people[0])
    AdverseEvent.everywhere.create(
        enrollment=people[0],
        what="Fell at home",
        grade=Grade.SEVERE,
        serious=True,
        relation=Relation.NONE,
        at=NOW - timedelta(days=2),
    )
    turn_away(study, new_patient(world, 4), unmet=(), declined=True, by=None, now=NOW)
    return study


def figures_of(client: Client, study: Study) -> str:
    page = text_of(client.get(reverse("study-figures", args=[study.pk])))
    return " ".join(re.sub(r"<[^>]*>", " ", page).split())


def test_it_counts_people_visits_and_harms_and_names_nobody(world, study, sponsor):
    page = figures_of(sponsor, study)
    for words in (
        "Planned 20 Assessed 4 Not eligible 0 Declined 1 Enrolled 3 Left the study 0",
        "Walked 1 Ended early 0",
        "Adverse events that were judged 1 Serious 1 Serious, not reported yet 1",
        "What the study found is shown here once it is closed.",
    ):
        assert words in page
    told = [one.code for one in study.enrollments.all()] + ["Fell at home", "feedback positive"]
    told += [mark("amber", model) for model in scoped_models() if model.__name__ == "Patient"]
    assert not [words for words in told if words in page]


def test_what_was_found_is_shown_once_the_study_is_closed(world, study, sponsor):
    close(study, None, NOW)
    page = figures_of(sponsor, study)
    assert "Registered outcomes" in page
    assert "feedback positive" in page
    assert not [one.code for one in study.enrollments.all() if one.code in page]


def test_a_sponsor_opens_nothing_else(world, study, sponsor):
    whose = study.enrollments.first()
    refused = {
        "study": [study.pk],
        "study-results": [study.pk],
        "study-harms": [study.pk],
        "participant": [whose.pk],
        "start": [],
        "patient": [whose.patient_id],
        "insight": [],
        "export": [],
        "admin:rehab_patient_changelist": [],
        "admin:rehab_trainingsession_changelist": [],
        "admin:rehab_leaderboard_changelist": [],
    }
    for name, of in refused.items():
        assert sponsor.get(reverse(name, args=of)).status_code == 403, name
    page = text_of(sponsor.get(reverse("studies")))
    assert study.code in page
    assert "Leaderboards" not in page
    elsewhere = build_world("birch")
    other = running_study(elsewhere)
    draft = draft_study(world, code="LATER")
    for hidden, status in ((other, 404), (draft, 403)):
        url = reverse("study-figures", args=[hidden.pk])
        assert sponsor.get(url).status_code == status


def test_who_treats_does_not_see_them(world, study):
    url = reverse("study-figures", args=[study.pk])
    assert client_of(world, Role.PT).get(url).status_code == 403
    assert client_of(world, Role.RESEARCHER).get(url).status_code == 200
