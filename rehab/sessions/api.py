"""API calls about sessions: create and control them as the pages do, read steps and figures."""

from __future__ import annotations

from typing import Any

from django.db.models import F, Q, QuerySet
from django.http import HttpRequest
from django.shortcuts import get_object_or_404
from ninja import Path, Query, Router, Status
from ninja.errors import HttpError

from rehab.people.access import for_roles
from rehab.people.models import Patient, User
from rehab.people.roles import Role
from rehab.people.web.api_base import (
    Key,
    Page,
    Paging,
    Rejected,
    caller,
    format_errors,
    paginate,
    responses,
)
from rehab.sessions.forms.initial import initial_choices
from rehab.sessions.forms.setup import SessionForm
from rehab.sessions.live.database.trouble import NotStored
from rehab.sessions.log import SessionMetric, Step
from rehab.sessions.models import TrainingSession
from rehab.sessions.reports.trend import with_metrics
from rehab.sessions.schemas import (
    ChangeRequestBody,
    MeasureOut,
    MetricOut,
    NamedRow,
    SessionFilter,
    SessionOut,
    SessionRequestBody,
    StepFilter,
    StepPage,
)
from rehab.sessions.services import change_session
from rehab.sessions.setup.options import OPTIONS
from rehab.sessions.setup.protocol_models import MeasureDefinition, Protocol
from rehab.stations.builtin import first_station
from rehab.stations.models import Station
from rehab.training.changes import NotAllowed
from rehab.training.measures import InvalidSetting

router = Router(tags=["Sessions"])

ORDERS = {
    "newest": ("-created_at", "-pk"),
    "oldest": ("created_at", "pk"),
    "best": (F("metric_score").desc(nulls_last=True), "created_at", "pk"),
}
# Options that have another name in the set-up form.
FORM_NAMES = {option.api_name: option.name for option in OPTIONS.values() if option.api_name}


def visible_sessions(user: User) -> QuerySet[TrainingSession]:
    """Return the sessions that a user may see, with what `SessionOut` needs."""
    rows = TrainingSession.objects.visible_to(user).defer("plan")
    return with_metrics(user, rows).select_related("patient", "measure", "protocol", "station")


def get_session(user: User, session_id: int) -> TrainingSession:
    """Return a session that a user may see. Raises Http404 for any other."""
    return get_object_or_404(visible_sessions(user), pk=session_id)


@router.get("/protocols", response=responses(Page[NamedRow]))
@for_roles(Role.LEAD, Role.PT, Role.RESEARCHER, patients=False)
def list_protocols(request: HttpRequest, wanted: Query[Paging]) -> dict[str, Any]:
    """List the protocols that a session may follow."""
    return paginate(Protocol.objects.visible_to(caller(request)).order_by("pk"), wanted)


@router.get("/measures", response=responses(Page[MeasureOut]))
@for_roles(Role.LEAD, Role.PT, Role.RESEARCHER, patients=False)
def list_measures(request: HttpRequest, wanted: Query[Paging]) -> dict[str, Any]:
    """List what sessions may train."""
    return paginate(MeasureDefinition.objects.visible_to(caller(request)).order_by("pk"), wanted)


@router.get("/stations", response=responses(Page[NamedRow]))
@for_roles(Role.LEAD, Role.PT, patients=False)
def list_stations(request: HttpRequest, wanted: Query[Paging]) -> dict[str, Any]:
    """List the stations where a session may be."""
    return paginate(Station.objects.visible_to(caller(request)).order_by("pk"), wanted)


@router.get("/sessions", response=responses(Page[SessionOut], 404))
@for_roles(Role.LEAD, Role.PT, Role.RESEARCHER)
def list_sessions(request: HttpRequest, wanted: Query[SessionFilter]) -> dict[str, Any]:
    """List the clinic's sessions; `order=best` is by non-ascending score."""
    user = caller(request)
    if wanted.patient is not None:  # of a number that says nothing to the caller no pseudonym
        get_object_or_404(Patient.objects.visible_to(user), pk=wanted.patient)
    conditions: dict[str, Any] = {
        "patient": wanted.patient,
        "patient__pseudonym": wanted.pseudonym,
        "valence": wanted.feedback_type,
        "state": wanted.state,
        "created_at__gte": wanted.since,
        "created_at__lt": wanted.until,
    }
    given = Q(**{name: value for name, value in conditions.items() if value is not None})
    return paginate(visible_sessions(user).filter(given).order_by(*ORDERS[wanted.order]), wanted)


@router.post("/sessions", response=responses(SessionOut, 404, 409, code=201))
@for_roles(Role.LEAD, Role.PT)
def add_session(request: HttpRequest, given: SessionRequestBody) -> Status[TrainingSession]:
    """Create a session that is ready to start: the same as by the set-up page."""
    user = caller(request)
    values = given.model_dump(mode="json", exclude_unset=True)
    patient = get_object_or_404(Patient.objects.visible_to(user), pk=values.pop("patient"))
    if {"goal", "goal_percent"} <= values.keys():
        raise Rejected({"goal": "Give either `goal` or `goal_percent`."})
    if "goal" in values or "goal_percent" in values:
        values["goal_by"] = "value" if "goal" in values else "percent"
    first_station(patient.clinic)
    data = initial_choices(patient, user)
    data |= {FORM_NAMES.get(name, name): value for name, value in values.items()}
    form = SessionForm(data, patient=patient, by=user)
    session = form.create()
    if session is None:
        api_names = {field: name for name, field in FORM_NAMES.items()}
        objections = format_errors(form.errors)
        raise Rejected({api_names.get(name, name): message for name, message in objections.items()})
    return Status(201, get_session(user, session.pk))


@router.get("/sessions/{session_id}", response=responses(SessionOut, 404))
@for_roles(Role.LEAD, Role.PT, Role.RESEARCHER)
def show_session(request: HttpRequest, session_id: Path[Key]) -> TrainingSession:
    """Show a session."""
    return get_session(caller(request), session_id)


@router.post("/sessions/{session_id}/changes", response=responses(SessionOut, 404, 409, 503))
@for_roles(Role.LEAD, Role.PT)
def change(
    request: HttpRequest, session_id: Path[Key], given: ChangeRequestBody
) -> TrainingSession:
    """Start, pause, resume, finish or steer a session; stored when this answers."""
    user = caller(request)
    session = get_session(user, session_id)
    try:
        change_session(session, given.kind, given.value, by=user)
    except NotAllowed as problem:
        raise HttpError(409, str(problem)) from problem
    except InvalidSetting as problem:
        raise Rejected({"value": str(problem)}) from problem
    except NotStored as problem:
        raise HttpError(503, str(problem)) from problem
    return get_session(user, session_id)


@router.get("/sessions/{session_id}/steps", response=responses(StepPage, 404))
@for_roles(Role.LEAD, Role.PT, Role.RESEARCHER, exports=True)
def list_steps(
    request: HttpRequest, session_id: Path[Key], wanted: Query[StepFilter]
) -> dict[str, Any]:
    """List a session's steps by their numbers, also while it runs."""
    user = caller(request)
    session = get_session(user, session_id)
    steps = Step.objects.visible_to(user).filter(session=session, number__gt=wanted.after)
    found = list(steps.order_by("number")[: wanted.limit])
    more = len(found) == wanted.limit
    return {"items": found, "next_after": found[-1].number if more else None}


@router.get("/sessions/{session_id}/metrics", response=responses(list[MetricOut], 404))
@for_roles(Role.LEAD, Role.PT, Role.RESEARCHER)
def list_metrics(request: HttpRequest, session_id: Path[Key]) -> QuerySet[SessionMetric]:
    """List the figures of a finished session."""
    user = caller(request)
    session = get_session(user, session_id)
    return SessionMetric.objects.visible_to(user).filter(session=session).order_by("slug")
