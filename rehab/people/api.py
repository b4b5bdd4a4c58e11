"""Calls about people: who calls, and the clinic's patients (the paper's users)."""

from __future__ import annotations

from datetime import datetime
from typing import Annotated, Any

from django.core.exceptions import ValidationError
from django.db import IntegrityError, transaction
from django.db.models import QuerySet
from django.http import HttpRequest
from django.shortcuts import get_object_or_404
from ninja import Field, Path, Query, Router, Schema, Status

from rehab.people.access import clinic_of, for_roles
from rehab.people.models import LANGUAGES, Patient, User
from rehab.people.roles import Role
from rehab.people.web.api_base import (
    Given,
    Key,
    Page,
    Paging,
    Rejected,
    Words,
    answers,
    caller,
    cut,
    left_out,
    say_errors,
    sees_names,
)
from rehab.training.steps import Side

router = Router(tags=["People"])

Short = Annotated[Words, Field(max_length=32)]
Language = Annotated[str, Field(json_schema_extra={"enum": [code for code, _ in LANGUAGES]})]


class Me(Schema):
    """Who calls."""

    username: str
    role: Role
    clinic: str | None

    @staticmethod
    def resolve_clinic(user: User) -> str | None:
        """Give the clinic's name; a host has none."""
        return None if user.clinic is None else user.clinic.name


class PatientName(Schema):
    """Who somebody is to the caller. Researchers get the pseudonym and nothing else."""

    pseudonym: str
    id: int | None
    code: str | None
    nickname: str | None

    @staticmethod
    def resolve_id(patient: Patient, context: Any) -> int | None:
        """Give the key where it leads somewhere."""
        return patient.pk if sees_names(context) else None

    @staticmethod
    def resolve_code(patient: Patient, context: Any) -> str | None:
        """Give the clinic's own number."""
        return patient.code if sees_names(context) else None

    @staticmethod
    def resolve_nickname(patient: Patient, context: Any) -> str | None:
        """Give what the screens say."""
        return patient.nickname if sees_names(context) else None


class PatientOut(PatientName):
    """A patient."""

    paretic_side: str | None
    body_mass_kg: float | None
    language: str
    simulated: bool
    created_at: datetime

    @staticmethod
    def resolve_paretic_side(patient: Patient) -> str | None:
        """Give the side; null where nobody has said."""
        return patient.paretic_side or None


class PatientChanges(Given):
    """What may be changed of a patient; what is left out stays."""

    code: Short = left_out(description="The clinic's own number, never a name.")
    nickname: Short = left_out(description="What the screens say, never a full name.")
    paretic_side: Side = left_out(strict=False)
    body_mass_kg: float | None = Field(None, ge=10, le=300)
    language: Language = left_out()


class PatientGiven(PatientChanges):
    """A new patient."""

    code: Short = Field(description="The clinic's own number, never a name.")
    nickname: Short = Field(description="What the screens say, never a full name.")


class PatientFilter(Paging):
    """Which patients are wanted."""

    code: Short | None = None


def patients_of(user: User) -> QuerySet[Patient]:
    """Give the patients that somebody sees, by age of their file."""
    return Patient.objects.visible_to(user).order_by("pk")


def store(patient: Patient, values: dict[str, Any]) -> Patient:
    """Fill a patient in and save; of one who is here these values alone.

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
                patient.keep(*values)
    except ValidationError as problem:
        raise Rejected(say_errors(problem.message_dict)) from problem
    except IntegrityError as problem:  # somebody else was quicker
        raise Rejected({"code": "This code has just been taken."}) from problem
    return patient


@router.get("/me", response=answers(Me))
@for_roles(*Role, patients=False)
def show_me(request: HttpRequest) -> User:
    """Say whom the token or the browser speaks for."""
    return caller(request)


@router.get("/patients", response=answers(Page[PatientOut]))
@for_roles(Role.LEAD, Role.PT)
def list_patients(request: HttpRequest, wanted: Query[PatientFilter]) -> dict[str, Any]:
    """List the clinic's patients. Researchers find sessions by pseudonym instead."""
    patients = patients_of(caller(request))
    return cut(patients.filter(code=wanted.code) if wanted.code else patients, wanted)


@router.post("/patients", response=answers(PatientOut, 409, code=201))
@for_roles(Role.LEAD, Role.PT)
def add_patient(request: HttpRequest, given: PatientGiven) -> Status[Patient]:
    """Take a new patient in."""
    patient = Patient(clinic=clinic_of(caller(request)))
    return Status(201, store(patient, given.model_dump(mode="json", exclude_unset=True)))


@router.get("/patients/{patient_id}", response=answers(PatientOut, 404))
@for_roles(Role.LEAD, Role.PT)
def show_patient(request: HttpRequest, patient_id: Path[Key]) -> Patient:
    """Show a patient."""
    return get_object_or_404(patients_of(caller(request)), pk=patient_id)


@router.patch("/patients/{patient_id}", response=answers(PatientOut, 404, 409))
@for_roles(Role.LEAD, Role.PT)
def change_patient(request: HttpRequest, patient_id: Path[Key], given: PatientChanges) -> Patient:
    """Mend what is written of a patient."""
    patient = get_object_or_404(patients_of(caller(request)), pk=patient_id)
    return store(patient, given.model_dump(mode="json", exclude_unset=True))
