"""A small world to test in: clinics with one row of every model, each row marked as theirs."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

from django.apps import apps
from django.contrib.auth.models import AnonymousUser
from django.db.models import Model, Q
from django.test import Client

from rehab.boards.cache_invalidation import BoardChange
from rehab.boards.models import Leaderboard
from rehab.boards.snapshots import BoardSnapshot
from rehab.feedback.models import FeedbackBand, FeedbackType
from rehab.gestures.models import ComposedGesture, GestureStep
from rehab.outbox.models import Endpoint, OutboxMessage, Topic
from rehab.patients.family import FamilyLink
from rehab.patients.visits import Visit
from rehab.people.audit.audit_log import AuditEntry
from rehab.people.audit.history import HistoryEntry
from rehab.people.audit.moves import ClinicMove
from rehab.people.audit.seals import LogSeal
from rehab.people.consent.models import Consent, ConsentText, Purpose
from rehab.people.consent.services import record_consent
from rehab.people.consent.tombstones import ImportTombstone
from rehab.people.models import BoardsConsent, Clinic, Patient, SignOnGroup, User
from rehab.people.roles import Role
from rehab.people.server_keys import ServerKey
from rehab.people.sign_in.attempt_counter import SignInAttempts
from rehab.people.sign_in.factors.factors import Authenticator, RecoveryCode
from rehab.people.sign_in.resets import ResetRequest
from rehab.people.sign_in.tokens import ApiToken
from rehab.people.upkeep_runs import Chore
from rehab.questionnaires.instrument import Instrument, Item
from rehab.sessions.assessment_results import Assessment
from rehab.sessions.available_tests import ClinicTest
from rehab.sessions.corrections import SessionCorrection
from rehab.sessions.live.session.aggregate import Row, SessionAggregate
from rehab.sessions.live.session.commit_transaction import Job, commit
from rehab.sessions.log import SessionEvent, SessionMetric, Step
from rehab.sessions.models import TrainingSession
from rehab.sessions.ownership import ClinicOwner
from rehab.sessions.questionnaires import Questionnaire, QuestionnaireResponse
from rehab.sessions.robot_incidents import RobotIncident
from rehab.sessions.seals import SessionSeal, seal_sessions
from rehab.sessions.services import SessionRequest, create_session
from rehab.sessions.setup.presets import Preset
from rehab.sessions.setup.protocol_models import MeasureDefinition, Protocol, ProtocolPhase
from rehab.stations.models import Device, Pairing, PinAttempts, Station
from rehab.stations.tablets import COOKIE
from rehab.studies.models import StudyMark, StudyVersion
from rehab.studies.participants import (
    Allocation,
    Enrollment,
    Screening,
    StudyEvent,
    StudyVisit,
)
from rehab.studies.power_runs import PowerRun
from rehab.studies.record.adverse_events import AdverseEvent
from rehab.training.changes import Change, ChangeKind
from rehab.training.goals import GoalRule
from rehab.training.steps import Measurement, Side
from robot.wire.incident import pack
from tests.support.clock import START
from tests.support.closed_study import close_study
from tests.support.marks import mark
from tests.support.tablets import approved

NOW = START  # the moment at which a test begins
# What a robot recorded around a bump.
RECORDED = [
    {"at_s": 10.0, "tick": [0.2, 0.0, 0.0, 0.0, 0.0, 0.2, 0.0]},
    {"at_s": 10.5, "tick": [0.2, 0.0, 0.1, 0.0, 0.0, 0.2, 0.0], "hazards": ["bump"]},
    {"at_s": 10.5, "retained": "bump", "is_first": True},
    {"at_s": 10.7, "tick": [0.0, 0.0, 0.12, 0.0, 0.0, 0.0, 0.0]},
]


MOVED: dict[str, Any] = {
    "exported_at": NOW,
    "at": NOW,
    "finished_at": NOW,
    "shifts": {},
    "digests": {},
}

OF_THE_SERVER = {Chore, ServerKey}  # no clinic's rows; no page shows them


@dataclass
class World:
    """One clinic and everything in it."""

    name: str
    clinic: Clinic
    people: dict[Role, User]
    device: Device
    token: str
    rows: dict[type[Model], Any] = field(default_factory=dict)
    more: list[Any] = field(default_factory=list)  # further rows, which have pages as well

    def rows_of(self, model: type[Model]) -> list[Any]:
        """Return the clinic's rows of a model that pages are opened for."""
        return [self.rows[model], *(row for row in self.more if type(row) is model)]

    @property
    def patient(self) -> Patient:
        """The clinic's patient."""
        patient: Patient = self.rows[Patient]
        return patient

    @property
    def session(self) -> TrainingSession:
        """The clinic's finished session."""
        session: TrainingSession = self.rows[TrainingSession]
        return session

    @cached_property
    def pt(self) -> Client:
        """A browser of the clinic's therapist."""
        return client_of(self)

    @cached_property
    def lead(self) -> Client:
        """A browser of the clinic's lead."""
        return client_of(self, Role.LEAD)

    def add_patient(self, name: str = "Rosa", code: str = "", **fields: Any) -> Patient:
        """Return a new patient of the clinic; the left leg is the paretic one."""
        fields = {"paretic_side": "left"} | fields
        return Patient.everywhere.create(
            clinic=self.clinic, nickname=name, code=code or name, **fields
        )

    def add_station(self, name: str = "Bay 4", **fields: Any) -> Station:
        """Return a new station of the clinic."""
        return Station.everywhere.create(clinic=self.clinic, name=name, **fields)

    def add_tablet(self, station: Station | None = None) -> tuple[Client, Device]:
        """Return a paired tablet's browser and row; at the clinic's own station by default."""
        at = station or self.rows[Station]
        client = Client()
        device, client.cookies[COOKIE] = approved(at)
        return client, device

    def begin_session(self, patient: Patient | None = None, **chosen: Any) -> TrainingSession:
        """Return a new session, ready to start, with the measure and protocol of the finished."""
        like = self.session
        options: dict[str, Any] = {"valence": "positive", "goal": GoalRule(value=1.0)} | chosen
        return create_session(
            SessionRequest(
                patient=patient or self.patient,
                measure=like.measure,
                protocol=like.protocol,
                **options,
            )
        )


def scoped_models() -> list[type[Any]]:
    """Return every model of the app but the server's own, found by itself."""
    return [one for one in apps.get_app_config("rehab").get_models() if one not in OF_THE_SERVER]


def agreeing(patient: Patient) -> Patient:
    """Return a patient who agrees to stand on the boards that are set."""
    if patient.boards != BoardsConsent.OWN:
        record_consent(patient, Purpose.BOARDS, None, NOW, patient.boards)
    return patient


def store(aggregate: SessionAggregate, rows: list[Row]) -> None:
    """Commit rows of a session here and now, without the live path's threads."""
    session = aggregate.session
    epoch = ClinicOwner.everywhere.get_or_create(pk=session.clinic_id)[0].epoch
    commit([Job(aggregate, session.pk, epoch, rows, aggregate.summary(), lambda _: None)])


def set_owner(clinic_id: int, owner: str) -> None:
    """Let a process have a clinic: one that died, or one that runs elsewhere."""
    ClinicOwner.everywhere.update_or_create(pk=clinic_id, defaults={"owner": owner})


def seal_nothing(clinic: Clinic) -> LogSeal:
    """Store the seal with which a clinic's audit log begins here: of no rows."""
    seal = LogSeal(log="AuditEntry", clinic=clinic, number=1, first_id=0, last_id=0, last_at=NOW)
    seal.digest = seal.compute_digest([])
    seal.save()
    return seal


def seal_steps(session: TrainingSession) -> SessionSeal:
    """Seal a session's steps and events; return the seal."""
    seal_sessions(NOW, Q(pk=session.pk))
    return SessionSeal.everywhere.get(session=session)


def build_world(name: str) -> World:
    """Build a clinic with people of every role and one row of every model."""
    clinic = Clinic.everywhere.create(name=mark(name, Clinic))
    people = {
        role: User.everywhere.create_user(
            f"{mark(name, User)}-{role.value}",
            role=role,
            clinic=clinic,
        )
        for role in (Role.LEAD, Role.PT, Role.RESEARCHER, Role.SPONSOR)
    }
    station = Station.everywhere.create(clinic=clinic, name=mark(name, Station))
    device = Device(
        clinic=clinic, station=station, kind=Device.Kind.SOURCE, name=mark(name, Device)
    )
    token = device.new_token()
    device.save()
    measure = MeasureDefinition.everywhere.create(
        clinic=clinic,
        slug=f"m-{name}",
        name=mark(name, MeasureDefinition),
        unit="m",
        value_min=0,
        value_max=2,
        goal_min=0,
        goal_max=2,
    )
    protocol = Protocol.everywhere.create(
        clinic=clinic, name=mark(name, Protocol), description=mark(name, Protocol)
    )
    phase = ProtocolPhase.everywhere.create(
        protocol=protocol,
        position=1,
        kind="training",
        name=mark(name, ProtocolPhase),
        feedback=True,
    )
    gesture = ComposedGesture.everywhere.create(clinic=clinic, name=mark(name, ComposedGesture))
    step = GestureStep.everywhere.create(gesture=gesture, position=1, hold_s=1.0)
    feedback = FeedbackType.everywhere.create(
        clinic=clinic, slug="negative", hit_points=0, miss_points=-1, cue_below="droop"
    )
    said = {"en": mark(name, FeedbackType)}
    FeedbackBand.everywhere.create(feedback_type=feedback, from_percent=0, words=said)
    band = FeedbackBand.everywhere.create(
        feedback_type=feedback, from_percent=100, words={"en": mark(name, FeedbackBand)}
    )
    patient = Patient.everywhere.create(
        clinic=clinic,
        code=mark(name, Patient),
        nickname=mark(name, Patient),
        paretic_side="left",
        boards="clinic",
    )
    text = ConsentText.everywhere.create(clinic=clinic, version=1, text=mark(name, ConsentText))
    for purpose in (Purpose.BOARDS, Purpose.RESEARCH):
        level = patient.boards if purpose == Purpose.BOARDS else ""
        record_consent(patient, purpose, people[Role.PT], NOW, level)
    session = create_session(
        SessionRequest(
            patient=patient,
            valence="positive",
            goal=GoalRule(value=1.0),
            protocol=protocol,
            measure=measure,
            station=station,
            created_by=people[Role.PT],
            source=mark(name, TrainingSession),
        )
    )
    aggregate = SessionAggregate(session)
    store(aggregate, aggregate.change(Change(ChangeKind.START), people[Role.PT], NOW))
    for number in range(1, 11):
        reasons = (mark(name, Step),) if number == 3 else ()
        value = 0.5 + number / 10
        stride = Measurement(number, number * 1.1, Side.LEFT, value, reasons)
        store(aggregate, [aggregate.record_step(stride, NOW)])
    store(aggregate, aggregate.change(Change(ChangeKind.FINISH), people[Role.PT], NOW))
    board = Leaderboard.everywhere.create(
        clinic=clinic,
        name=mark(name, Leaderboard),
        among="clinic",
        aggregation="best",
        display="top",
        names="code",
        period="all",
        min_valid_strides=1,
    )
    of_group = Leaderboard.everywhere.create(
        clinic=clinic,
        name=f"{mark(name, Leaderboard)} 2",
        among="group",
        aggregation="best",
        active=False,
    )
    of_group.group.add(patient)
    study = close_study(name, patient, session, people[Role.PT])
    endpoint = Endpoint.everywhere.create(
        clinic=clinic,
        name=mark(name, Endpoint),
        url="https://receiver.example/hook",
        active=False,
    )
    world = World(name, clinic, people, device, token, more=[of_group])
    for row in (
        clinic,
        people[Role.PT],
        station,
        device,
        measure,
        protocol,
        phase,
        gesture,
        step,
        feedback,
        band,
        patient,
        session,
        SessionCorrection.everywhere.create(
            session=session,
            field="note",
            new=mark(name, SessionCorrection),
            reason=mark(name, SessionCorrection),
            by=people[Role.PT],
            at=NOW,
        ),
        ClinicOwner.everywhere.get_or_create(pk=clinic.pk)[0],
        seal_steps(session),
        ClinicMove.everywhere.create(clinic=clinic, number=1, file=mark(name, ClinicMove), **MOVED),
        RobotIncident.everywhere.create(
            session=session, at=NOW, reason=mark(name, RobotIncident), recording=pack(RECORDED)
        ),
        Preset.everywhere.create(
            clinic=clinic,
            name=mark(name, Preset),
            measure=measure,
            protocol=protocol,
            options={"valence": "binary", "goal_by": "value", "goal_value": 1.5},
        ),
        Questionnaire.everywhere.create(
            clinic=clinic, name=mark(name, Questionnaire), items="Zqtiredqz | zq | zq | 5"
        ),
        ClinicTest.everywhere.create(
            clinic=clinic, code="zqformqz", name=mark(name, ClinicTest), items="Zqbendsqz | 0 | 2"
        ),
        QuestionnaireResponse.everywhere.create(
            session=session,
            slug="own-0",
            instrument=Instrument(
                "own-0",
                mark(name, QuestionnaireResponse),
                "",
                "en",
                (Item("Zqtiredqz", "zq", "zq", 5), Item("Zqhappyqz", "zq", "zq", 5)),
            ).to_json(),
            answers=[4],
        ),
        Step.everywhere.get(session=session, number=3),
        SessionEvent.everywhere.filter(session=session).first(),
        SessionMetric.everywhere.filter(session=session).first(),
        board,
        BoardChange.everywhere.filter(patient_key=patient.pk).first(),
        BoardSnapshot.everywhere.create(board=board, definition="", results=[]),
        text,
        Consent.everywhere.filter(patient=patient).last(),
        study,
        StudyVersion.everywhere.get(study=study),
        study.arms.first(),
        StudyMark.everywhere.get(study=study),
        Enrollment.everywhere.get(study=study),
        Allocation.everywhere.get(enrollment__study=study),
        Screening.everywhere.get(study=study),
        StudyVisit.everywhere.get(enrollment__study=study),
        AdverseEvent.everywhere.get(enrollment__study=study),
        PowerRun.everywhere.get(study=study),
        StudyEvent.everywhere.get(study=study),
        AuditEntry.everywhere.create(clinic=clinic, act="view", about=mark(name, AuditEntry)),
        HistoryEntry.everywhere.get(model_name="Patient", object_id=patient.pk),
        seal_nothing(clinic),
        SignOnGroup.everywhere.create(clinic=clinic, name=mark(name, SignOnGroup), role=Role.PT),
        ApiToken.everywhere.create(
            clinic=clinic,
            user=people[Role.PT],
            name=mark(name, ApiToken),
            role=Role.PT,
            may_steer=True,
            token_hash=f"program-{name}",
        ),
        endpoint,
        OutboxMessage.everywhere.create(
            clinic=clinic,
            endpoint=endpoint,
            topic=Topic.SESSION,
            body={"session": session.pk},
            at=NOW,
            due_at=NOW,
            state=OutboxMessage.State.REFUSED,
            answer=mark(name, OutboxMessage),
        ),
        Authenticator.everywhere.create(
            user=people[Role.PT], kind="app", name=mark(name, Authenticator), credential="-"
        ),
        RecoveryCode.everywhere.create(user=people[Role.PT], code_hash=mark(name, RecoveryCode)),
        ResetRequest.everywhere.create(
            account=people[Role.PT], asked_by=people[Role.LEAD], asked_at=NOW
        ),
        SignInAttempts.everywhere.create(
            user=people[Role.PT], key=mark(name, SignInAttempts), counted_at=NOW
        ),
        PinAttempts.everywhere.create(
            station=station, screen=f"tablet {device.pk}", locked_until=NOW
        ),
        ImportTombstone.everywhere.create(clinic=clinic, id_hash=mark(name, ImportTombstone)),
        FamilyLink.everywhere.create(
            clinic=clinic,
            patient=patient,
            token_hash=f"family-{name}",
            created_at=NOW,
            expires_at=NOW,
        ),
        Assessment.everywhere.create(
            clinic=clinic, patient=patient, test="tug", value=17.5, device=mark(name, Assessment)
        ),
        Visit.everywhere.create(clinic=clinic, patient=patient, day=NOW.date()),
        Pairing.everywhere.create(
            code=f"P{clinic.pk}"[-8:],
            secret_hash=f"pairing-{name}",
            expires_at=NOW,
            device=device,
        ),
    ):
        world.rows[type(row)] = row
    return world


def fill_board(world: World) -> None:
    """Let four more patients of a clinic walk, so that there are enough for its board."""
    session, shared = world.session, {"id", "patient_id", "clinic_id"}
    session.refresh_from_db()
    columns = [f.attname for f in TrainingSession._meta.concrete_fields if f.attname not in shared]
    for number in range(2, 6):
        patient = agreeing(
            Patient.everywhere.create(
                clinic=world.clinic,
                code=f"{mark(world.name, Patient)}{number}",
                nickname=mark(world.name, Patient),
                paretic_side="left",
                boards="clinic",
            )
        )
        walked = TrainingSession.everywhere.create(
            clinic=world.clinic,
            patient=patient,
            **{column: getattr(session, column) for column in columns},
        )
        for figure in session.metrics.all():
            SessionMetric.everywhere.create(
                session=walked, slug=figure.slug, value=figure.value - number / 100
            )


def signed_in(user: User, **options: Any) -> Client:
    """Return a browser in which somebody is signed in."""
    client = Client(**options)
    client.force_login(user)
    return client


def client_of(world: World, role: Role = Role.PT, **options: Any) -> Client:
    """Return the browser of a clinic's person of that role."""
    return signed_in(world.people[role], **options)


@dataclass(frozen=True)
class Actor:
    """Someone who tries: a person, a device or a stranger."""

    label: str
    subject: Any
    clinic: str | None = None
    role: str = "stranger"


def all_actors(*worlds: World) -> list[Actor]:
    """Return every role of every clinic, a host, a stranger, and an account switched off."""
    host = User.everywhere.create_user("host", role=Role.HOST)
    actors = [Actor("stranger", AnonymousUser()), Actor("host", host, None, "host")]
    for world in worlds:
        actors += [
            Actor(f"{role.value} of {world.name}", person, world.name, role.value)
            for role, person in world.people.items()
        ]
        actors.append(Actor(f"device of {world.name}", world.device, world.name, "device"))
    off = User.everywhere.create_user("off", role=Role.PT, clinic=worlds[0].clinic, is_active=False)
    return [*actors, Actor("switched off", off)]
