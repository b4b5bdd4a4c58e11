"""What REDCap and jamovi take: fields, validations and cells of the same columns as our CSV."""

from __future__ import annotations

import csv
import io
import json
import math
import re
import struct
from pathlib import Path
from typing import Any
from zipfile import ZipFile

import pytest

from rehab.exports.column_definitions import Column
from rehab.exports.research.jamovi import write_omv
from rehab.exports.research.redcap import COLUMNS, DICTIONARY
from rehab.exports.research.resumable_export import Package
from rehab.people.roles import Role
from tests.support.studies import enrolled, new_patient, running_study
from tests.support.trials import walk_visit
from tests.support.world import NOW

pytestmark = pytest.mark.django_db
HEADER = (
    'Variable / Field Name,Form Name,Section Header,Field Type,Field Label,"Choices, Calculations, '
    'OR Slider Labels",Field Note,Text Validation Type OR Show Slider Number,Text Validation Min,'
    "Text Validation Max,Identifier?,Branching Logic (Show field only if...),Required Field?,"
    "Custom Alignment,Question Number (surveys only),Matrix Group Name,Matrix Ranking?,"
    "Field Annotation"
)
VALID = {
    "": r"(?s).*",
    "integer": r"-?\d+",
    "number": r"-?\d+(\.\d+)?",
    "date_ymd": r"\d{4}-\d\d-\d\d",
    "datetime_seconds_ymd": r"\d{4}-\d\d-\d\d \d\d:\d\d:\d\d",
}


@pytest.fixture
def files(world, tmp_path: Path) -> dict[str, bytes]:
    study = running_study(world)
    walk_visit(enrolled(study, new_patient(world)))
    package = Package.create(
        tmp_path / "export", world.people[Role.LEAD], None, shift_dates=False, now=NOW
    )
    list(package.advance(1e9))
    return {
        name: b"".join(p.encode() if isinstance(p, str) else p for p in pieces)
        for name, pieces in package.files()
    }


def rows_of(files: dict[str, bytes], name: str) -> list[dict[str, str]]:
    return list(csv.DictReader(io.StringIO(files[name].decode(), newline="")))


def test_redcap_knows_each_field_and_every_cell_is_one_that_it_accepts(files):
    assert next(csv.reader([HEADER])) == list(DICTIONARY)
    fields = rows_of(files, "redcap/dictionary.csv")
    assert len(DICTIONARY) == len(fields[0]) == 18
    names = [one["Variable / Field Name"] for one in fields]
    assert names == [column.name for column in COLUMNS]
    assert len(names) == len(set(names))
    assert all(re.fullmatch(r"[a-z][a-z0-9_]{0,99}", name) for name in names)
    data, plain = rows_of(files, "redcap/data.csv"), rows_of(files, "sessions.csv")
    assert list(data[0]) == names
    assert [row["session"] for row in data] == [row["session"] for row in plain]
    for field in fields:
        kind, name = field["Text Validation Type OR Show Slider Number"], field[DICTIONARY[0]]
        pattern = "[01]" if field["Field Type"] == "truefalse" else VALID[kind]
        assert all(re.fullmatch(pattern, row[name]) for row in data if row[name]), name
    walked = rows_of(files, "study_visits.csv")
    assert [row["participant"] for row in data if row["participant"]] == [
        row["participant"] for row in walked
    ]


def read_omv(content: bytes) -> dict[str, list[object]]:
    """Return the columns of an .omv file, read as jamovi reads it."""
    with ZipFile(io.BytesIO(content)) as archive:
        assert archive.testzip() is None
        assert b"jamovi-Archive-Version: 11.0" in archive.read("meta")
        about = json.loads(archive.read("metadata.json"))["dataSet"]
        labels = json.loads(archive.read("xdata.json"))
        data = io.BytesIO(archive.read("data.bin"))
    found: dict[str, list[object]] = {}
    for field in about["fields"]:
        code = {"number": "d", "integer": "i"}[field["type"]]
        form = f"<{about['rowCount']}{code}"
        cells: list[object] = [
            None if cell == -(2**31) or math.isnan(cell) else cell
            for cell in struct.unpack(form, data.read(struct.calcsize(form)))
        ]
        if field["name"] in labels:
            words = {one[0]: one[1] for one in labels[field["name"]]["labels"]}
            cells = [None if cell is None else words[cell] for cell in cells]
        found[field["name"]] = cells
    assert not data.read()
    return found


def test_jamovi_reads_the_same_cells(files):
    found, plain = read_omv(files["jamovi/sessions.omv"]), rows_of(files, "sessions.csv")
    assert list(found) == [column.name for column in COLUMNS]
    for name in plain[0]:
        for cell, text in zip(found[name], (row[name] for row in plain), strict=True):
            read: Any = type(cell)
            assert cell == (None if text == "" else read(text)) or name.endswith("_at"), name


def test_an_omv_has_missing_cells_and_whole_numbers_that_are_too_large_for_it():
    columns = (
        Column.integer("few", "Few.", unit="steps"),
        Column.integer("many", "Many."),
        Column.number("share", "%", "A share."),
        Column.flag("is_it", "Whether."),
        Column("word", "A word."),
    )
    rows: list[list[Any]] = [[1, 2**40, 0.5, True, "b"], [None] * 5, [-7, 1, -1e-9, False, "ä"]]
    assert read_omv(write_omv(columns, rows)) == {
        "few": [1, None, -7],
        "many": [2.0**40, None, 1.0],
        "share": [0.5, None, -1e-9],
        "is_it": ["true", None, "false"],
        "word": ["b", None, "ä"],
    }
