"""One vocabulary: the glossary has each term once, and docstrings begin alike."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
# What docstrings once began with, in place of "Return", "Format", "Check", …
PRIVATE_MOODS = re.compile(r"(Gives?|Says?)\b")


def test_the_glossary_has_each_term_once() -> None:
    text = (ROOT / "CONTRIBUTING.md").read_text()
    glossary = text[text.index("## Glossary") : text.index("## Tests")]
    rows = re.findall(r"^\* \*\*(.+?)\*\*: ", glossary, re.MULTILINE)
    assert len(rows) > 50
    assert len(rows) == len(set(rows))


@pytest.mark.parametrize("package", ["garry_site", "rehab", "robot"])
def test_docstrings_begin_as_everywhere(package: str) -> None:
    found = [
        f"{file.relative_to(ROOT)}: {text.splitlines()[0]}"
        for file in sorted((ROOT / package).rglob("*.py"))
        for node in ast.walk(ast.parse(file.read_text()))
        if isinstance(node, ast.AsyncFunctionDef | ast.FunctionDef | ast.ClassDef | ast.Module)
        and (text := ast.get_docstring(node))
        and PRIVATE_MOODS.match(text)
    ]
    assert not found, "\n".join(found)
