"""API calls about people: the caller, and the clinic's patients (the paper's users)."""

from __future__ import annotations

from datetime import date, datetime
from typing import Annotated, Any

from django.core.exceptions import ValidationError
from django.db import IntegrityError, transaction
from django.db.models import QuerySet
from django.http import HttpRequest
from django.shortcuts import get_object_or_404
from ninja import Field, Path, Query, Router, Schema, Status

from rehab.people.access import clinic_of, for_roles
from rehab.people.models import LANGUAGES, Patient, Severity, User
from rehab.people.roles import Role
from rehab.people.web.api_base import (
    Key,
    Page,
    Paging,
    Rejected,
    RequestBody,
    StrictInt,
    TextLine,
    caller,
    format_errors,
    may_see_names,
    optional,
    paginate,
    responses,
)
from rehab.training.steps import Side

router = Router(tags=["People"])

ShortText = Annotated[TextLine, Field(max_length=32)]
Language = Annotated[str, Field(json_schema_extra={"enum": [code for code, _ in LANGUAGES]})]


class Me(Schema):
    """The person who calls."""

    username: str
    role: Role
    clinic: str | None

    @staticmethod
    def resolve_clinic(user: User) -> str | None:
        """Return the clinic's name; a host has none."""
        return None if user.clinic is None else user.clinic.name


class PatientName(Schema):
    """How a patient is named to the caller. Researchers get the pseudonym alone."""

    pseudonym: str
    id: int | None
    code: str | None
    nickname: str | None

    @staticmethod
    def resolve_id(patient: Patient, context: Any) -> int | None:
        """Return the key, for callers who may see names."""
        return patient.pk if may_see_names(context) else None

    @staticmethod
    def resolve_code(patient: Patient, context: Any) -> str | None:
        """Return the clinic's own code, for callers who may see names."""
        return patient.code if may_see_names(context) else None

    @staticmethod
    def resolve_nickname(patient: Patient, context: Any) -> str | None:
        """Return the nickname on the screens, for callers who may see names."""
        return patient.nickname if may_see_names(context) else None


class PatientOut(PatientName):
    """A patient."""

    paretic_side: str | None
    body_mass_kg: float | None
    birth_year: int | None
    stroke_month: date | None
    severity: str | None
    language: str
    simulated: bool
    created_at: datetime

    @staticmethod
    def resolve_paretic_side(patient: Patient) -> str | None:
        """Return the side; null where it is not set."""
        return patient.paretic_side or None

    @staticmethod
    def resolve_severity(patient: Patient) -> str | None:
        """Return the severity; null where it is not set."""
        return patient.severity or None


class PatientChanges(RequestBody):
    """Changes of a patient; omitted fields stay."""

    code: ShortText = optional(description="The clinic's own number, never a name.")
    nickname: ShortText = optional(description="What the screens say, never a full name.")
    paretic_side: Side = optional(strict=False)
    body_mass_kg: float | None = Field(None, ge=10, le=300)
    birth_year: StrictInt | None = Field(None, ge=1900, le=2100)
    stroke_month: date | None = Field(
        None, strict=False, description="Its first day: `2026-03-01`."
    )
    severity: Severity = optional(strict=False)
    language: Language = optional()


class PatientIn(PatientChanges):
    """A new patient."""

    code: ShortText = Field(description="The clinic's own number, never a name.")
    nickname: ShortText = Field(description="What the screens say, never a full name.")


class PatientFilter(Paging):
    """Filters of a list of patients."""

    code: ShortText | None = None


def patients_of(user: User) -> QuerySet[Patient]:
    """Return the patients that a person sees, oldest first."""
    return Patient.objects.visible_to(user).order_by("pk")


def store(patient: Patient, values: dict[str, Any]) -> Patient:
    """Set these values of a patient and save them; of a stored one these fields alone.

    Raises Rejected for what the model refuses.
    """
    for name, value in values.items():
        setattr(patient, name, value)
    try:
        patient.full_clean()
        with transaction.atomic():
            if patient.is_new:
                patient.save()
            else:
                patient.save_fields(*values)
    except ValidationError as problem:
        raise Rejected(format_errors(problem.message_dict)) from problem
    except IntegrityError as problem:  # another request was faster
        raise Rejected({"code": "This code has just been taken."}) from problem
    return patient


@router.get("/me", response=responses(Me))
@for_roles(*Role, patients=False)
def show_me(request: HttpRequest) -> User:
    """Show the person of the token or browser."""
    return caller(request)


@router.get("/patients", response=responses(Page[PatientOut]))
@for_roles(Role.LEAD, Role.PT)
def list_patients(request: HttpRequest, filters: Query[PatientFilter]) -> dict[str, Any]:
    """List the clinic's patients. Researchers find sessions by pseudonym instead."""
    patients = patients_of(caller(request))
    return paginate(patients.filter(code=filters.code) if filters.code else patients, filters)


@router.post("/patients", response=responses(PatientOut, 409, code=201))
@for_roles(Role.LEAD, Role.PT)
def add_patient(request: HttpRequest, body: PatientIn) -> Status[Patient]:
    """Add a patient."""
    patient = Patient(clinic=clinic_of(caller(request)))
    return Status(201, store(patient, body.model_dump(mode="json", exclude_unset=True)))


@router.get("/patients/{patient_id}", response=responses(PatientOut, 404))
@for_roles(Role.LEAD, Role.PT)
def show_patient(request: HttpRequest, patient_id: Path[Key]) -> Patient:
    """Show a patient."""
    return get_object_or_404(patients_of(caller(request)), pk=patient_id)


@router.patch("/patients/{patient_id}", response=responses(PatientOut, 404, 409))
@for_roles(Role.LEAD, Role.PT)
def change_patient(request: HttpRequest, patient_id: Path[Key], body: PatientChanges) -> Patient:
    """Change fields of a patient."""
    patient = get_object_or_404(patients_of(caller(request)), pk=patient_id)
    return store(patient, body.model_dump(mode="json", exclude_unset=True))
