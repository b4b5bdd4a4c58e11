"""Rows of all clinics that a clinic refers to: at its new place they are found, or copied."""

from __future__ import annotations

from typing import Any

from django.apps import apps
from django.db.models import Model

from rehab.exports.clinic.row_serialization import shared_references
from rehab.sessions.setup.protocol_models import MeasureDefinition, Protocol, ProtocolPhase

NAMES = {"rehab.measuredefinition": "slug", "rehab.protocol": "name"}


def describe_shared(clinic_id: int) -> list[dict[str, Any]]:
    """Return the shared rows that a clinic refers to, with all that they consist of."""
    return [
        {"model": label, "key": row.pk} | _describe(row)
        for label, keys in shared_references(clinic_id).items()
        for row in apps.get_model(label)._base_manager.filter(pk__in=keys).order_by("pk")
    ]


def _describe(row: Any) -> dict[str, Any]:
    phases = row.phases.order_by("position") if isinstance(row, Protocol) else []
    return {"row": _values(row), "phases": [_values(phase) for phase in phases]}


def _values(row: Model) -> dict[str, Any]:
    left_out = ("id", "clinic_id", "protocol_id", "created_at")
    names = [field.attname for field in row._meta.concrete_fields]
    return {name: getattr(row, name) for name in names if name not in left_out}


def place_shared(
    shared: list[dict[str, Any]], clinic_id: int, shifts: dict[str, int]
) -> dict[str, dict[str, Any]]:
    """Return by model which row here takes the place of each; ``copied``: keys of new rows.

    A row that is another one here is copied as the clinic's own.
    """
    found: dict[str, dict[str, Any]] = {"copied": {}}
    for one in shared:
        label, model = one["model"], apps.get_model(one["model"])
        name = NAMES[label]
        here = model._base_manager.filter(clinic=None, **{name: one["row"][name]}).first()
        if here is not None and _describe(here) == {"row": one["row"], "phases": one["phases"]}:
            found.setdefault(label, {})[str(one["key"])] = here.pk
            continue
        key = one["key"] + shifts[label]
        copy = model(pk=key, clinic_id=clinic_id, **one["row"])
        model._base_manager.bulk_create([copy])  # no entry in the history: nobody changed it
        phases = [ProtocolPhase(protocol_id=key, **values) for values in one["phases"]]
        ProtocolPhase.everywhere.bulk_create(phases)
        found["copied"].setdefault(label, []).append(key)
    return found


assert set(NAMES) == {MeasureDefinition._meta.label_lower, Protocol._meta.label_lower}  # noqa: S101
