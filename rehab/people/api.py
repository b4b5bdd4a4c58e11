"""API calls about people: the caller, and the clinic's patients (the paper's users)."""

from __future__ import annotations

from datetime import date, datetime
from typing import Annotated, Any, Literal

from django.core.exceptions import ValidationError
from django.core.validators import MaxValueValidator, MinValueValidator
from django.db import IntegrityError, models, transaction
from django.db.models import QuerySet
from django.http import HttpRequest
from django.shortcuts import get_object_or_404
from django.utils.translation import override
from ninja import Field, Path, Query, Router, Schema, Status
from pydantic import BeforeValidator, create_model

from rehab.people.access import clinic_of, for_roles
from rehab.people.field_policy import details
from rehab.people.models import LANGUAGES, Patient, User
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


TYPES: dict[type[models.Field[Any, Any]], Any] = {
    models.CharField: ShortText,
    models.FloatField: float,
    models.PositiveSmallIntegerField: StrictInt,
    models.DateField: date,
}


def type_of_detail(column: Any) -> Any:
    """Return the type of a field that people enter, as the model declares it."""
    if column.choices:
        return Literal[tuple(value for value, _ in column.choices)]
    return TYPES[type(column)]


def describe_input(name: str, *, is_new: bool = False) -> tuple[Any, Any]:
    """Return type and bounds of a patient's field in requests; omitted, a field stays."""
    column: Any = Patient._meta.get_field(name)
    names = {MinValueValidator: "ge", MaxValueValidator: "le"}
    bounds: dict[str, Any] = {
        bound: validator.limit_value
        for validator in column.validators
        for kind, bound in names.items()
        if isinstance(validator, kind)
    }
    if isinstance(column, models.DateField):
        bounds["strict"] = False  # JSON has text
    with override("en"):
        about = str(column.help_text) or None
    type_ = type_of_detail(column)
    is_required = is_new and not column.blank
    default = ... if is_required else None
    return type_ | None if column.null else type_, Field(default, description=about, **bounds)


def describe_output(name: str) -> tuple[Any, Any]:
    """Return the type of a patient's field in responses: null where it is not set."""
    type_ = type_of_detail(Patient._meta.get_field(name))
    return Annotated[type_ | None, BeforeValidator(lambda value: value or None)], ...


DETAILS = details(Patient)
make_schema: Any = create_model
OutputDetails: Any = make_schema(
    "OutputDetails",
    __base__=PatientName,
    **{name: describe_output(name) for name in DETAILS if name not in PatientName.model_fields},
)
InputDetails: Any = make_schema(
    "InputDetails", __base__=RequestBody, **{name: describe_input(name) for name in DETAILS}
)
NewDetails: Any = make_schema(
    "NewDetails",
    __base__=InputDetails,
    **{name: describe_input(name, is_new=True) for name in DETAILS},
)


class PatientOut(OutputDetails):  # type: ignore[misc]
    """A patient."""

    language: str
    simulated: bool
    created_at: datetime


class PatientChanges(InputDetails):  # type: ignore[misc]
    """Changes of a patient; omitted fields stay."""

    language: Language = optional()


class PatientIn(NewDetails, PatientChanges):  # type: ignore[misc]
    """A new patient."""


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
