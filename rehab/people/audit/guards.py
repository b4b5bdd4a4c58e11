"""Triggers that keep the logs append-only in the database itself, whoever asks it.

Two ways are left open. Erasing a patient empties a row's values and removes its salt: the digest
stays. Retention deletes the rows of a batch whose seal says that it is cut. Until its seal an
entry's count may grow. They are installed after each migration, since SQLite drops a table's
triggers where a migration makes the table anew.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from django.db import connections, models

from rehab.people.audit.audit_log import AuditEntry
from rehab.people.audit.history import HistoryEntry
from rehab.people.audit.seals import LogSeal

ERASED = "NEW.erased AND NEW.salt = ''"
WORDS = "The logs are append-only. manage.py retention deletes what is too old."
EMPTIED = {  # the values of a change are all null
    "sqlite": "NOT EXISTS (SELECT 1 FROM json_each(NEW.changes) WHERE type <> 'null')",
    "postgresql": "NOT EXISTS (SELECT 1 FROM jsonb_each(NEW.changes) WHERE value <> 'null'::jsonb)",
}


def install(using: str, **_: Any) -> None:
    """Install the triggers. A receiver of `post_migrate`."""
    connection = connections[using]
    if connection.vendor not in EMPTIED or not _has_tables(connection):
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


def _has_tables(connection: Any) -> bool:
    wanted = {model._meta.db_table for model in (AuditEntry, HistoryEntry, LogSeal)}
    return wanted <= set(connection.introspection.table_names())


def _rules(vendor: str) -> Iterator[tuple[str, str, str, str]]:
    """Yield the name, event, table and condition of what is allowed, of each trigger."""
    audit, history, seal = (m._meta.db_table for m in (AuditEntry, HistoryEntry, LogSeal))
    unsealed = f"NOT EXISTS ({_seal_of(AuditEntry, 's.last_id >= OLD.id')})"
    counted = f"{_same(AuditEntry, 'count')} AND NEW.count > OLD.count AND {unsealed}"
    anonymized = (
        f"{_same(AuditEntry, 'patient', 'about', 'salt', 'erased')} AND {ERASED} "
        "AND NEW.patient_id IS NULL AND NEW.about = ''"
    )
    emptied = f"{_same(HistoryEntry, 'changes', 'salt', 'erased')} AND {ERASED} AND "
    cut = f"{_same(LogSeal, 'cut_at')} AND OLD.cut_at IS NULL AND NEW.cut_at IS NOT NULL"
    yield "garry_audit_update", "UPDATE", audit, f"({counted}) OR ({anonymized})"
    yield "garry_history_update", "UPDATE", history, emptied + EMPTIED[vendor]
    yield "garry_seal_update", "UPDATE", seal, cut
    covered = "OLD.id BETWEEN s.first_id AND s.last_id AND s.cut_at IS NOT NULL"
    yield "garry_audit_delete", "DELETE", audit, f"EXISTS ({_seal_of(AuditEntry, covered)})"
    yield "garry_history_delete", "DELETE", history, f"EXISTS ({_seal_of(HistoryEntry, covered)})"
    yield "garry_seal_delete", "DELETE", seal, "1 = 0"
    if vendor == "postgresql":
        for table in (audit, history, seal):
            yield f"garry_{table}_truncate", "TRUNCATE", table, ""


def _seal_of(model: type[models.Model], condition: str) -> str:
    """Return a query for the seals of a row's chain."""
    return (
        f"SELECT 1 FROM {LogSeal._meta.db_table} s WHERE s.log = '{model.__name__}' "  # noqa: S608
        f"AND s.clinic_id IS NOT DISTINCT FROM OLD.clinic_id AND {condition}"
    )


def _same(model: type[models.Model], *but: str) -> str:
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
