"""Tables for spreadsheets: no text is a formula, and all can be told back."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rehab.exports.archive import write_csv
from rehab.people.web import csv_tables
from rehab.people.web.csv_tables import format_cell
from tests.support.archives import rows_of

# --- cells ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("start", ["=", "+", "-", "@", "\t", "\r", "\n", "'"])
def test_no_text_is_a_formula_and_all_can_be_told_back(start):
    text = f'{start}HYPERLINK("http://example.org")'
    cell = format_cell(text)
    assert cell == f"'{text}"
    assert cell[1:] == text


@pytest.mark.parametrize("start", ["=", "+", "-", "@", "＝", "'"])
@pytest.mark.parametrize("behind", [";", "\t", "\n", "a;b;"])
def test_no_text_is_a_formula_behind_what_splits_a_line_elsewhere(behind, start):
    assert format_cell(f"x{behind}{start}1+1") == f"x{behind}'{start}1+1"
    assert format_cell(f"x{start}1") == f"x{start}1"


@given(st.text(alphabet="=+-@';\t\r\n\"ax, "))
def test_every_quoted_text_is_told_back(text):
    cell = format_cell(text)
    parts = re.split("[;\t\r\n]", cell)
    assert not any(part.startswith(("=", "+", "-", "@")) for part in parts)
    assert re.sub(r"(?:^|(?<=[;\t\r\n]))'(?=[=+\-@\t\r\n'])", "", cell) == text


@given(st.one_of(st.floats(allow_nan=False), st.integers(), st.text(), st.booleans(), st.none()))
def test_any_value_is_read_back_as_it_was(value):
    text = "".join(write_csv(["value", "end"], [(value, "end")]))
    (row,) = rows_of(text)
    cell = row["value"]
    if isinstance(value, str):
        assert cell.replace("'", "") == value.replace("'", "")
        assert not cell.startswith(("=", "+", "-", "@", "\t", "\r", "\n"))
    elif isinstance(value, bool) or value is None:
        assert cell == {True: "true", False: "false", None: ""}[value]
    else:
        assert type(value)(cell) == value


def test_every_table_for_spreadsheets_is_written_in_one_place():
    """So that no new export can forget the quotes. Other modules read CSV, or write no text."""
    root = Path(csv_tables.__file__).parents[2]
    writers = re.compile(r"csv\.writer|DictWriter")
    writing = [file.name for file in root.rglob("*.py") if writers.search(file.read_text())]
    assert writing == ["csv_tables.py"]
