"""docs/where.md leads to the code: every path in it exists, and every name is defined somewhere."""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
# What is asked for or added, and where it stands.
ROWS = [
    re.split(r"[:?] ", line.removeprefix("* "), maxsplit=1)
    for line in (ROOT / "docs" / "where.md").read_text(encoding="utf-8").splitlines()
    if line.startswith("* ")
]
# A path lies in the root, in the app, or beside another one of its row.
PLACES = (ROOT, ROOT / "rehab", ROOT / "rehab" / "sessions")
PATH = re.compile(r"`([\w./<>-]+/|[\w./<>-]+\.(?:py|js|html|css|md))`|\b(docs/[\w.-]+\.md)")
NAME = re.compile(r"`@?(?:\w+\.)*([A-Za-z_]\w+)(?:\(.*?\))?`")
DEFINITION = re.compile(
    r"^\s*(?:(?:async )?def|class|(?:export )?(?:function|const)) (\w+)"
    r"|^\s*(\w+)(?:: [^=\n]+)?(?: =|$)|^\s*(\w+): ",
    re.MULTILINE,
)


@cache
def definitions() -> set[str]:
    """Return all names that code defines, and the modules."""
    files = [
        file
        for folder in ("garry_site", "rehab", "robot", "tests", "static/js", "deploy")
        for suffix in ("*.py", "*.js")
        for file in (ROOT / folder).rglob(suffix)
    ]
    texts = (file.read_text(encoding="utf-8") for file in files)
    found = {name for text in texts for match in DEFINITION.findall(text) for name in match}
    return found | {file.stem for file in files}


def find_dead_ends(row: list[str]) -> list[str]:
    """Return the paths and names of a row that are not there."""
    paths = [re.sub(r"<\w+>[\w.]*", "", a or b) for a, b in PATH.findall(" ".join(row))]
    places = set(PLACES)
    for path in paths:
        for folder in PLACES:
            place = folder / path
            places |= {place, *place.parents[:2]} if place.is_dir() else {place.parent}
    wrong = [path for path in paths if not any((place / path).exists() for place in places)]
    names = NAME.findall(PATH.sub("", " ".join(row[1:])))
    return wrong + [name for name in names if name not in definitions()]


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row[0][:40])
def test_a_row_leads_to_the_code(row):
    assert not find_dead_ends(row)


def test_a_dead_end_is_found():
    assert find_dead_ends(["x", "`rehab/training/valences.py`", "`VALENCES`"]) == []
    assert find_dead_ends(["x", "`training/gone.py`", "docs/gone.md"]) == [
        "training/gone.py",
        "docs/gone.md",
    ]
    assert find_dead_ends(["x", "`rehab/training/valences.py`", "`VALENZEN`"]) == ["VALENZEN"]
