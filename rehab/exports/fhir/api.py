"""API calls that read a clinic as FHIR R4: single resources, searches, and all at once."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from datetime import datetime
from typing import Any

from django.conf import settings
from django.db.models import QuerySet
from django.http import Http404, HttpRequest, HttpResponse
from django.utils import timezone
from ninja import Field, Path, Query, Router, Schema

from rehab.exports.archive import StreamedResponse
from rehab.exports.fhir.resources import (
    SYSTEM,
    HospitalNames,
    Resource,
    make_device,
    session_resources,
)
from rehab.exports.fhir.study_resources import (
    make_event,
    make_goals,
    make_patient,
    make_study,
    make_subject,
)
from rehab.people.access import for_roles
from rehab.people.audit.audit_log import Act, record
from rehab.people.commands import garry_version
from rehab.people.consent.services import is_care_allowed
from rehab.people.models import Patient, User
from rehab.people.networks import client_address
from rehab.people.roles import PATIENT_EXPORTERS
from rehab.people.web.api_base import AwareDatetime, TextLine, caller, responses
from rehab.sessions.models import TrainingSession
from rehab.studies.models import Study, StudyState
from rehab.studies.participants import Enrollment
from rehab.studies.record.adverse_events import AdverseEvent, Grade
from rehab.training.changes import ENDED_STATES


@dataclass(frozen=True, slots=True)
class Rows:
    """Resources that are no session's: of which rows, and how they are made.

    ``patient`` leads from a row to its patient, ``since`` to its moment; "" where neither is.
    """

    find: Callable[[User], QuerySet[Any]]
    make: Callable[[User, Any, HospitalNames], Iterator[tuple[str, Resource]]]
    word: str
    patient: str
    since: str


NAMES = HospitalNames()
JSON, NDJSON = "application/fhir+json", "application/fhir+ndjson"
router = Router(tags=["FHIR R4"])


class Search(Schema):
    """What a search asks for. A page has the resources of up to ``_count`` sessions or patients."""

    patient: TextLine | None = None
    encounter: TextLine | None = None
    identifier: TextLine | None = None
    count: int = Field(20, alias="_count", ge=1, le=50)
    offset: int = Field(0, alias="_offset", ge=0, le=1_000_000)


def _key_of(reference: str, kind: str) -> int:
    """Return the number in a reference, such as Patient/patient-5. Raises Http404 for another."""
    words = reference.rpartition("/")[2].split("-")
    number = words[1] if len(words) > 1 and words[0] in kind.split() else ""
    if not (number.isascii() and number.isdecimal() and len(number) < 19):
        raise Http404
    return int(number)


def _patients(user: User) -> QuerySet[Patient]:
    return Patient.objects.visible_to(user).select_related("clinic").order_by("pk")


def _sessions(user: User) -> QuerySet[TrainingSession]:
    ended = [state.value for state in ENDED_STATES]
    rows = TrainingSession.objects.visible_to(user).filter(state__in=ended, excluded=False)
    return rows.select_related("patient__clinic", "measure").order_by("pk")


def _studies(user: User) -> QuerySet[Study]:
    return Study.objects.visible_to(user).exclude(state=StudyState.DRAFT).order_by("pk")


def _subjects(user: User) -> QuerySet[Enrollment]:
    related = ("study", "patient__clinic", "allocation")
    return Enrollment.objects.visible_to(user).select_related(*related).order_by("pk")


def _events(user: User) -> QuerySet[AdverseEvent]:
    rows = AdverseEvent.objects.visible_to(user).filter(grade__gt=Grade.NONE)
    related = ("enrollment__study", "enrollment__allocation", "enrollment__patient__clinic")
    return rows.select_related(*related, "entry__session__study_visit").order_by("pk")


ROWS = {
    "Patient": Rows(_patients, make_patient, "patient", "pk", "created_at"),
    "ResearchStudy": Rows(_studies, make_study, "study", "", ""),
    "ResearchSubject": Rows(_subjects, make_subject, "subject", "patient", "enrolled_at"),
    "AdverseEvent": Rows(_events, make_event, "event", "enrollment__patient", "at"),
    "Goal": Rows(_patients, make_goals, "goal", "pk", "created_at"),
}
TYPES = ("Encounter", "Observation", "QuestionnaireResponse", "Provenance", "Device", *ROWS)


def _of_row(user: User, row: Any, kind: str) -> Iterator[Resource]:
    """Yield the resources of a row; none without the patient's consent to care."""
    patient = row
    for name in filter(None, ROWS[kind].patient.replace("pk", "").split("__")):
        patient = getattr(patient, name)
    if not isinstance(patient, Patient) or is_care_allowed(patient):
        for address, resource in ROWS[kind].make(user, row, NAMES):
            yield _with_id(address, resource)


def _with_id(address: str, resource: Resource) -> Resource:
    return resource | {"id": address.partition("/")[2]}


def _of_session(user: User, session: TrainingSession, kind: str) -> Iterator[Resource]:
    """Yield a session's own resources of a type; none without the patient's consent to care."""
    if is_care_allowed(session.patient):
        for address, resource in session_resources(user, session, NAMES):
            if resource["resourceType"] == kind:
                yield _with_id(address, resource)


def _find(user: User, kind: str, name: str) -> Resource:
    """Return a resource by its id. Raises Http404."""
    if kind == "Device":
        found = [_with_id(*make_device(NAMES))]
    elif kind in ROWS:
        rows_of_kind = ROWS[kind].find(user).filter(pk=_key_of(name, ROWS[kind].word))
        found = [one for row in rows_of_kind for one in _of_row(user, row, kind)]
    else:
        key = _key_of(name, "session figure test answers provenance")
        rows_of = _sessions(user).filter(pk=key)
        found = [one for session in rows_of for one in _of_session(user, session, kind)]
    for resource in found:
        if resource["id"] == name:
            return resource
    raise Http404


def _search(user: User, kind: str, wanted: Search) -> tuple[list[Resource], bool]:
    """Return a page of the resources that are asked for, and whether there are more."""
    part = slice(wanted.offset, wanted.offset + wanted.count + 1)
    if kind == "Device":
        return [_with_id(*make_device(NAMES))][part], False
    if kind in ROWS:
        rows = ROWS[kind].find(user)
        if wanted.patient is not None:
            key = {ROWS[kind].patient: _key_of(wanted.patient, "patient")}
            rows = rows.filter(**key) if ROWS[kind].patient else rows.none()
        if kind == "Patient" and wanted.identifier is not None:
            system, _, code = wanted.identifier.rpartition("|")
            known = system in ("", f"{SYSTEM}:code", settings.SMART_IDENTIFIER)
            rows = rows.filter(code=code) if known else rows.none()
        few = list(rows[part])
        made = [one for row in few[: wanted.count] for one in _of_row(user, row, kind)]
        return made, len(few) > wanted.count
    sessions = _sessions(user)
    if wanted.patient is not None:
        sessions = sessions.filter(patient=_key_of(wanted.patient, "patient"))
    if wanted.encounter is not None:
        sessions = sessions.filter(pk=_key_of(wanted.encounter, "session"))
    walked = list(sessions[part])
    found = [one for session in walked[: wanted.count] for one in _of_session(user, session, kind)]
    return found, len(walked) > wanted.count


def _answer(resource: Resource) -> HttpResponse:
    return HttpResponse(json.dumps(resource, ensure_ascii=False), content_type=JSON)


def _add_calls(kind: str) -> None:
    """Add the calls of one type of resource."""

    @router.get(
        f"/fhir/{kind}",
        response=responses(dict, 404),
        operation_id=f"search_{kind}",
        url_name=f"search_{kind}",
    )
    @for_roles(*PATIENT_EXPORTERS)
    def search(request: HttpRequest, wanted: Query[Search]) -> HttpResponse:
        found, has_more = _search(caller(request), kind, wanted)
        place = request.build_absolute_uri(request.path)
        query = request.GET.copy()
        links = [{"relation": "self", "url": request.build_absolute_uri()}]
        if has_more:
            query["_offset"] = str(wanted.offset + wanted.count)
            links.append({"relation": "next", "url": f"{place}?{query.urlencode()}"})
        entries = [{"fullUrl": f"{place}/{one['id']}", "resource": one} for one in found]
        bundle: Resource = {"resourceType": "Bundle", "type": "searchset", "link": links}
        return _answer(bundle | ({"entry": entries} if entries else {}))

    @router.get(
        f"/fhir/{kind}/{{fhir_id}}",
        response=responses(dict, 404),
        operation_id=f"read_{kind}",
        url_name=f"read_{kind}",
    )
    @for_roles(*PATIENT_EXPORTERS)
    def read(request: HttpRequest, fhir_id: Path[str]) -> HttpResponse:
        return _answer(_find(caller(request), kind, fhir_id))

    search.__doc__, read.__doc__ = f"Search {kind} resources.", f"Read one {kind}."


PARAMETERS = {"identifier": "token", "patient": "reference", "encounter": "reference"}


def _asked_by(kind: str) -> list[str]:
    """Return by what resources of a type are searched."""
    if kind in ROWS:
        is_named = {"identifier": kind == "Patient", "patient": bool(ROWS[kind].patient)}
        return [name for name, is_one in is_named.items() if is_one]
    return ["patient", "encounter"] if kind != "Device" else []


@router.get("/fhir/metadata", response=responses(dict))
@for_roles(*PATIENT_EXPORTERS, patients=False)
def show_capabilities(request: HttpRequest) -> HttpResponse:
    """Show what this FHIR server can do: its CapabilityStatement."""
    return _answer(
        {
            "resourceType": "CapabilityStatement",
            "status": "active",
            "date": timezone.now().isoformat(timespec="seconds"),
            "kind": "instance",
            "software": {"name": "GARRY", "version": garry_version()},
            "implementation": {
                "description": "GARRY",
                "url": request.build_absolute_uri(request.path).removesuffix("/metadata"),
            },
            "fhirVersion": "4.0.1",
            "format": ["json"],
            "rest": [
                {
                    "mode": "server",
                    "resource": [
                        {
                            "type": kind,
                            "interaction": [{"code": "read"}, {"code": "search-type"}],
                            "searchParam": [
                                {"name": name, "type": PARAMETERS[name]} for name in _asked_by(kind)
                            ],
                        }
                        for kind in TYPES
                    ],
                    "operation": [
                        {
                            "name": "export",
                            "definition": "http://hl7.org/fhir/uv/bulkdata/OperationDefinition/export",
                        }
                    ],
                }
            ],
        }
    )


@router.get("/fhir/$export", response=responses(dict, code=202))
@for_roles(*PATIENT_EXPORTERS, exports=True, patients=False)
def start_bulk(request: HttpRequest) -> HttpResponse:
    """Begin an export of the whole clinic (Bulk Data); its files are made while they are read."""
    place = request.build_absolute_uri(request.path).removesuffix("$export")
    before = timezone.now().isoformat(timespec="seconds").replace("+00:00", "Z")
    headers = {"Content-Location": f"{place}bulk?before={before}"}
    words = "It is ready at Content-Location, at once."
    issue = {"severity": "information", "code": "informational", "diagnostics": words}
    outcome = json.dumps({"resourceType": "OperationOutcome", "issue": [issue]})
    return HttpResponse(outcome, content_type=JSON, status=202, headers=headers)


class Before(Schema):
    """Sessions that ended later are left out."""

    before: AwareDatetime


@router.get("/fhir/bulk", response=responses(dict))
@for_roles(*PATIENT_EXPORTERS, exports=True, patients=False)
def show_bulk(request: HttpRequest, wanted: Query[Before]) -> dict[str, Any]:
    """Show the files of an export of the whole clinic."""
    place = request.build_absolute_uri(request.path)
    query = request.GET.urlencode()
    return {
        "transactionTime": wanted.before.isoformat(timespec="seconds"),
        "request": f"{place.removesuffix('bulk')}$export",
        "requiresAccessToken": True,
        "output": [{"type": kind, "url": f"{place}/{kind}.ndjson?{query}"} for kind in TYPES],
        "error": [],
    }


@router.get("/fhir/bulk/{fhir_type}.ndjson", response=responses(dict, 404))
@for_roles(*PATIENT_EXPORTERS, exports=True, patients=False)  # audited here, before the first byte
def read_bulk(request: HttpRequest, fhir_type: Path[str], wanted: Query[Before]) -> HttpResponse:
    """Read all resources of one type, one a line."""
    if fhir_type not in TYPES:
        raise Http404
    user, now = caller(request), timezone.now()
    record(Act.EXPORT, user, about=request.path, address=client_address(request), now=now)
    lines = _lines(_all(user, fhir_type, wanted.before))
    return StreamedResponse(lines, content_type=NDJSON)  # type: ignore[return-value]


def _all(user: User, kind: str, before: datetime) -> Iterator[Resource]:
    if kind == "Device":
        yield _with_id(*make_device(NAMES))
    elif kind in ROWS:
        until = {f"{ROWS[kind].since}__lte": before} if ROWS[kind].since else {}
        for row in ROWS[kind].find(user).filter(**until).iterator():
            yield from _of_row(user, row, kind)
    else:
        for session in _sessions(user).filter(ended_at__lte=before).iterator():
            yield from _of_session(user, session, kind)


def _lines(found: Iterator[Resource]) -> Iterator[bytes]:
    for resource in found:
        yield json.dumps(resource, ensure_ascii=False).encode() + b"\n"


for _kind in TYPES:
    _add_calls(_kind)
