"""A blinded trial whose arms can be exchanged, and everything that its assessor can become."""

from __future__ import annotations

import itertools
import re
from datetime import UTC, datetime, timedelta
from types import SimpleNamespace
from typing import Any

from django.contrib.sessions.models import Session
from django.test import Client
from django.urls import reverse
from django.utils import timezone

from rehab.boards.cache import clear_cache
from rehab.patients import family
from rehab.patients.family import give_link
from rehab.people.audit import guards
from rehab.people.consent import models as consents
from rehab.people.consent.models import Purpose
from rehab.people.consent.services import record_consent
from rehab.people.models import Patient, User
from rehab.people.roles import Role
from rehab.people.sign_in import browser_sessions
from rehab.people.sign_in.browser_sessions import digest_of
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
from tests.support.archives import words_of
from tests.support.studies import SEED, enrolled, new_patient, running_study
from tests.support.tablets import pair_tablet
from tests.support.tenancy import all_routes
from tests.support.world import NOW, build_world, fill_board, signed_in, store

ARMS = ("positive", "negative")
FAMILY = "stranger with a family link"
addresses = itertools.count()  # of families
STALE = "stale screen of who treats"
AS_ACCOUNT = {"account", "program", "program of a researcher"}
TABLETS = {"tablet", "earlier tablet", "its token"}
YESTERDAY = SimpleNamespace(now=lambda: datetime.now(UTC) - timedelta(days=1))
# Rules of blinding: where each stands, what leaves it out, and who then sees the arm.
LEFT_OUT: dict[str, tuple[Any, str, Any, set[str]]] = {
    "an assessor lets no tablet in": (device_trust, "assessors", User.everywhere.none, TABLETS),
    "an assessor sees no sessions": (
        consents,
        "hidden_patients",
        lambda _: Patient.everywhere.none(),
        AS_ACCOUNT,
    ),
    "a sign-in ends": (browser_sessions, "timezone", YESTERDAY, {STALE}),
    "a family sees nothing": (family, "refusal_reason", lambda _: "", {FAMILY}),
}
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
        self.sessions, self.family = [], []
        for patient, station in zip(self.patients, self.stations, strict=True):
            patient.boards = "clinic"
            patient.save()
            record_consent(patient, Purpose.BOARDS, None, NOW, "clinic")
            record_consent(patient, Purpose.FAMILY, None, NOW)
            self.family.append(self.give_link(patient))
            enrollment = enrolled(self.study, patient)
            self.sessions.append(walk_visit(enrollment, station, ended=ended))
            if withdrawn:
                withdraw(enrollment, None, NOW)
            world.more += [patient, enrollment, self.sessions[-1]]
        assert {session.valence for session in self.sessions} == set(ARMS)
        world.more.append(self.study)
        for model in (Allocation, StudyVisit, StudyEvent, Step, SessionEvent, SessionMetric):
            world.more.append(model.everywhere.order_by("-pk").first())

    def give_link(self, patient: Patient) -> str:
        """Return the address of the page that a participant's family was given before."""
        lead = self.world.people[Role.LEAD]
        token = give_link(patient, 12, lead, "", timezone.now(), shows_name=False)
        return reverse("family", args=[token])

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


def stale_screen(user: User) -> Client:
    """Return a browser that somebody has left, and whose sign-in has ended since."""
    browser = signed_in(user, raise_request_exception=False)
    row = Session.objects.filter(pk=digest_of(browser.cookies["sessionid"].value))
    row.update(expire_date=timezone.now() - timedelta(seconds=1))
    return browser


def become(trial: Trial, who: User, tablet: Client) -> dict[str, Client]:
    """Return everything an account can become, given the tablet that it let in earlier."""
    account = signed_in(who, raise_request_exception=False)
    bearer = {"Authorization": f"Bearer {tablet.cookies[COOKIE].value}"}
    refused_or_new = pair_tablet(account, trial.stations[0])
    account.get(reverse("start"))  # which reports that once
    return {
        # Each from an own address: twenty tries are let through from one.
        FAMILY: Client(REMOTE_ADDR=f"198.51.100.{next(addresses) % 250}"),
        STALE: stale_screen(trial.world.people[Role.PT]),
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
    for name, client in actors.items():
        for url in [*trial.addresses(), *(trial.family if name == FAMILY else [])]:
            for method in ("get", "post"):
                answer = getattr(client, method)(url)
                words = f"{answer.status_code} {answer.get('Location', '')} {words_of(answer)}"
                seen[name, method, url] = VARYING.sub("", words)
    for name, client in actors.items():  # the sockets, which ask the same of their token
        bearer = client.defaults.get("HTTP_AUTHORIZATION", "").removeprefix("Bearer ")
        token = client.cookies[COOKIE].value if COOKIE in client.cookies else bearer
        device = find_tablet(token, timezone.now())
        rows = TrainingSession.objects.visible_to(device).order_by("pk")
        seen[name, "socket", ""] = str(list(rows.values_list("pk", "valence")))
    return seen


def exchange(some: list[Any], others: list[Any], kept: set[str]) -> None:
    """Exchange all columns but the keys and those that tell whose a row is."""
    for one, other in zip(some, others, strict=True):
        names = {f.attname for f in one._meta.concrete_fields if not f.primary_key} - kept
        for row, values in ((one, vars(other).copy()), (other, vars(one).copy())):
            found = type(row).everywhere.filter(pk=row.pk)
            with guards.lifted("default"):
                found.update(**{name: values[name] for name in names})
