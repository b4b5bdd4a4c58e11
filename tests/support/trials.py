"""A blinded trial whose arms can be exchanged, and everything that its assessor can become."""

from __future__ import annotations

import itertools
import re
from collections.abc import Sequence
from copy import copy
from datetime import UTC, datetime, timedelta
from types import SimpleNamespace
from typing import Any

import time_machine
from django.contrib.sessions.models import Session
from django.db import transaction
from django.test import Client
from django.urls import reverse
from django.utils import timezone

from rehab.boards.cache import clear_cache
from rehab.patients import family
from rehab.patients.family import give_link
from rehab.people.audit import append_only_triggers
from rehab.people.consent import models as consents
from rehab.people.consent.models import Purpose
from rehab.people.consent.services import record_consent
from rehab.people.models import Patient, ServerUserManager, User
from rehab.people.roles import Role
from rehab.people.sign_in import sign_in_expiry
from rehab.people.sign_in.sign_in_expiry import digest_of
from rehab.people.sign_in.tokens import ApiToken
from rehab.questionnaires.instrument import Instrument, Item
from rehab.sessions.corrections import SessionCorrection
from rehab.sessions.live.session.aggregate import SessionAggregate
from rehab.sessions.log import SessionEvent, SessionMetric, Step
from rehab.sessions.models import TrainingSession
from rehab.sessions.questionnaires import QuestionnaireResponse
from rehab.sessions.robot_incidents import RobotIncident
from rehab.stations.models import Station
from rehab.stations.tablets import COOKIE
from rehab.stations.tokens import find_device
from rehab.studies.allocation.scheme import Secret
from rehab.studies.blinding import Task, give_mark
from rehab.studies.enrolling import withdraw
from rehab.studies.participants import Allocation, Enrollment, StudyEvent, StudyVisit
from rehab.studies.record.adverse_events import AdverseEvent
from rehab.studies.registration.allocation_secret import seal
from rehab.studies.visits import Place, start_session
from rehab.training.changes import Change, ChangeKind
from rehab.training.steps import Measurement, Side
from robot.wire.incident import pack
from tests.support.archives import words_of
from tests.support.incidents import BUMPED
from tests.support.studies import SEED, enrolled, new_patient, running_study
from tests.support.tablets import pair_phone, pair_tablet
from tests.support.tenancy import all_routes
from tests.support.world import NOW, build_world, fill_board, signed_in, store

ARMS = ("positive", "negative")
FAMILY = "stranger with a family link"
addresses = itertools.count()  # of families
STALE = "stale screen of who treats"
AS_ACCOUNT = {"account", "program", "program of a researcher"}
TABLETS = {"tablet", "earlier tablet", "its token"}
PHONES = {"phone", "earlier phone"}  # sources, which are told what is walked
# A nonce, a number of each answer, and the length of the words, which have both.
OF_EACH_ANSWER = {"Content-Security-Policy", "X-Request-ID", "Content-Length"}
OF_SESSIONS: tuple[type[Any], ...] = (
    *(Step, SessionEvent, RobotIncident, SessionCorrection, QuestionnaireResponse),
)
YESTERDAY = SimpleNamespace(now=lambda: datetime.now(UTC) - timedelta(days=1))
# Rules of blinding: where each stands, what leaves it out, and who then sees the arm.
LEFT_OUT: dict[str, tuple[Any, str, Any, set[str]]] = {
    "an assessor lets no device in": (
        ServerUserManager,
        "assessors",
        lambda manager: manager.none(),
        TABLETS | PHONES,
    ),
    "an assessor sees no sessions": (
        consents,
        "hidden_patients",
        lambda _: Patient.everywhere.none(),
        AS_ACCOUNT,
    ),
    "a sign-in ends": (sign_in_expiry, "timezone", YESTERDAY, {STALE}),
    "a family sees nothing": (family, "refusal_reason", lambda _: "", {FAMILY}),
}
# What differs each time, whatever a patient walks: tokens, nonces, times, room on the disk, and
# the last digits of sums, which are added up in another order.
VARYING = re.compile(
    r'csrfmiddlewaretoken" value="\w+"|nonce="[^"]+"|"data-csrf": "\w+"|\d{1,2}:\d\d(:\d\d)?|'
    r'"?\d{4}-\d\d-\d\d[T ][^"<,\n]*|[\d.]+ GB|(?<=\.\d{9})\d+'
)


def walk_visit(
    enrollment: Enrollment, station: Station | None = None, *, ended: bool = True
) -> TrainingSession:
    """Let a participant walk the next visit's session, to its end unless that is to come."""
    session = start_session(enrollment, Place(station=station), None, NOW)
    aggregate = SessionAggregate(session)
    store(aggregate, aggregate.change(Change(ChangeKind.START), None, NOW))
    # More than who walks the other arm, by more than values differ: other steps reach the goal.
    more = ARMS.index(session.valence) / 5 + enrollment.pk % 5 / 50
    for phase in range(3):
        for number in range(60 * phase + 1, 60 * phase + 61):
            value = 1.0 + number % 5 / 10 + (more if phase else 0)
            stride = Measurement(number, number * 1.1, Side.LEFT, value)
            store(aggregate, [aggregate.record_step(stride, NOW)])
        if phase < 2:
            store(aggregate, aggregate.change(Change(ChangeKind.PHASE, phase + 1), None, NOW))
    if ended:
        store(aggregate, aggregate.change(Change(ChangeKind.FINISH), None, NOW))
    session.refresh_from_db()
    return session


def add_records(session: TrainingSession, enrollment: Enrollment) -> list[Any]:
    """Return what else is stored of a session, other things for each arm; some tell the arm."""
    arm = ARMS.index(session.valence)
    lead = User.everywhere.get(clinic=session.clinic_id, role=Role.LEAD)
    said = Item("Did it cheer you up?", "no", "yes", 5)
    asked = Instrument("own-1", "Mood", "", "en", (said,)).to_json()
    row = {"session": session, "at": NOW}
    return [
        RobotIncident.everywhere.create(
            **row, reason=("bump", "cliff")[arm], recording=pack(BUMPED)
        ),
        SessionCorrection.everywhere.create(
            **row, field="note", new=f"walked {session.valence}", reason=session.valence, by=lead
        ),
        QuestionnaireResponse.everywhere.create(
            session=session, slug="own-1", instrument=asked, answers=[(5, 1)[arm]], finished_at=NOW
        ),
        AdverseEvent.everywhere.create(
            enrollment=enrollment, what=f"Fell, {session.valence}", grade=arm + 1, relation="none"
        ),
    ]


class Trial:
    """A running study with participants of each arm, who have walked as many steps."""

    looked_at: datetime | None = None  # when everybody looks, before and after the exchange

    def __init__(self, *, withdrawn: bool = False, ended: bool = True, pairs: int = 1) -> None:
        self.world = world = build_world("amber")
        fill_board(world)
        self.study = running_study(world, *ARMS, sealed=seal(Secret(SEED, (2,))))
        self.assessor = User.everywhere.create_user("zz", role=Role.PT, clinic=world.clinic)
        self.stations = [world.add_station(name) for name in ("Bay 1", "Bay 2")]
        before = signed_in(self.assessor)
        self.earlier = pair_tablet(before, self.stations[0])
        self.earlier_phone = pair_phone(before, self.stations[0])
        give_mark(self.study, self.assessor, Task.ASSESSOR, None, NOW)
        self.patients = [new_patient(world, number) for number in range(1, 2 * pairs + 1)]
        self.sessions, self.family = [], []
        for patient, station in zip(self.patients, self.stations * pairs, strict=True):
            patient.boards = "clinic"
            patient.save()
            record_consent(patient, Purpose.BOARDS, None, NOW, "clinic")
            record_consent(patient, Purpose.FAMILY, None, NOW)
            self.family.append(self.give_link(patient))
            enrollment = enrolled(self.study, patient)
            self.sessions.append(walk_visit(enrollment, station, ended=ended))
            if withdrawn:
                withdraw(enrollment, None, NOW)
            records = add_records(self.sessions[-1], enrollment)
            world.more += [patient, enrollment, self.sessions[-1], *records]
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
        with append_only_triggers.lifted(
            "default"
        ):  # once: PostgreSQL locks each trigger until the end
            self._exchange()
        clear_cache()

    def _exchange(self) -> None:
        for one, other in zip(self.sessions[::2], self.sessions[1::2], strict=True):
            exchange([one], [other], {"patient_id", "created_at", "station_id"})
            for model in OF_SESSIONS:
                rows = model.everywhere.order_by("pk")
                exchange(
                    list(rows.filter(session=one)), list(rows.filter(session=other)), {"session_id"}
                )
            exchange_metrics(one, other)
        for of_enrollment in (Allocation, AdverseEvent):
            rows = of_enrollment.everywhere.filter(enrollment__study=self.study).order_by("pk")
            exchange(list(rows[::2]), list(rows[1::2]), {"enrollment_id"})

    def addresses(self) -> list[str]:
        """Return the addresses of what the participants walked, and of their stations' tablets."""
        keys = "|".join(str(session.pk) for session in self.sessions)
        found = [route.url for route in all_routes((self.world,))]
        named = re.compile(rf"(sessions/|trainingsession/|fhir/\w+/\w+-)({keys})(/|-|$)")
        own = [url for url in found if named.search(url)]
        lists = ("api:list_sessions", "tablet-state", "waiting-board", "start")
        return [*dict.fromkeys(own), *(reverse(name) for name in lists)]


def program_of(user: User, role: Role) -> Client:
    """Return a program that an account has given a token that may do everything."""
    row = ApiToken(clinic=user.clinic, user=user, name=f"as {role}", role=role)
    row.may_steer = row.may_export = True
    token = row.new_token()
    row.save()
    return bearing(token)


def bearing(token: str) -> Client:
    """Return a program that shows a token."""
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
    refused_or_new = pair_tablet(account, trial.stations[0])
    account.get(reverse("start"))  # which reports that once
    return {
        # Each from an own address: twenty tries are let through from one.
        FAMILY: Client(REMOTE_ADDR=f"198.51.100.{next(addresses) % 250}"),
        STALE: stale_screen(trial.world.people[Role.PT]),
        "account": account,
        "tablet": refused_or_new,
        "earlier tablet": tablet,
        "its token": bearing(tablet.cookies[COOKIE].value),
        "phone": bearing(pair_phone(account, trial.stations[0])),
        "earlier phone": bearing(trial.earlier_phone),
        "program": program_of(who, Role.PT),
        "program of a researcher": program_of(who, Role.RESEARCHER),
    }


def answers(
    trial: Trial, actors: dict[str, Client], urls: Sequence[str] = ()
) -> dict[tuple[str, str, str], str]:
    """Return what every address answers each actor: to GET, and to POST the participants' own and
    what makes an export. Nothing stays of it in the database. Each actor's looks begin at the same
    moment: pages tell of what is ten minutes old, which a busy machine takes.
    """
    seen = {}
    trial.looked_at = trial.looked_at or timezone.now()
    exports = [reverse(f"{step}-research") for step in ("prepare", "advance")]
    exports = [url for url in exports if url in urls]
    for name, client in actors.items():
        own = [*trial.addresses(), *(trial.family if name == FAMILY else [])]
        with time_machine.travel(trial.looked_at):
            for url in dict.fromkeys([*exports, *own, *urls]):  # files stay: they are made anew
                seen[name, "get", url] = read(client, "get", url)
                if url in own or url in exports:
                    seen[name, "post", url] = read(client, "post", url)
    for name, client in actors.items():  # the sockets, which ask the same of their token
        bearer = client.defaults.get("HTTP_AUTHORIZATION", "").removeprefix("Bearer ")
        token = client.cookies[COOKIE].value if COOKIE in client.cookies else bearer
        with transaction.atomic():  # asked for, a device that is not trusted any more ends
            device = find_device(token, timezone.now())
            rows = TrainingSession.objects.visible_to(device).order_by("pk")
            seen[name, "socket", ""] = str(list(rows.values_list("pk", "valence")))
            transaction.set_rollback(True)
    return seen


def read(client: Client, method: str, url: str) -> str:
    """Return an answer with its headers, file names among them, without what always differs."""
    cookies = copy(client.cookies)
    with transaction.atomic():  # undone, so that no answer depends on one before it
        answer = getattr(client, method)(url)
        words = words_of(answer)
        transaction.set_rollback(True)
    client.cookies = cookies
    assert answer.status_code < 500 or "readyz" in url, url
    said = {name: value for name, value in answer.headers.items() if name not in OF_EACH_ANSWER}
    return VARYING.sub("", f"{answer.status_code} {said} {words}")


def exchange_metrics(one: TrainingSession, other: TrainingSession) -> None:
    """Exchange the figures of two sessions, which may have different ones."""
    found = SessionMetric.everywhere.filter(session__in=(one, other))
    rows = list(found)
    found.delete()
    for row in rows:
        row.session = other if row.session_id == one.pk else one
    SessionMetric.everywhere.bulk_create(rows)


def exchange(some: list[Any], others: list[Any], kept: set[str]) -> None:
    """Exchange all columns but the keys and those that tell whose a row is."""
    for one, other in zip(some, others, strict=False):  # who should not may have added some
        names = {f.attname for f in one._meta.concrete_fields if not f.primary_key} - kept
        for row, values in ((one, vars(other).copy()), (other, vars(one).copy())):
            found = type(row).everywhere.filter(pk=row.pk)
            found.update(**{name: values[name] for name in names})
