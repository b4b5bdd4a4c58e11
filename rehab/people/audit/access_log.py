"""What a request showed of patients, told to the audit log once it has been answered.

Whatever people, tablets and programs open counts, unless it says `patients=False` (`for_roles`) or
is an admin page of a model that leads to no patient. So a new page is noted without being told to.
"""

from __future__ import annotations

from datetime import datetime
from functools import cache
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

# Parameters of addresses: the model that they name a row of, by what, and its patient.
SUBJECTS = {
    "patient_id": ("Patient", "pk", "pk"),
    "code": ("Patient", "code", "pk"),
    "session_id": ("TrainingSession", "pk", "patient_id"),
}
NO_PATIENTS = {"login", "logout", "jsi18n", "password_change", "password_change_done"}  # of admin


def note_request(request: HttpRequest, response: HttpResponseBase, now: datetime) -> None:
    """Note what was shown or changed, once in some minutes for what is only shown."""
    match, actor = request.resolver_match, _actor_of(request)
    if actor is None or match is None or response.status_code >= 400 or not _shows(request, match):
        return
    reads = request.method in ("GET", "HEAD", "OPTIONS")
    if reads and response.status_code != 200:
        return  # nothing there, or sent on: nothing was shown
    about = match.route if "code" in match.kwargs else request.path
    who = (type(actor).__name__, actor.pk, getattr(actor, "program", ""))
    if reads and not audit_log.recent.is_new((*who, match.view_name, request.path), now):
        return
    entry = audit_log.compose(
        Act.VIEW if reads else Act.CHANGE,
        actor,
        patient=find_patient(match, actor.clinic_id),
        about=about,
        address=client_address(request),
        now=now,
    )
    audit_log.try_to_keep([entry])


def _actor_of(request: HttpRequest) -> Any:
    """Give the program, person or tablet that asked; None for a stranger."""
    user = getattr(request, "auth", None) or request.user
    return user if user.is_authenticated else getattr(request, "tablet", None)


def _shows(request: HttpRequest, match: ResolverMatch) -> bool:
    """Whether an address may have shown anything of patients."""
    if match.app_names == ["admin"]:
        model = _model_of(match)
        return match.url_name not in NO_PATIENTS and (model is None or leads_to_patients(model))
    opened = getattr(request, "call", match.func)  # a call of the API, or a page
    return bool(getattr(opened, "access", None)) and getattr(opened, "patients", True)


def _model_of(match: ResolverMatch) -> type[Model] | None:
    """Give the model of an admin page; None for pages of no model."""
    words = (match.url_name or "").split("_")
    try:
        return apps.get_model(words[0], words[1])
    except (LookupError, IndexError):
        return None


@cache
def leads_to_patients(model: type[Model]) -> bool:
    """Whether a model is the patient's, or its rows point to one that is."""
    if model in (Patient, HistoryEntry):  # whose values may be a patient's
        return True
    related = {
        field.related_model
        for field in (*model._meta.concrete_fields, *model._meta.many_to_many)
        if isinstance(field.related_model, type) and field.related_model is not model
    }
    return any(leads_to_patients(other) for other in related)


def find_patient(match: ResolverMatch, clinic: int | None) -> int | None:
    """Give the key of the patient that an address names; None for a list of several."""
    for name, value in match.kwargs.items():
        if name in SUBJECTS:
            noun, by, key = SUBJECTS[name]
            return _read(apps.get_model("rehab", noun), key, clinic=clinic, **{by: value})
    model, row = _model_of(match), str(match.kwargs.get("object_id", ""))
    if model is None or not row.isdecimal():
        return None
    names = {field.name for field in model._meta.concrete_fields}
    path = "pk" if model is Patient else "patient_id" if "patient" in names else ""
    path = path or ("session__patient_id" if "session" in names else "")
    return _read(model, path, pk=row) if path else None


def _read(model: type[Any], path: str, **by: Any) -> int | None:
    found: int | None = model.everywhere.filter(**by).values_list(path, flat=True).first()
    return found
