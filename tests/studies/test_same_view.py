"""Who must not know an arm sees the same whichever it is: every address, opened twice.

Every role, and everything that an assessor can become, opens every address; then the arms are
exchanged, and everybody looks again: at pages, API, exports, file names, boards, reports, replays,
insight, family pages, tablets. tests/studies/test_served_view.py asks a real server's sockets too.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any
from urllib.parse import urlencode

import pytest
from django.http import HttpRequest, HttpResponse
from django.test import Client
from django.urls import path, reverse

from rehab.boards.choices import Participants
from rehab.exports import views
from rehab.people.access import for_roles
from rehab.people.models import Patient, User
from rehab.people.roles import Role
from rehab.sessions.models import TrainingSession
from rehab.studies.blinding import Task, give_mark
from rehab.studies.models import Study
from rehab.studies.results.drawing import FIGURES, TABLES
from rehab.training.valences import VALENCES
from tests.support.archives import body_of, open_archive, words_of
from tests.support.tenancy import add_routes, all_routes
from tests.support.trials import ARMS, LEFT_OUT, Trial, answers, become
from tests.support.world import NOW, World, build_world, signed_in

pytestmark = pytest.mark.django_db
# They have a new secret, code or animal each time, or tell of this very look.
OTHERWISE_EACH_TIME = (
    *("admin:logout", "admin:rehab_patient_add", "api:openapi-view", "add-app"),
    *("own-sign-ins", "problem-report", "tablet"),
)
INTERIM = "researcher who may look"
EXPORTS = ("prepare-research", "advance-research", "download-research")
Found = dict[str, set[str]]


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
    both = urlencode(
        [("of", one.pk) for one in TrainingSession.everywhere.filter(patient__in=patients)]
    )
    yield f"{reverse('side-by-side')}?{both}"
    yield f"{reverse('insight')}?by=patient"
    yield reverse("insight-file")
    for study in Study.everywhere.filter(clinic=world.clinic):
        yield from files_of(study)


def files_of(study: Study) -> Iterator[str]:
    """Return the addresses of what a study found."""
    files = [*(f"{name}.svg" for name in FIGURES), *(f"{name}.csv" for name in TABLES)]
    for file in files:
        yield f"{reverse('study-results-file', args=[study.pk])}?file={file}"


def everybody(trial: Trial) -> dict[str, Client]:
    """Return all who must not know an arm: what an assessor can become, and other roles."""
    actors = become(trial, trial.assessor, trial.earlier)
    clinic, people = trial.world.clinic, trial.world.people
    looking = User.everywhere.create_user("looking", role=Role.RESEARCHER, clinic=clinic)
    give_mark(trial.study, looking, Task.INTERIM, None, NOW)
    others = {
        "researcher": people[Role.RESEARCHER],
        INTERIM: looking,
        "host": User.everywhere.create_user("host", role=Role.HOST),
        "who treats elsewhere": build_world("birch").people[Role.PT],
    }
    for name, user in others.items():
        actors[name] = signed_in(user, raise_request_exception=False)
    for name in ("researcher", INTERIM):
        export(actors[name])
    # What is recorded once: a look of each day, and that a tablet has ended.
    actors[INTERIM].get(reverse("study-results", args=[trial.study.pk]))
    actors["its token"].get(reverse("tablet-state"))
    return actors | {"stranger": Client(raise_request_exception=False)}


def export(client: Client) -> None:
    """Have the export for analysis made, as each look does again by its POSTs."""
    client.post(reverse("prepare-research"))
    reached = client.post(reverse("advance-research")).json()
    assert reached["done"] == reached["total"]


@pytest.fixture(autouse=True)
def patience(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let an export be made in one call."""
    monkeypatch.setattr(views, "SECONDS_OF_A_CALL", 600)


def find_differences(trial: Trial, actors: dict[str, Client], urls: Sequence[str] = ()) -> Found:
    """Return who is answered otherwise once the arms are exchanged, and where."""
    before = answers(trial, actors, urls)
    trial.exchange()
    after = answers(trial, actors, urls)
    assert before.keys() == after.keys()
    found: Found = {}
    for (name, _, url), answer in before.items():
        if after[name, _, url] != answer:
            print(name, url, answer, after[name, _, url], sep="\n")
            found.setdefault(name, set()).add(url)
    return found


def whole_site(trial: Trial) -> list[str]:
    """Return every address but those that answer otherwise each time."""
    left_out = {reverse(name) for name in OTHERWISE_EACH_TIME}
    return [url for url in addresses(trial.world, trial.patients) if url not in left_out]


STATES = {"open": {"ended": False}, "ended": {}, "withdrawn": {"withdrawn": True}}


@pytest.mark.long
@pytest.mark.timeout(1200)
@pytest.mark.parametrize("state", STATES)
def test_who_must_not_know_an_arm_sees_the_same_whichever_is_walked(state):
    trial = Trial(**STATES[state])
    actors = everybody(trial)
    assert find_differences(trial, actors, whole_site(trial)) == {}


@pytest.mark.wide
@pytest.mark.parametrize("withdrawn", [False, pytest.param(True, marks=pytest.mark.long)])
def test_an_assessors_previews_of_boards_are_the_same(monkeypatch, withdrawn):
    monkeypatch.setitem(globals(), "all_routes", lambda worlds: [])
    trial = Trial(withdrawn=withdrawn)
    account = signed_in(trial.assessor, raise_request_exception=False)
    previews = whole_site(trial)
    assert find_differences(trial, {"account": account}, previews) == {}
    for url in previews:
        assert "seen_as" not in url or "No board yet" not in words_of(account.get(url)), url


@pytest.mark.parametrize("ended", [False, pytest.param(True, marks=pytest.mark.long)])
def test_whatever_an_assessor_becomes_sees_the_same(ended):
    trial = Trial(ended=ended)
    assert find_differences(trial, become(trial, trial.assessor, trial.earlier)) == {}


@pytest.mark.parametrize(
    "rule",
    [
        rule if rule == "a sign-in ends" else pytest.param(rule, marks=pytest.mark.long)
        for rule in LEFT_OUT
    ],
)
def test_a_rule_that_is_left_out_is_found(monkeypatch, rule):
    trial = Trial()
    module, name, left_out, found = LEFT_OUT[rule]
    monkeypatch.setattr(module, name, left_out)
    actors = become(trial, trial.assessor, trial.earlier)
    assert find_differences(trial, actors).keys() == found


def test_an_interim_look_tells_nobodys_group():
    """Of three and three it shows figures, and the same ones once everybody is in the other."""
    trial = Trial(pairs=3)
    client = everybody(trial)[INTERIM]
    results = reverse("study-results", args=[trial.study.pk])
    urls = [results, *files_of(trial.study), reverse("study", args=[trial.study.pk])]
    urls += [reverse(name) for name in (*EXPORTS, "export-sessions", "export")]
    assert find_differences(trial, {INTERIM: client}, urls) == {}
    files = open_archive(body_of(client.get(reverse("download-research"))))
    for kind in ("fhir/", ".parquet", "protocol.json", "_motion.json"):
        assert any(kind in name for name in files), kind
    for url in (results, f"{results}download/?file=differences.csv"):
        words = words_of(client.get(url))
        assert "Group 1" in words
        assert not any(secret in words for secret in (*ARMS, "VAL-0")), url


def test_a_new_address_is_opened_too(settings):
    """Whatever it names a row of, the trial has one for each arm; else `all_routes` fails."""

    @for_roles(Role.PT)
    def show(request: HttpRequest, session_id: int) -> HttpResponse:
        return HttpResponse(TrainingSession.everywhere.get(pk=session_id).valence)

    add_routes(settings, path("new/<int:session_id>/", show, name="new"))
    trial = Trial()
    urls = [url for url in whole_site(trial) if url.startswith("/new/")]
    account = {"account": signed_in(trial.assessor)}
    leaky = {f"/new/{session.pk}/" for session in trial.sessions}
    assert find_differences(trial, account, urls) == {"account": leaky}


@pytest.mark.long
def test_who_treats_sees_which_arm_is_walked():
    """So the search finds what there is."""
    trial = Trial()
    who = signed_in(trial.world.people[Role.PT], raise_request_exception=False)
    found = find_differences(trial, {"who treats": who}, whole_site(trial))["who treats"]
    session = trial.sessions[0].pk
    for url in (reverse("session", args=[session]), reverse("api:show_session", args=[session])):
        assert url in found
    assert any("leaderboard/preview" in url for url in found)
