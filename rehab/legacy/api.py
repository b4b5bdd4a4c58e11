"""The API routes of the paper: users by ID, and sessions with the paper's ten attributes."""

from __future__ import annotations

from typing import Any

from django.http import HttpRequest
from django.shortcuts import get_object_or_404
from ninja import Field, Path, Query, Router, Schema, Status

from rehab.people.access import clinic_of, for_roles
from rehab.people.api import ShortText, patients_of, store
from rehab.people.models import Patient
from rehab.people.roles import Role
from rehab.people.web.api_base import (
    Page,
    Paging,
    RequestBody,
    caller,
    paginate,
    responses,
)
from rehab.sessions.api import ORDERS, visible_sessions
from rehab.sessions.formatting import clinic_time
from rehab.sessions.schemas import ValenceSlug

router = Router(tags=["The paper's calls"])


class PaperUserBody(RequestBody):
    """A new user in the paper's words."""

    name: ShortText = Field(description="A nickname. The original kept real names; GARRY does not.")


class PaperUser(Schema):
    """A user in the paper's words: `id` is the patient's code, `name` the nickname."""

    id: str = Field(alias="code")
    name: str = Field(alias="nickname")


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
    """Filters of a user's sessions."""

    feedback_type: ValenceSlug | None = None


@router.get("/users/{code}", response=responses(PaperUser, 404))
@for_roles(Role.LEAD, Role.PT)
def show_user(request: HttpRequest, code: Path[ShortText]) -> Patient:
    """Return a user by the ID that a PT would type."""
    return get_object_or_404(patients_of(caller(request)), code=code)


@router.post("/users/{code}", response=responses(PaperUser, 409, code=201))
@for_roles(Role.LEAD, Role.PT)
def add_user(request: HttpRequest, code: Path[ShortText], body: PaperUserBody) -> Status[Patient]:
    """Create a user with this ID."""
    patient = Patient(clinic=clinic_of(caller(request)))
    return Status(201, store(patient, {"code": code, "nickname": body.name}))


@router.get("/users/{code}/sessions", response=responses(Page[PaperSession], 404))
@for_roles(Role.LEAD, Role.PT)
def list_user_sessions(
    request: HttpRequest, code: Path[ShortText], filters: Query[PaperFilter]
) -> dict[str, Any]:
    """List a user's sessions by non-ascending score; those without a score come last."""
    user = caller(request)
    patient = get_object_or_404(Patient.objects.visible_to(user), code=code)
    # The paper has no word for a walk that nobody walked.
    sessions = visible_sessions(user).filter(patient=patient, simulated=patient.simulated)
    sessions = sessions.select_related("clinic")
    if filters.feedback_type:
        sessions = sessions.filter(valence=filters.feedback_type)
    page = paginate(sessions.order_by(*ORDERS["best"]), filters)
    return page | {"items": [to_paper_session(session) for session in page["items"]]}


def to_paper_session(session: Any) -> dict[str, Any]:
    """Return a session with the paper's attributes, in the clinic's time zone."""
    start = clinic_time(session.began_at, session.clinic)
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
