"""Records in the audit log what a request showed of patients, after it has been answered.

Every page and call that people, tablets and programs open counts, unless it is declared with
`patients=False` (`for_roles`) or is an admin page of a model without relation to a patient. So new
pages are recorded by default.
"""

from __future__ import annotations

from datetime import datetime
from functools import cache
from itertools import starmap
from typing import Any

from django.apps import apps
from django.db.models import Model
from django.http import HttpRequest, HttpResponseBase
from django.urls import ResolverMatch

from rehab.people.audit import audit_log
from rehab.people.audit.audit_log import Act
from rehab.people.audit.history import HistoryEntry
from rehab.people.models import Patient
from rehab.people.networks import client_address

# URL parameter: the model it identifies, by which field, and the lookup of the patient.
SUBJECTS = {
    "patient_id": ("Patient", "pk", "pk"),
    "code": ("Patient", "code", "pk"),
    "enrollment_id": ("Enrollment", "pk", "patient_id"),
    "session_id": ("TrainingSession", "pk", "patient_id"),
    "incident_id": ("RobotIncident", "pk", "session__patient_id"),
    "link_id": ("FamilyLink", "pk", "patient_id"),
}
ADMIN_PAGES_WITHOUT_PATIENTS = {
    "login",
    "logout",
    "jsi18n",
    "password_change",
    "password_change_done",
}


def record_request(request: HttpRequest, response: HttpResponseBase, now: datetime) -> None:
    """Record what was shown or changed; repeated views once in some minutes."""
    match, actor = request.resolver_match, _actor_of(request)
    if (
        actor is None
        or match is None
        or (response.status_code >= 400 and response.status_code != 403)
    ):
        return
    if response.status_code == 403:
        _record_refusal(request, actor, now)
        return
    if actor.clinic_id is None or not _may_show_patients(request, match):
        return  # hosts see no patients
    is_read = request.method in ("GET", "HEAD", "OPTIONS")
    if is_read and response.status_code != 200:
        return  # not modified or redirected: nothing was shown
    about = match.route if "code" in match.kwargs else request.path
    who = (type(actor).__name__, actor.pk, getattr(actor, "program", ""))
    if is_read and not audit_log.recent_views.is_new((*who, match.view_name, request.path), now):
        return
    entry = audit_log.build_entry(
        Act.VIEW if is_read else Act.CHANGE,
        actor,
        patient_id=find_patient_id(match, actor.clinic_id),
        about=about,
        address=client_address(request),
        now=now,
    )
    audit_log.record_after_the_fact([entry])


def _record_refusal(request: HttpRequest, actor: Any, now: datetime) -> None:
    """Record that somebody asked for what is not theirs; the same again is counted.

    The route says which page it was: the address itself may name a person.
    """
    match, address = request.resolver_match, client_address(request)
    about = f"/{match.route}" if match is not None else ""
    entry = audit_log.build_entry(Act.REFUSED, actor, about=about, address=address, now=now)
    audit_log.record_counted(entry)


def _actor_of(request: HttpRequest) -> Any:
    """Return the program, person or tablet behind a request; None for a stranger."""
    user = getattr(request, "auth", None) or request.user
    return user if user.is_authenticated else getattr(request, "tablet", None)


def _may_show_patients(request: HttpRequest, match: ResolverMatch) -> bool:
    """Return whether a page or call may have shown data of patients."""
    if match.app_names == ["admin"]:
        model = _model_of(match)
        return match.url_name not in ADMIN_PAGES_WITHOUT_PATIENTS and (
            model is None or leads_to_patients(model)
        )
    view = getattr(request, "call", match.func)  # a call of the API, or a page
    return bool(getattr(view, "access", None)) and getattr(view, "patients", True)


def _model_of(match: ResolverMatch) -> type[Model] | None:
    """Return the model of an admin page; None for pages of no model."""
    parts = (match.url_name or "").split("_")
    try:
        return apps.get_model(parts[0], parts[1])
    except (LookupError, IndexError):
        return None


@cache
def leads_to_patients(model: type[Model]) -> bool:
    """Return whether a model is the patient's or refers to it, directly or not."""
    if model in (Patient, HistoryEntry):  # its values may be a patient's
        return True
    related = {
        field.related_model
        for field in (*model._meta.concrete_fields, *model._meta.many_to_many)
        if isinstance(field.related_model, type) and field.related_model is not model
    }
    return any(leads_to_patients(other) for other in related)


def _read_parameter(name: str, value: Any) -> tuple[str, Any]:
    """Return a URL parameter; of a FHIR id (figure-2-score) the patient or session it names."""
    if name != "fhir_id":
        return name, value
    noun, _between, rest = str(value).partition("-")
    key = rest.partition("-")[0]
    if not key.isdecimal():  # the device: nobody's
        return "", ""
    return "patient_id" if noun == "patient" else "session_id", key


def find_patient_id(match: ResolverMatch, clinic_id: int | None) -> int | None:
    """Return the key of the patient of this clinic that a page shows; None for several or none."""
    for name, value in starmap(_read_parameter, match.kwargs.items()):
        if name in SUBJECTS:
            model_name, by, path = SUBJECTS[name]
            return _find_key(apps.get_model("rehab", model_name), path, clinic_id, **{by: value})
    model, row = _model_of(match), str(match.kwargs.get("object_id", ""))
    if model is None or not row.isdecimal():
        return None
    names = {field.name for field in model._meta.concrete_fields}
    path = "pk" if model is Patient else "patient_id" if "patient" in names else ""
    path = path or ("session__patient_id" if "session" in names else "")
    return _find_key(model, path, clinic_id, pk=row) if path else None


def _find_key(model: type[Any], path: str, clinic_id: int | None, **by: Any) -> int | None:
    rows = model.everywhere.filter(**by, **{model.scope.clinic: clinic_id})
    found: int | None = rows.values_list(path, flat=True).first()
    return found
