"""Every field about a patient says what becomes of it, and that is what becomes of it."""

from __future__ import annotations

import logging
import re
from collections.abc import Iterator
from datetime import date, datetime, time
from pathlib import Path
from typing import Any

import pytest
from django.apps import apps
from django.conf import settings
from django.core.management import call_command
from django.db import connection, models
from django.db.models import QuerySet
from django.forms import modelform_factory

from rehab.boards.models import Leaderboard
from rehab.boards.ranking.results import read_results
from rehab.boards.snapshots import BoardSnapshot
from rehab.checks import check_personal_fields
from rehab.exports.export_files import patient_files, session_files
from rehab.patients.erasure import erase
from rehab.people.audit import append_only_triggers
from rehab.people.audit.audit_log import Act, record
from rehab.people.audit.history import HistoryEntry
from rehab.people.field_policy import (
    Erasure,
    FieldPolicy,
    describe,
    details,
    erased,
    find_undeclared,
    needing_policy,
    paths_to_patient,
    policies_of,
)
from rehab.people.models import ErasureReason, Patient
from rehab.people.roles import Role
from rehab.sessions.corrections import CorrectedField, SessionCorrection
from rehab.sessions.log import SessionEvent
from tests.support.world import NOW, World, build_world, fill_board

SECRET = "zqPLANTEDqz"


def test_every_field_that_leads_to_a_patient_says_what_becomes_of_it():
    assert list(find_undeclared()) == []
    assert len(paths_to_patient()) >= 17  # so many models are found
    kept = [p for model in paths_to_patient() for p in policies_of(model).values()]
    assert all(p.reason for p in kept if p.erasure is Erasure.RETAIN)
    for model in paths_to_patient():  # rows are deleted whole
        kinds = {policy.erasure for policy in policies_of(model).values()}
        assert Erasure.DELETE not in kinds or len(kinds) == 1, model


@pytest.fixture
def height(db: None) -> Iterator[models.Field[Any, Any]]:
    """Add a field to patients as a developer would: to the model, and by a migration."""
    field = models.FloatField(null=True, blank=True)
    with connection.cursor() as cursor:
        cursor.execute("ALTER TABLE rehab_patient ADD COLUMN height_cm double precision")
    field.contribute_to_class(Patient, "height_cm")
    yield field
    Patient._meta.local_fields.remove(field)
    Patient._meta._expire_cache()  # type: ignore[attr-defined]  # Django's own way
    del Patient.height_cm  # type: ignore[attr-defined]


def test_a_new_field_is_named_until_it_has_a_policy_and_is_erased_with_one(
    height, world, monkeypatch
):
    (error,) = check_personal_fields()
    assert error.id == "garry.E013"
    assert "Patient.height_cm" in error.msg
    assert "rehab/people/field_policy.py" in str(error.hint)

    policy = erased(shown=True, research=False, history=True, is_detail=True)
    monkeypatch.setitem(Patient.personal, "height_cm", policy)
    assert check_personal_fields() == []
    assert "height_cm" in modelform_factory(Patient, fields=details(Patient)).base_fields
    patient: Any = Patient.everywhere.get(pk=world.patient.pk)
    patient.height_cm = 171.5
    patient.save()
    assert describe(patient)["height_cm"] == 171.5
    change = HistoryEntry.everywhere.filter(model_name="Patient").first()
    assert change.changes == {"height_cm": [None, 171.5]}
    erase(patient, ErasureReason.ASKED, None, NOW)
    patient.refresh_from_db()
    assert patient.height_cm is None
    assert "171.5" not in str(list(HistoryEntry.everywhere.values_list("changes")))


# --- a secret in each field -----------------------------------------------------------------------


def plant_value(field: models.Field[Any, Any], number: int) -> Any:
    """Return a value that is found again; None for a field that cannot hold one."""
    match field:
        case models.JSONField():
            return [f"{SECRET}{number}"]
        case models.CharField() | models.TextField() if not field.choices:
            return f"{SECRET}{number}"
        case models.DateTimeField():
            return datetime(1911, 3, 1 + number % 28, 4, 5, 6, tzinfo=NOW.tzinfo)
        case models.DateField():
            return date(1912, 1 + number % 12, 1 + number % 28)
        case models.TimeField():
            return time(3, 7, 11)
        case models.BigIntegerField():
            return 918_273_600_000 + number
        case models.PositiveSmallIntegerField():
            return 1907
        case models.IntegerField() if field.name != "figure":  # counts of boards must agree with it
            return 91_827_360 + number
        case models.FloatField():
            return 173.0625 + number
        case _:
            return None


def plant(world: World) -> dict[str, str]:
    """Put a secret into each field that an erasure empties; return them as text, by field."""
    planted: dict[str, str] = {}
    for model, path in paths_to_patient().items():
        rows: QuerySet[Any] = QuerySet(model).filter(**{path or "pk": world.patient.pk})
        key = rows.values_list("pk", flat=True).order_by("pk").first()
        assert key is not None, f"The world has no {model.__name__} of its patient. Add one."
        values: dict[str, Any] = {}
        for field in needing_policy(model):
            policy = policies_of(model)[field.name]
            if policy.erasure is Erasure.RETAIN or field.is_relation:
                continue
            value = plant_value(field, len(planted))
            if value is not None:
                limit = field.max_length or 64
                values[field.name] = value[-limit:] if isinstance(value, str) else value
                text = f"{value:%Y-%m-%d}" if isinstance(value, datetime) else str(value)
                planted[f"{model.__name__}.{field.name}"] = text.strip("[]'")[-limit:]
        if model is SessionCorrection:
            values["field"] = CorrectedField.NOTE
        if model is SessionEvent:
            values["kind"] = "pain"
        if model is Patient:  # by a save, so that the history has it
            patient = Patient.everywhere.get(pk=key)
            for name, value in values.items():
                setattr(patient, name, value)
            patient.save()
        elif values:
            QuerySet(model).filter(pk=key).update(**values)
    return planted


def policy_of(name: str) -> FieldPolicy:
    model, field = name.split(".")
    return next(policies_of(m)[field] for m in paths_to_patient() if m.__name__ == model)


def everything() -> Iterator[tuple[str, str]]:
    """Yield all that is stored: each table's rows, and each file of the data folder."""
    with connection.cursor() as cursor:
        for table in connection.introspection.table_names():
            cursor.execute(f'SELECT * FROM "{table}"')  # noqa: S608  # no stranger's name
            yield table, "\n".join("|".join(map(str, row)) for row in cursor.fetchall())
    places = [Path(settings.DATA_DIR)]
    if connection.vendor == "sqlite":
        places.append(Path(connection.settings_dict["NAME"]).parent)
    for file in (file for place in places for file in place.rglob("*") if file.is_file()):
        yield str(file), file.read_bytes().decode("latin-1")


def text_of(files: Iterator[tuple[str, Any]]) -> Iterator[tuple[str, str]]:
    """Yield the files of an archive as text."""
    for name, parts in files:
        yield name, "".join(p if isinstance(p, str) else bytes(p).decode() for p in parts)


def own_data(world: World) -> Iterator[tuple[str, str]]:
    patient = Patient.everywhere.get(pk=world.patient.pk)
    return text_of(patient_files(world.people[Role.LEAD], patient, NOW))


def research_data(world: World) -> Iterator[tuple[str, str]]:
    return text_of(session_files(world.people[Role.RESEARCHER], NOW))


def found_in(planted: dict[str, str], places: Iterator[tuple[str, str]]) -> set[str]:
    """Return which secrets are in which places; a year within a digest's digits is none."""
    return {
        f"{field} in {place}"
        for place, text in places
        for field, secret in planted.items()
        if secret in text and re.search(rf"(?<![0-9a-f]){re.escape(secret)}(?![0-9a-f])", text)
    }


@pytest.mark.django_db(transaction=True)
def test_what_is_erased_is_found_in_no_table_file_log_or_archive(tmp_path, caplog):
    caplog.set_level(logging.INFO)
    world = build_world("amber")
    fill_board(world)
    record(Act.VIEW, world.people[Role.PT], patient_id=world.patient.pk, now=NOW)
    with append_only_triggers.lifted("default"):
        planted = plant(world)
    assert len(planted) >= 25
    before = found_in(planted, everything())
    assert {where.split(" in ")[0] for where in before} == planted.keys()  # all can be found
    shown = {where.split(" in ")[0] for where in found_in(planted, own_data(world))}
    assert shown == {name for name in planted if policy_of(name).shown}
    exported = {where.split(" in ")[0] for where in found_in(planted, research_data(world))}
    assert exported == {name for name in planted if policy_of(name).research is True}

    erase(
        Patient.everywhere.get(pk=world.patient.pk),
        ErasureReason.ASKED,
        world.people[Role.LEAD],
        NOW,
    )
    assert found_in(planted, everything()) == set()
    assert found_in(planted, own_data(world)) == set()
    assert found_in(planted, research_data(world)) == set()
    assert found_in(planted, iter([("log", caplog.text)])) == set()
    call_command("dumpdata", "--all", output=str(tmp_path / "dump.json"))
    assert found_in(planted, iter([("dump", (tmp_path / "dump.json").read_text())])) == set()


# --- keys without a relation ----------------------------------------------------------------------


def test_no_other_column_holds_a_patients_key_than_the_boards_own():
    """It is a number of a row that is anonymous once erased, and deleted within days."""
    plain = {
        f"{model.__name__}.{field.name}"
        for model in apps.get_models()
        for field in model._meta.concrete_fields
        if "patient" in field.name and not field.is_relation
    }
    assert plain == {"BoardChange.patient_key"}


def test_an_erased_patient_leaves_frozen_boards(world):
    fill_board(world)
    board = world.rows[Leaderboard]
    rows = list(read_results(board, NOW))
    BoardSnapshot.everywhere.filter(board=board).update(results=rows)
    assert world.patient.pk in {row.patient_id for row in rows}
    erase(world.patient, ErasureReason.ASKED, None, NOW)
    left = BoardSnapshot.everywhere.get(board=board).to_results()
    assert {row.patient_id for row in left} == {row.patient_id for row in rows} - {world.patient.pk}
