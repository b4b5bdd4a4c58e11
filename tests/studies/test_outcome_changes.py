"""Outcomes that are changed later: the first registered one stays first, the change is told."""

from __future__ import annotations

import csv
import io
import json
from datetime import timedelta
from itertools import pairwise

import pytest
from django.urls import reverse

from rehab.people.roles import Role
from rehab.studies.models import Study
from rehab.studies.registration.lifecycle import close, revise
from rehab.studies.results.results import note_look, read_results
from tests.support.studies import enrolled, new_patient, running_study
from tests.support.world import NOW, World, client_of

pytestmark = pytest.mark.django_db
WHY = "The washout was too short to tell."
FIRST, LATER = "washout_change", "improvement_over_baseline"


def switched_study(world: World) -> Study:
    """Return a study whose primary outcome was changed after three participants and one look."""
    study = running_study(world, primary_outcome=FIRST, secondary_outcomes=["hit_rate"])
    for number in range(3):
        enrolled(study, new_patient(world, number))
    note_look(read_results(study, NOW), world.people[Role.RESEARCHER], NOW)
    study.primary_outcome, study.secondary_outcomes = LATER, ["late_change"]
    revise(study, WHY, world.people[Role.LEAD], NOW + timedelta(hours=1))
    enrolled(study, new_patient(world, 9), now=NOW + timedelta(hours=2))
    note_look(read_results(study, NOW), world.people[Role.RESEARCHER], NOW + timedelta(days=1))
    close(study, None, NOW + timedelta(days=2))
    return study


def rows_of(client, study, name):
    answer = client.get(reverse("study-results-file", args=[study.pk]), {"file": name})
    return list(csv.DictReader(io.StringIO(answer.content.decode())))


def test_the_first_registered_primary_is_reported_first_and_the_change_stands_beside_it(world):
    study = switched_study(world)
    client = client_of(world, Role.LEAD)
    page = client.get(reverse("study-results", args=[study.pk])).content.decode()
    assert WHY in page
    assert "after 3 participants and 1 look" in page
    table = page[page.index('aria-label="Outcomes as a table"') :]
    order = ("Change in washout", "Improvement over baseline", "Hit rate", "Late change")
    assert all(a < b for a, b in pairwise(table.index(words) for words in order))
    assert "primary since version 2" in table
    rows = rows_of(client, study, "outcomes.csv")
    told = {row["outcome"]: (row["status"], row["since_version"]) for row in rows}
    assert told[FIRST] == ("primary", "1")
    assert told[LATER] == ("later primary", "2")
    assert told["hit_rate"] == ("secondary", "1")
    assert told["late_change"] == ("later secondary", "2")
    [change] = rows_of(client, study, "changes.csv")
    assert change["reason"] == WHY
    assert (change["primary_before"], change["primary_after"]) == (FIRST, LATER)
    assert (change["participants_before"], change["looks_before"]) == ("3", "1")
    assert {row["primary_outcome"] for row in rows_of(client, study, "flow.csv")} == {FIRST}
    figure = client.get(reverse("study-results-file", args=[study.pk]), {"file": "primary.svg"})
    assert "Change in washout" in figure.content.decode()


def test_the_change_stands_in_the_registered_document_on_paper_and_as_data(world):
    study = switched_study(world)
    client = client_of(world, Role.LEAD)
    paper = client.get(reverse("study-protocol-pdf", args=[study.pk])).content.decode("latin-1")
    assert "after 3 participants and 1 look" in " ".join(paper.split())
    data = json.loads(client.get(reverse("study-protocol", args=[study.pk])).content)
    [change] = data["outcome_changes"]
    assert (change["version"], change["looks_before"]) == (2, 1)
    page = client.get(reverse("study", args=[study.pk])).content.decode()
    assert "<dt>Primary outcome</dt> <dd>Change in washout</dd>" in " ".join(page.split())
    assert "after 3 participants and 1 look" in page


def test_a_version_that_changes_no_outcome_is_no_change_of_outcomes(world):
    study = running_study(world, primary_outcome=FIRST)
    study.participants += 2
    revise(study, "More time.", None, NOW)
    close(study, None, NOW)
    client = client_of(world, Role.LEAD)
    assert rows_of(client, study, "changes.csv") == []
