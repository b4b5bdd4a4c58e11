"""Who must not know an arm sees the same whichever it is: every address, opened twice."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any
from urllib.parse import urlencode

import pytest
from django.test import Client
from django.urls import reverse
from django.utils import timezone

from rehab.boards.cache import clear_cache
from rehab.boards.choices import Participants
from rehab.people.audit import guards
from rehab.people.consent import models as consents
from rehab.people.consent.models import Purpose
from rehab.people.consent.services import record_consent
from rehab.people.models import Patient, User
from rehab.people.roles import Role
from rehab.people.sign_in.tokens import ApiToken
from rehab.sessions.live.session.aggregate import SessionAggregate
from rehab.sessions.log import SessionEvent, SessionMetric, Step
from rehab.sessions.models import TrainingSession
from rehab.stations import device_trust
from rehab.stations.models import Station
from rehab.stations.tablets import COOKIE, find_tablet
from rehab.studies.allocation.scheme import Secret
from rehab.studies.enrolling import withdraw
from rehab.studies.participants import Allocation, Enrollment, StudyEvent, StudyVisit
from rehab.studies.registration.sealing import seal
from rehab.studies.unblinding import Task, give_mark
from rehab.studies.visits import Place, start_session
from rehab.training.changes import Change, ChangeKind
from rehab.training.steps import Measurement, Side
from rehab.training.valences import VALENCES
from tests.support.archives import words_of
from tests.support.studies import SEED, enrolled, new_patient, running_study
from tests.support.tablets import pair_tablet
from tests.support.tenancy import all_routes
from tests.support.world import NOW, World, build_world, fill_board, signed_in, store

pytestmark = pytest.mark.django_db
ARMS = ("positive", "negative")
# They have a new secret, code or animal each time, or tell of this very look.
OTHERWISE_EACH_TIME = (
    *("admin:logout", "admin:rehab_patient_add", "api:openapi-view", "add-app"),
    *("own-sign-ins", "tablet"),
)
# What differs each time, whatever a patient walks.
VARYING = re.compile(
    r'csrfmiddlewaretoken" value="\w+"|nonce="[^"]+"|"data-csrf": "\w+"|\d{1,2}:\d\d(:\d\d)?|'
    r'"?\d{4}-\d\d-\d\d[T ][^"<]*'
)


def walk_visit(
    enrollment: Enrollment, station: Station | None = None, *, ended: bool = True
) -> TrainingSession:
    """Let a participant walk the next visit's session, to its end unless that is to come."""
    session = start_session(enrollment, Place(station=station), None, NOW)
    aggregate = SessionAggregate(session)
    store(aggregate, aggregate.change(Change(ChangeKind.START), None, NOW))
    for phase in range(3):
        for number in range(60 * phase + 1, 60 * phase + 61):
            stride = Measurement(number, number * 1.1, Side.LEFT, 1.0 + number % 5 / 10)
            store(aggregate, [aggregate.record_step(stride, NOW)])
        if phase < 2:
            store(aggregate, aggregate.change(Change(ChangeKind.PHASE, phase + 1), None, NOW))
    if ended:
        store(aggregate, aggregate.change(Change(ChangeKind.FINISH), None, NOW))
    session.refresh_from_db()
    return session


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


class Trial:
    """A running study with a participant of each arm, who have walked the same steps."""

    def __init__(self, *, withdrawn: bool = False, ended: bool = True) -> None:
        self.world = world = build_world("amber")
        fill_board(world)
        self.study = running_study(world, *ARMS, sealed=seal(Secret(SEED, (2,))))
        self.assessor = User.everywhere.create_user("zz", role=Role.PT, clinic=world.clinic)
        self.stations = [world.add_station(name) for name in ("Bay 1", "Bay 2")]
        self.earlier = pair_tablet(signed_in(self.assessor), self.stations[0])
        give_mark(self.study, self.assessor, Task.ASSESSOR, None, NOW)
        self.patients = [new_patient(world, number) for number in (1, 2)]
        self.sessions = []
        for patient, station in zip(self.patients, self.stations, strict=True):
            patient.boards = "clinic"
            patient.save()
            record_consent(patient, Purpose.BOARDS, None, NOW, "clinic")
            enrollment = enrolled(self.study, patient)
            self.sessions.append(walk_visit(enrollment, station, ended=ended))
            if withdrawn:
                withdraw(enrollment, None, NOW)
            world.more += [patient, enrollment, self.sessions[-1]]
        assert {session.valence for session in self.sessions} == set(ARMS)
        world.more.append(self.study)
        for model in (Allocation, StudyVisit, StudyEvent, Step, SessionEvent, SessionMetric):
            world.more.append(model.everywhere.order_by("-pk").first())

    def exchange(self) -> None:
        """Let each participant have walked what the other one has."""
        one, other = self.sessions
        exchange([one], [other], {"patient_id", "created_at", "station_id"})
        for model in (Step, SessionEvent, SessionMetric):
            rows = model.everywhere.order_by("pk")
            exchange(
                list(rows.filter(session=one)), list(rows.filter(session=other)), {"session_id"}
            )
        allocations = Allocation.everywhere.filter(enrollment__study=self.study).order_by("pk")
        exchange(list(allocations[:1]), list(allocations[1:]), {"enrollment_id"})
        clear_cache()

    def addresses(self) -> list[str]:
        """Return the addresses of what the participants walked, and of their stations' tablets."""
        keys = "|".join(str(session.pk) for session in self.sessions)
        found = [route.url for route in all_routes((self.world,))]
        own = [url for url in found if re.search(rf"(sessions|trainingsession)/({keys})/", url)]
        lists = ("api:list_sessions", "tablet-state", "waiting-board", "start")
        return [*dict.fromkeys(own), *(reverse(name) for name in lists)]


def program_of(user: User, role: Role) -> Client:
    """Return a program that an account has given a token that may do everything."""
    row = ApiToken(clinic=user.clinic, user=user, name=f"as {role}", role=role)
    row.may_steer = row.may_export = True
    token = row.new_token()
    row.save()
    return Client(headers={"Authorization": f"Bearer {token}"}, raise_request_exception=False)


def become(trial: Trial, who: User, tablet: Client) -> dict[str, Client]:
    """Return everything an account can become, given the tablet that it let in earlier."""
    account = signed_in(who, raise_request_exception=False)
    bearer = {"Authorization": f"Bearer {tablet.cookies[COOKIE].value}"}
    refused_or_new = pair_tablet(account, trial.stations[0])
    account.get(reverse("start"))  # which reports that once
    return {
        "account": account,
        "tablet": refused_or_new,
        "earlier tablet": tablet,
        "its token": Client(headers=bearer),
        "program": program_of(who, Role.PT),
        "program of a researcher": program_of(who, Role.RESEARCHER),
    }


def answers(trial: Trial, actors: dict[str, Client]) -> dict[tuple[str, str, str], str]:
    """Return what the participants' addresses answer each actor, to GET and POST."""
    seen = {}
    for url in trial.addresses():
        for name, client in actors.items():
            for method in ("get", "post"):
                answer = getattr(client, method)(url)
                words = f"{answer.status_code} {answer.get('Location', '')} {words_of(answer)}"
                seen[name, method, url] = VARYING.sub("", words)
    for name, client in actors.items():  # the sockets, which ask the same of their token
        token = client.cookies[COOKIE].value if COOKIE in client.cookies else ""
        device = find_tablet(token, timezone.now())
        rows = TrainingSession.objects.visible_to(device).order_by("pk")
        seen[name, "socket", ""] = str(list(rows.values_list("pk", "valence")))
    return seen


def find_leaks(trial: Trial, who: User, tablet: Client) -> set[str]:
    """Return what somebody has become that is answered otherwise once the arms are exchanged."""
    actors = become(trial, who, tablet)
    before = answers(trial, actors)
    trial.exchange()
    after = answers(trial, actors)
    return {key[0] for key, answer in before.items() if after[key] != answer}


def exchange(some: list[Any], others: list[Any], kept: set[str]) -> None:
    """Exchange all columns but the keys and those that tell whose a row is."""
    for one, other in zip(some, others, strict=True):
        names = {f.attname for f in one._meta.concrete_fields if not f.primary_key} - kept
        for row, values in ((one, vars(other).copy()), (other, vars(one).copy())):
            found = type(row).everywhere.filter(pk=row.pk)
            with guards.lifted("default"):
                found.update(**{name: values[name] for name in names})


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


@pytest.mark.parametrize(
    ("module", "rule", "empty", "found"),
    [
        (device_trust, "assessors", User, {"tablet", "earlier tablet"}),
        (consents, "hidden_patients", Patient, {"account", "program", "program of a researcher"}),
    ],
)
def test_a_rule_that_is_left_out_is_found(monkeypatch, module, rule, empty, found):
    trial = Trial()
    monkeypatch.setattr(module, rule, lambda *_: empty.everywhere.none())
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
