"""What becomes of each field about a patient, declared beside the model's fields.

Every model with a path to a patient has an attribute ``personal``: for each of its fields whether
erasing the patient empties it, and whether it is shown in the patient's own data, exported for
research, and recorded in the change history. Erasure (`rehab.patients.erasure`), the patient's
data, research exports and the history read it; `rehab.checks` names every field without one.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import KW_ONLY, dataclass, replace
from datetime import date
from enum import Enum
from functools import cache
from typing import Any

from django.apps import apps
from django.db.models import Field, Model
from django.utils.functional import Promise

# Empties what belongs to a patient: called with the erased patient and the former pseudonym.
Eraser = Callable[[Any, str], None]


class Erasure(Enum):
    """What erasing a patient does to a field."""

    RETAIN = "retain"
    SET = "set"  # to a value or a database expression
    CALL = "call"  # a function that empties the field where it must
    DELETE = "delete"  # the whole row


@dataclass(frozen=True, slots=True)
class Covariate:
    """A column of research exports that is made from a field of the patient.

    ``value`` returns the cell from the field's value and the day on which the session began.
    ``type`` is one of `rehab.exports.column_definitions.Type`.
    """

    name: str
    unit: str
    meaning: str
    type: str = "text"
    value: Callable[[Any, date], Any] = lambda value, _day: value


@dataclass(frozen=True, slots=True)
class FieldPolicy:
    """What becomes of one field.

    Attributes
    ----------
    erasure, reason, value
        What an erasure does; why a field is retained; the value it is set to, or the `Eraser`.
    shown
        Its name in the patient's own data; True for its own name, False where it is not shown.
    research
        Whether research exports have it, or the covariate that they have instead.
    history
        Whether the change history records its values.
    is_detail
        Whether the patient's form, the admin's and the API have it.
    """

    erasure: Erasure
    _: KW_ONLY
    shown: bool | str
    research: bool | Covariate
    history: bool = False
    is_detail: bool = False
    reason: str = ""
    value: Any = None


def retained(reason: str, **where: Any) -> FieldPolicy:
    """Return the policy of a field that stays as it is, and why it may."""
    return FieldPolicy(Erasure.RETAIN, reason=reason, **where)


def erased(to: Any = None, **where: Any) -> FieldPolicy:
    """Return the policy of a field that is set to a value; a lazy text is translated then."""
    return FieldPolicy(Erasure.SET, value=to, **where)


def erased_by(eraser: Eraser, **where: Any) -> FieldPolicy:
    """Return the policy of a field that a function empties."""
    return FieldPolicy(Erasure.CALL, value=eraser, **where)


def deleted(**where: Any) -> FieldPolicy:
    """Return the policy of the fields of a row that is deleted."""
    return FieldPolicy(Erasure.DELETE, **where)


def personal_fields(groups: Mapping[str, FieldPolicy]) -> dict[str, FieldPolicy]:
    """Return the policy of each field; a key may name several, with blanks between."""
    return {name: policy for names, policy in groups.items() for name in names.split()}


@cache
def paths_to_patient() -> dict[type[Model], str]:
    """Return every model whose rows lead to a patient, with the shortest lookup of the patient.

    The empty lookup is the patient's own.
    """
    paths: dict[type[Model], str] = {apps.get_model("rehab", "Patient"): ""}
    models = apps.get_models(include_auto_created=True)
    while True:
        found = {
            model: "__".join(filter(None, (field.name, paths[field.related_model])))
            for model in models
            for field in reversed(model._meta.concrete_fields)
            if model not in paths and field.related_model in paths
        }
        if not found:
            return paths
        paths |= found


def policies_of(model: type[Model]) -> dict[str, FieldPolicy]:
    """Return a model's declared policies; the rows of a relation have that of the relation."""
    owner: Any = model._meta.auto_created
    if not owner:
        return getattr(model, "personal", {})
    declared: dict[str, FieldPolicy] = getattr(owner, "personal", {})
    name = next(f.name for f in owner._meta.many_to_many if f.remote_field.through is model)
    policy = declared.get(name)
    return {} if policy is None else {f.name: replace(policy) for f in needing_policy(model)}


def needing_policy(model: type[Model]) -> list[Field[Any, Any]]:
    """Return the fields that need a policy: all but the key that the database gives."""
    return [field for field in model._meta.concrete_fields if not field.primary_key]


def find_undeclared() -> Iterator[str]:
    """Yield each field that leads to a patient and has no policy, and each policy of no field."""
    for model in paths_to_patient():
        fields = {field.name for field in needing_policy(model)}
        declared = policies_of(model)
        yield from (f"{model.__name__}.{name}" for name in sorted(fields ^ declared.keys()))


def erased_values(model: type[Model]) -> dict[str, Any]:
    """Return what an erasure sets the fields of a model to."""
    return {
        name: str(policy.value) if isinstance(policy.value, Promise) else policy.value
        for name, policy in policies_of(model).items()
        if policy.erasure is Erasure.SET
    }


def erasers_of(model: type[Model]) -> set[Eraser]:
    """Return the functions that empty fields of a model."""
    policies = policies_of(model).values()
    return {policy.value for policy in policies if policy.erasure is Erasure.CALL}


def describe(row: Model) -> dict[str, Any]:
    """Return the values of a row that are shown in the patient's own data, by name."""
    shown = {
        name if policy.shown is True else str(policy.shown): getattr(row, name)
        for name, policy in policies_of(type(row)).items()
        if policy.shown
    }
    return {
        name: str(value) if isinstance(value, Model) else None if value == "" else value
        for name, value in shown.items()
    }


def covariates(model: type[Model]) -> dict[str, Covariate]:
    """Return the research columns that are made from fields of a model, by field."""
    return {
        name: policy.research
        for name, policy in policies_of(model).items()
        if isinstance(policy.research, Covariate)
    }


def details(model: type[Model]) -> list[str]:
    """Return the fields that people enter on the patient's form, in the admin and by the API."""
    return [name for name, policy in policies_of(model).items() if policy.is_detail]
