"""Triggers that make rows append-only in the database itself, for every client.

Which models, and which few changes are let through, stands in the models
(`rehab.people.append_only`). The triggers are installed after each migration, since SQLite drops a
table's triggers where a migration makes the table anew.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from django.apps import apps
from django.db import connections

from rehab.people.append_only import AppendOnlyModel
from rehab.people.models import Clinic

VENDORS = ("sqlite", "postgresql")
WORDS = "These rows are append-only: add another one. Of logs `retention` deletes what is too old."


def install(using: str, **_: Any) -> None:
    """Install the triggers. A receiver of `post_migrate`."""
    connection = connections[using]
    if connection.vendor not in VENDORS or not _has_tables(connection):
        return
    remove(using)
    with connection.cursor() as cursor:
        for name, event, table, allowed in _rules(connection.vendor):
            for statement in _trigger(connection.vendor, name, event, table, allowed):
                cursor.execute(statement)


def remove(using: str) -> None:
    """Remove the triggers."""
    connection = connections[using]
    with connection.cursor() as cursor:
        for name, _event, table, _allowed in _rules(connection.vendor):
            on = f" ON {table}" if connection.vendor == "postgresql" else ""
            cursor.execute(f"DROP TRIGGER IF EXISTS {name}{on}")


@contextmanager
def lifted(using: str) -> Iterator[None]:
    """Lift the triggers in this block: to restore a backup into an empty installation."""
    remove(using)
    yield
    install(using)


def find_missing(using: str) -> list[str]:
    """Return the names of triggers that are not installed."""
    connection = connections[using]
    query = "SELECT name FROM sqlite_master WHERE type = 'trigger'"
    if connection.vendor == "postgresql":
        query = "SELECT tgname FROM pg_trigger WHERE tgenabled <> 'D'"
    with connection.cursor() as cursor:
        cursor.execute(query)
        there = {name for (name,) in cursor.fetchall()}
    return [name for name, *_ in _rules(connection.vendor) if name not in there]


def guarded_models() -> list[type[AppendOnlyModel]]:
    """Return the models whose rows are only added."""
    return [model for model in apps.get_models() if issubclass(model, AppendOnlyModel)]


def _has_tables(connection: Any) -> bool:
    wanted = {model._meta.db_table for model in guarded_models()}
    return wanted <= set(connection.introspection.table_names())


def _rules(vendor: str) -> Iterator[tuple[str, str, str, str]]:
    """Yield the name, event, table and condition of what is allowed, of each trigger."""
    for model in guarded_models():
        table = model._meta.db_table
        changes = [
            f"({_same(model, fields)} AND {sql if isinstance(sql, str) else sql[vendor]})"
            for fields, sql in model.allowed_changes
        ]
        yield f"garry_{table}_update", "UPDATE", table, " OR ".join(changes) or "1 = 0"
        allowed = f"{model.allowed_deletion} OR {_is_removed(model)}"
        yield f"garry_{table}_delete", "DELETE", table, allowed
        if vendor == "postgresql":
            yield f"garry_{table}_truncate", "TRUNCATE", table, ""


def _is_removed(model: type[AppendOnlyModel]) -> str:
    """Return the condition that the row OLD is of a clinic that is being removed."""
    of_model, key = model, ""
    for name in model.scope.clinic.split("__"):
        field: Any = of_model._meta.get_field(name)
        table = of_model._meta.db_table
        above = f"(SELECT {field.column} FROM {table} WHERE id = {key})"  # noqa: S608
        key = above if key else f"OLD.{field.column}"
        of_model = field.related_model
    return (
        f"EXISTS (SELECT 1 FROM {Clinic._meta.db_table} c "  # noqa: S608  # no stranger's text
        f"WHERE c.id = {key} AND c.removing_at IS NOT NULL)"
    )


def _same(model: type[AppendOnlyModel], but: tuple[str, ...]) -> str:
    """Return the condition that all columns but these stay as they are."""
    columns = [field.column for field in model._meta.concrete_fields if field.name not in but]
    return " AND ".join(f'NEW."{name}" IS NOT DISTINCT FROM OLD."{name}"' for name in columns)


def _trigger(vendor: str, name: str, event: str, table: str, allowed: str) -> Iterator[str]:
    """Yield the statements that make a trigger."""
    if vendor == "sqlite":
        yield (
            f"CREATE TRIGGER {name} BEFORE {event} ON {table} WHEN NOT ({allowed}) "
            f"BEGIN SELECT RAISE(ABORT, '{WORDS}'); END"
        )
        return
    refuse = f"RAISE EXCEPTION '{WORDS}' USING ERRCODE = 'check_violation'"
    body = f"{refuse};" if event == "TRUNCATE" else f"IF NOT ({allowed}) THEN {refuse}; END IF;"
    answer = "NULL" if event == "TRUNCATE" else "OLD" if event == "DELETE" else "NEW"
    each = "STATEMENT" if event == "TRUNCATE" else "ROW"
    yield (
        f"CREATE OR REPLACE FUNCTION {name}() RETURNS trigger LANGUAGE plpgsql AS "
        f"$$ BEGIN {body} RETURN {answer}; END $$"
    )
    yield (
        f"CREATE TRIGGER {name} BEFORE {event} ON {table} FOR EACH {each} EXECUTE FUNCTION {name}()"
    )
