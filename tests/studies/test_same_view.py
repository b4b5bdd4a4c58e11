"""Who must not know an arm sees the same whichever it is: every address, opened twice."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any
from urllib.parse import urlencode

import pytest
from django.test import Client
from django.urls import reverse

from rehab.boards.choices import Participants
from rehab.people.models import Patient, User
from rehab.people.roles import Role
from rehab.training.valences import VALENCES
from tests.support.archives import words_of
from tests.support.tenancy import all_routes
from tests.support.trials import LEFT_OUT, VARYING, Trial, answers, become
from tests.support.world import World, signed_in

pytestmark = pytest.mark.django_db
# They have a new secret, code or animal each time, or tell of this very look.
OTHERWISE_EACH_TIME = (
    *("admin:logout", "admin:rehab_patient_add", "api:openapi-view", "add-app"),
    *("own-sign-ins", "tablet"),
)


def addresses(world: World, patients: list[Patient]) -> Iterator[str]:
    """Return every address of the site, and previews of boards that single a condition out."""
    yield from dict.fromkeys(route.url for route in all_routes((world,)))
    preview = reverse("admin:rehab_leaderboard_preview")
    everybody = Patient.everywhere.filter(clinic=world.clinic).order_by("pk")
    group = list(everybody.values_list("pk", flat=True))
    for among in (Participants.SELF, Participants.GROUP, Participants.CLINIC):
        for valence in VALENCES:
            asked: dict[str, Any] = {
                "name": "b",
                "among": among,
                "group": group,
                "metric": "hit_rate",
                "types": "chosen",
                "valences": valence,
                "aggregation": "each" if among == Participants.SELF else "best",
                "period": "all",
                "display": "top",
                "top_n": 10,
                "names": "code",
                "min_participants": 5,
                "ties": "standard",
                "occasion": "after_session",
                "min_valid_strides": 1,
                "mean_of": 3,
                "show_ranks": "on",
                "active": "on",
                "higher_is_better": "on",
            }
            for patient in patients:
                yield f"{preview}?{urlencode(asked | {'seen_as': patient.pk}, doseq=True)}"
    for patient in patients:
        yield f"{reverse('api:list_sessions')}?patient={patient.pk}"
    yield f"{reverse('insight')}?by=patient"
    yield reverse("insight-file")


def see_everything(world: World, who: User, patients: list[Patient]) -> dict[str, str]:
    """Return what every address answers somebody, without what differs each time."""
    browser = signed_in(who, raise_request_exception=False)
    left_out = {reverse(name) for name in OTHERWISE_EACH_TIME}
    seen = {}
    for url in addresses(world, patients):
        if url not in left_out:
            answer = browser.get(url)
            words = words_of(answer)
            assert answer.status_code < 500 or "readyz" in url, url
            assert "seen_as" not in url or "No board yet" not in words, url
            seen[url] = f"{answer.status_code} {VARYING.sub('', words)}"
    return seen


def find_leaks(trial: Trial, who: User, tablet: Client) -> set[str]:
    """Return what somebody has become that is answered otherwise once the arms are exchanged."""
    actors = become(trial, who, tablet)
    before = answers(trial, actors)
    trial.exchange()
    after = answers(trial, actors)
    return {key[0] for key, answer in before.items() if after[key] != answer}


def find_differences(trial: Trial, who: User) -> list[str]:
    """Return the addresses that answer somebody otherwise once the arms are exchanged."""
    before = see_everything(trial.world, who, trial.patients)
    trial.exchange()
    after = see_everything(trial.world, who, trial.patients)
    assert before.keys() == after.keys()
    return [url for url, answer in before.items() if after[url] != answer]


@pytest.mark.long
@pytest.mark.parametrize("withdrawn", [False, True])
def test_an_assessor_sees_the_same_whichever_arm_is_walked(withdrawn):
    trial = Trial(withdrawn=withdrawn)
    assert find_differences(trial, trial.assessor) == []


@pytest.mark.wide
@pytest.mark.parametrize("withdrawn", [False, True])
def test_an_assessors_previews_of_boards_are_the_same(monkeypatch, withdrawn):
    monkeypatch.setitem(globals(), "all_routes", lambda worlds: [])
    trial = Trial(withdrawn=withdrawn)
    assert find_differences(trial, trial.assessor) == []


@pytest.mark.parametrize("ended", [False, True])
def test_whatever_an_assessor_becomes_sees_the_same(ended):
    trial = Trial(ended=ended)
    assert find_leaks(trial, trial.assessor, trial.earlier) == set()


@pytest.mark.parametrize("rule", LEFT_OUT)
def test_a_rule_that_is_left_out_is_found(monkeypatch, rule):
    trial = Trial()
    module, name, left_out, found = LEFT_OUT[rule]
    monkeypatch.setattr(module, name, left_out)
    assert find_leaks(trial, trial.assessor, trial.earlier) == found


@pytest.mark.long
def test_who_treats_sees_which_arm_is_walked():
    """So the search finds what there is."""
    trial = Trial(withdrawn=False)
    found = find_differences(trial, trial.world.people[Role.PT])
    session = trial.sessions[0].pk
    for url in (reverse("session", args=[session]), reverse("api:show_session", args=[session])):
        assert url in found
    assert any("leaderboard/preview" in url for url in found)
