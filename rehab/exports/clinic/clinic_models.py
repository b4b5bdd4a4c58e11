"""The tables that belong to a clinic: of every model with a path to it, and how its keys travel."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import cache, partial
from graphlib import TopologicalSorter
from typing import Any

from django.apps import apps
from django.db.models import Model

from rehab.people.audit.history import translate_entry
from rehab.people.audit.moves import Translate
from rehab.people.audit.seals import sealed_models

# Models whose rows stay behind, and why.
STAYS = {
    "admin.logentry": "the admin's latest clicks; the change history has the values",
    "rehab.boardchange": "what caches of this installation have to forget, for a day",
    "rehab.clinicowner": "which process has the clinic here",
    "rehab.endpoint": "whom this installation notifies, with secrets under its own key",
    "rehab.outboxmessage": "what this installation has sent, or still has to",
    "rehab.pairing": "tablets that wait some minutes for approval here",
    "rehab.pinattempts": "failed attempts at this installation",
    "rehab.recoverycode": "hashed with the account's number here; an app or passkey makes new ones",
    "rehab.resetrequest": "what hosts of this installation ask for",
    "rehab.signinattempts": "failed attempts at this installation",
    "rehab.user_groups": "Django's own rights, which decide nothing here",
    "rehab.user_user_permissions": "Django's own rights, which decide nothing here",
}


@cache
def clinic_paths() -> dict[type[Model], str]:
    """Return every model whose rows belong to a clinic, with the lookup of the clinic.

    By its scope where it has one; relations and other apps' models by the row that they refer to.
    """
    models = apps.get_models(include_auto_created=True)
    paths: dict[type[Model], str] = {
        model: model.scope.clinic for model in models if hasattr(model, "scope")
    }
    while found := {
        model: f"{field.name}__{paths[field.related_model]}"
        for model in models
        for field in reversed(model._meta.concrete_fields)
        if model not in paths and field.related_model in paths
    }:
        paths |= found
    return paths


@cache
def moving_models() -> list[type[Model]]:
    """Return the models whose rows move, each after those that it refers to."""
    return [model for model in _sorted_models() if model._meta.label_lower not in STAYS]


def removed_models() -> list[type[Model]]:
    """Return all models of a clinic's rows, each before those that it refers to."""
    return _sorted_models()[::-1]


@cache
def _sorted_models() -> list[type[Model]]:
    graph: TopologicalSorter[type[Model]] = TopologicalSorter()
    for model in sorted(clinic_paths(), key=lambda one: one._meta.label_lower):
        related: list[Any] = [field.related_model for field in model._meta.concrete_fields]
        graph.add(model, *(other for other in related if other in clinic_paths()))
    return list(graph.static_order())


class Table:
    """A model's rows as lists of values, in the order of ``names``."""

    def __init__(self, model: type[Model]) -> None:
        self.model, self.label = model, model._meta.label_lower
        self.fields: list[Any] = list(model._meta.concrete_fields)
        self.names = [field.attname for field in self.fields]
        kinds = [field.get_internal_type() for field in self.fields]
        self.json = [n for n, kind in enumerate(kinds) if kind == "JSONField"]
        self._keys = [
            (n, model if field.primary_key else field.related_model)
            for n, field in enumerate(self.fields)
            if field.primary_key or field.is_relation
        ]
        self._more = MORE_KEYS.get(self.label)

    def order(self) -> tuple[str, ...]:
        """Return the fields that its rows are read by: by an index, also of a billion steps."""
        has_session = "session_id" in self.names and self.label != "rehab.sessionseal"
        return ("session_id", "pk") if has_session else ("pk",)

    def translate(self, row: list[Any], translate: Translate) -> None:
        """Translate all keys of a row."""
        if self._more is not None:
            self._more(self, row, translate)
        for n, related in self._keys:
            if row[n] is not None:
                row[n] = translate(related, row[n])

    def index(self, name: str) -> int:
        """Return the place of a column."""
        return self.names.index(name)


@cache
def table_of(model: type[Model]) -> Table:
    """Return a model's table."""
    return Table(model)


def moving_tables() -> Iterator[Table]:
    """Yield the tables whose rows move, each after those that it refers to."""
    return map(table_of, moving_models())


def _translate_history(table: Table, row: list[Any], translate: Translate) -> None:
    name, number, changes = map(table.index, ("model_name", "object_id", "changes"))
    row[number], row[changes] = translate_entry(row[name], row[number], row[changes], translate)


def _translate_seal(table: Table, row: list[Any], translate: Translate) -> None:
    model = sealed_models()[row[table.index("log")]]
    for name in ("first_id", "last_id"):
        row[table.index(name)] = translate(model, row[table.index(name)])


def _translate_snapshot(table: Table, row: list[Any], translate: Translate) -> None:
    patient, session = (
        partial(translate, apps.get_model("rehab", name)) for name in ("Patient", "TrainingSession")
    )
    n = table.index("results")
    row[n] = [
        [patient(who), session(walked), *rest, [*key[:-1], session(key[-1])]]
        for who, walked, *rest, key in row[n]  # a `Result`, whose key ends with its session
    ]


# Keys in columns that are no relations.
MORE_KEYS: dict[str, Callable[[Table, list[Any], Translate], None]] = {
    "rehab.historyentry": _translate_history,
    "rehab.logseal": _translate_seal,
    "rehab.boardsnapshot": _translate_snapshot,
}
