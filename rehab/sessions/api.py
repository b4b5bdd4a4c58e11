"""Calls about sessions: create and steer them as the pages do, read what was walked."""

from __future__ import annotations

from datetime import datetime
from typing import Annotated, Any, Literal

from django.db.models import F, Q, QuerySet
from django.http import HttpRequest
from django.shortcuts import get_object_or_404
from ninja import Field, Path, Query, Router, Schema, Status
from ninja.errors import HttpError
from pydantic import AfterValidator

from rehab.people.access import for_roles
from rehab.people.api import PatientName, Short
from rehab.people.api_base import (
    Given,
    Key,
    Moment,
    Page,
    Paging,
    Rejected,
    Whole,
    Words,
    answers,
    caller,
    cut,
    left_out,
    say_errors,
)
from rehab.people.models import Patient, User
from rehab.people.roles import Role
from rehab.sessions.forms import SessionForm, like_last_time
from rehab.sessions.live.owners import OwnedElsewhere
from rehab.sessions.live.session import NotStored
from rehab.sessions.models import Protocol, SessionMetric, Step, TrainingSession
from rehab.sessions.services import change_session
from rehab.sessions.trend import with_figures
from rehab.sessions.words import at_clinic
from rehab.stations.builtin import first_station
from rehab.stations.models import Station
from rehab.training.changes import ChangeKind, Refused, State
from rehab.training.measures import InvalidSetting
from rehab.training.metrics import METRICS
from rehab.training.steps import Side
from rehab.training.valences import VALENCES, find_valence

router = Router(tags=["Sessions"])
paper = Router(tags=["The paper's calls"])

STEPS_MAX = 1000
FeedbackType = Annotated[
    str,
    AfterValidator(lambda slug: find_valence(slug).slug),
    Field(json_schema_extra={"enum": list(VALENCES)}),
]
ORDERS = {
    "newest": ("-created_at", "-pk"),
    "oldest": ("created_at", "pk"),
    "best": (F("metric_score").desc(nulls_last=True), "created_at", "pk"),
}
# What the set-up form calls otherwise.
FORM_NAMES = {"feedback_type": "valence", "goal": "goal_value"}


class Choice(Schema):
    """Something that a session can be built with."""

    id: int
    name: str


class SessionOut(Schema):
    """A session. Score and hit rate come when it is finished; explicit feedback has no score."""

    id: int
    patient: PatientName
    state: str
    feedback_type: str = Field(alias="valence")
    goal: float | None
    measure: str = Field(alias="measure.name")
    unit: str = Field(alias="measure.unit")
    trained_side: str | None
    protocol: str | None = Field(None, alias="protocol.name")
    station: str | None = Field(None, alias="station.name")
    source: str
    simulated: bool
    imported: bool = Field(description="From the original GARRY, without steps.")
    created_at: datetime
    started_at: datetime | None
    ended_at: datetime | None
    active_s: float
    score: float | None = Field(alias="metric_score")
    hit_rate: float | None = Field(alias="metric_hit_rate")

    @staticmethod
    def resolve_imported(session: TrainingSession) -> bool:
        """Say whether it has no steps of its own."""
        return session.original_id is not None

    @staticmethod
    def resolve_trained_side(session: TrainingSession) -> str | None:
        """Give the trained leg; null where the original did not keep it."""
        return session.trained_side or None


class SessionFilter(Paging):
    """Which sessions are wanted, and in which order."""

    patient: Key | None = None
    pseudonym: Short | None = None
    feedback_type: FeedbackType | None = None
    state: State | None = None
    since: Moment | None = Field(None, description="Created at this moment or later.")
    until: Moment | None = Field(None, description="Created before this moment.")
    order: Literal["newest", "oldest", "best"] = "newest"


class SessionGiven(Given):
    """A new session. What is left out is like the patient's last time."""

    patient: Key
    feedback_type: FeedbackType = left_out()
    goal: float = left_out(description="In the measure's unit, or give `goal_percent`.")
    goal_percent: float = left_out(description="Percent of the baseline.")
    wanted_hits: Whole | None = Field(None, description="Percent of the steps.")
    minutes: Whole | None = None
    protocol: Key = left_out()
    station: Key = left_out()
    source: Words = left_out(description="`live`, `synthetic good`, `recording walk.csv`, …")
    trained_side: Side = left_out(strict=False)
    robot: Words = left_out(description="As in the set-up: `off`, `quiet`, `normal`, …")
    robot_above: Words = left_out(description="Gesture after a window above the threshold.")
    robot_below: Words = left_out(description="Gesture after a window below it.")


class ChangeGiven(Given):
    """What is to be changed of a session, as on the therapist's page."""

    kind: ChangeKind = Field(strict=False)
    value: float | None = Field(
        None, description="The new goal, gain, threshold or phase; nothing for the others."
    )


class StepOut(Schema):
    """A scored stride."""

    number: int
    time_s: float
    received_at: datetime
    side: str
    value: float | None
    gain: float
    shown: float | None
    goal: float | None
    performance: float | None
    hit: bool | None
    points: int | None
    valid: bool
    reasons: list[str]
    phase: int
    rules_version: int
    extra: dict[str, float]


class StepPage(Schema):
    """Steps in their order. `next_after` is where to go on; null at the end (so far)."""

    items: list[StepOut]
    next_after: int | None


class StepFilter(Schema):
    """Which steps are wanted."""

    after: int = Field(0, ge=0, lt=2**31)
    limit: int = Field(200, ge=1, le=STEPS_MAX)


class MetricOut(Schema):
    """A figure of a finished session."""

    slug: str
    label: str
    unit: str
    value: float

    @staticmethod
    def resolve_label(metric: SessionMetric) -> str:
        """Give what the figure is."""
        return METRICS[metric.slug].label

    @staticmethod
    def resolve_unit(metric: SessionMetric) -> str:
        """Give the figure's unit; none for a ratio or a count."""
        return METRICS[metric.slug].unit


class PaperSession(Schema):
    """A session with the ten attributes of the paper, and its names for them."""

    session_id: int
    participant_id: str
    year: int
    month: int
    day: int
    start_time: str
    duration: float = Field(description="Seconds walked.")
    score: float | None
    feedback_type: str
    threshold: float | None = Field(description="The goal, in the measure's unit.")


class PaperFilter(Paging):
    """Which sessions of a user are wanted."""

    feedback_type: FeedbackType | None = None


def sessions_of(user: User) -> QuerySet[TrainingSession]:
    """Give the sessions that somebody sees, with all that is told of them."""
    rows = TrainingSession.objects.visible_to(user).defer("plan")
    return with_figures(user, rows).select_related("patient", "measure", "protocol", "station")


def find_session(user: User, session_id: int) -> TrainingSession:
    """Give a session that somebody sees. Raises Http404 for any other."""
    return get_object_or_404(sessions_of(user), pk=session_id)


@router.get("/protocols", response=answers(Page[Choice]))
@for_roles(Role.LEAD, Role.PT, Role.RESEARCHER)
def list_protocols(request: HttpRequest, wanted: Query[Paging]) -> dict[str, Any]:
    """List the protocols that a session may follow."""
    return cut(Protocol.objects.visible_to(caller(request)).order_by("pk"), wanted)


@router.get("/stations", response=answers(Page[Choice]))
@for_roles(Role.LEAD, Role.PT)
def list_stations(request: HttpRequest, wanted: Query[Paging]) -> dict[str, Any]:
    """List the stations where a session may be."""
    return cut(Station.objects.visible_to(caller(request)).order_by("pk"), wanted)


@router.get("/sessions", response=answers(Page[SessionOut]))
@for_roles(Role.LEAD, Role.PT, Role.RESEARCHER)
def list_sessions(request: HttpRequest, wanted: Query[SessionFilter]) -> dict[str, Any]:
    """List the clinic's sessions; `order=best` is by non-ascending score."""
    user = caller(request)
    asked: dict[str, Any] = {
        "patient": wanted.patient,
        "patient__pseudonym": wanted.pseudonym,
        "valence": wanted.feedback_type,
        "state": wanted.state,
        "created_at__gte": wanted.since,
        "created_at__lt": wanted.until,
    }
    given = Q(**{name: value for name, value in asked.items() if value is not None})
    return cut(sessions_of(user).filter(given).order_by(*ORDERS[wanted.order]), wanted)


@router.post("/sessions", response=answers(SessionOut, 404, 409, code=201))
@for_roles(Role.LEAD, Role.PT)
def add_session(request: HttpRequest, given: SessionGiven) -> Status[TrainingSession]:
    """Create a session that is ready to start: the same as by the set-up page."""
    user = caller(request)
    values = given.model_dump(mode="json", exclude_unset=True)
    patient = get_object_or_404(Patient.objects.visible_to(user), pk=values.pop("patient"))
    if {"goal", "goal_percent"} <= values.keys():
        raise Rejected({"goal": "Give either `goal` or `goal_percent`."})
    if "goal" in values or "goal_percent" in values:
        values["goal_by"] = "value" if "goal" in values else "percent"
    first_station(patient.clinic)
    data = like_last_time(patient, user)
    data |= {FORM_NAMES.get(name, name): value for name, value in values.items()}
    form = SessionForm(data, patient=patient, by=user)
    session = form.create()
    if session is None:
        ours = {theirs: name for name, theirs in FORM_NAMES.items()}
        objections = say_errors(form.errors)
        raise Rejected({ours.get(name, name): words for name, words in objections.items()})
    return Status(201, find_session(user, session.pk))


@router.get("/sessions/{session_id}", response=answers(SessionOut, 404))
@for_roles(Role.LEAD, Role.PT, Role.RESEARCHER)
def show_session(request: HttpRequest, session_id: Path[Key]) -> TrainingSession:
    """Show a session."""
    return find_session(caller(request), session_id)


@router.post("/sessions/{session_id}/changes", response=answers(SessionOut, 404, 409, 503))
@for_roles(Role.LEAD, Role.PT)
def change(request: HttpRequest, session_id: Path[Key], given: ChangeGiven) -> TrainingSession:
    """Start, pause, resume, finish or steer a session; stored when this answers."""
    user = caller(request)
    session = find_session(user, session_id)
    try:
        change_session(session, given.kind, given.value, by=user)
    except (Refused, OwnedElsewhere) as problem:
        raise HttpError(409, str(problem)) from problem
    except InvalidSetting as problem:
        raise Rejected({"value": str(problem)}) from problem
    except NotStored as problem:
        raise HttpError(503, str(problem)) from problem
    return find_session(user, session_id)


@router.get("/sessions/{session_id}/steps", response=answers(StepPage, 404))
@for_roles(Role.LEAD, Role.PT, Role.RESEARCHER)
def list_steps(
    request: HttpRequest, session_id: Path[Key], wanted: Query[StepFilter]
) -> dict[str, Any]:
    """List a session's steps by their numbers, also while it runs."""
    user = caller(request)
    session = find_session(user, session_id)
    steps = Step.objects.visible_to(user).filter(session=session, number__gt=wanted.after)
    found = list(steps.order_by("number")[: wanted.limit])
    more = len(found) == wanted.limit
    return {"items": found, "next_after": found[-1].number if more else None}


@router.get("/sessions/{session_id}/metrics", response=answers(list[MetricOut], 404))
@for_roles(Role.LEAD, Role.PT, Role.RESEARCHER)
def list_metrics(request: HttpRequest, session_id: Path[Key]) -> QuerySet[SessionMetric]:
    """List the figures of a finished session."""
    user = caller(request)
    session = find_session(user, session_id)
    return SessionMetric.objects.visible_to(user).filter(session=session).order_by("slug")


@paper.get("/users/{code}/sessions", response=answers(Page[PaperSession], 404))
@for_roles(Role.LEAD, Role.PT)
def list_user_sessions(
    request: HttpRequest, code: Path[Short], wanted: Query[PaperFilter]
) -> dict[str, Any]:
    """List a user's sessions by non-ascending score; those without a score come last."""
    user = caller(request)
    patient = get_object_or_404(Patient.objects.visible_to(user), code=code)
    sessions = sessions_of(user).filter(patient=patient).select_related("clinic")
    if wanted.feedback_type:
        sessions = sessions.filter(valence=wanted.feedback_type)
    page = cut(sessions.order_by(*ORDERS["best"]), wanted)
    return page | {"items": [in_paper_words(session) for session in page["items"]]}


def in_paper_words(session: Any) -> dict[str, Any]:
    """Tell a session by the paper's attributes, its date by the clinic's clock."""
    start = at_clinic(session.started_at or session.created_at, session.clinic)
    return {
        "session_id": session.pk,
        "participant_id": session.patient.code,
        "year": start.year,
        "month": start.month,
        "day": start.day,
        "start_time": f"{start:%H:%M:%S}",
        "duration": session.active_s,
        "score": session.metric_score,
        "feedback_type": session.valence,
        "threshold": session.goal,
    }
