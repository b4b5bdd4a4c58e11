"""One vocabulary: the glossary has its terms, and replaced names do not come back."""

from __future__ import annotations

import ast
import re
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
TERMS = (
    "A2",
    "activated",
    "activation threshold",
    "alias",
    "audit log",
    "band",
    "control",
    "cue",
    "excluded",
    "feedback type",
    "fold",
    "gesture",
    "goal",
    "hit",
    "initial contact",
    "latch",
    "legacy",
    "log",
    "measure",
    "nonparetic",
    "paretic",
    "performance",
    "phase",
    "plan",
    "protocol",
    "pseudonym",
    "scope",
    "session",
    "shown",
    "source",
    "station",
    "step",
    "stride",
    "target hit rate",
    "terminal contact",
    "tombstone",
    "valence",
    "value",
    "window",
)
# What docstrings once began with, in place of "Return", "Format", "Check", …
PRIVATE_MOODS = re.compile(r"(Gives?|Says?)\b")


def read_replaced() -> tuple[dict[str, list[str]], list[str]]:
    """Return the replaced names of each module, and the modules that are gone."""
    text = (ROOT / "tests/replaced_names.txt").read_text()
    text = re.sub(r"\n +", " ", text)
    lines = [line for line in text.splitlines() if line and not line.startswith("#")]
    names = dict(line.split(": ", 1) for line in lines if ":" in line)
    gone = [line for line in lines if ":" not in line]
    return {module: found.split() for module, found in names.items()}, gone


REPLACED, GONE = read_replaced()


def resolves(module: object, qualified: str) -> bool:
    """Whether a module has this attribute, that of a class with a dot."""
    found = module
    for name in qualified.split("."):
        if not hasattr(found, name):
            return False
        found = getattr(found, name)
    return True


@pytest.mark.parametrize("module", REPLACED)
def test_replaced_names_do_not_resolve(module: str) -> None:
    loaded = import_module(module)
    assert not [name for name in REPLACED[module] if resolves(loaded, name)]


def test_replaced_modules_are_gone() -> None:
    assert len(GONE) > 50
    assert not [module for module in GONE if has_module(module)]


def has_module(name: str) -> bool:
    """Whether a module can be found, whatever becomes of its parents."""
    try:
        return find_spec(name) is not None
    except ModuleNotFoundError:
        return False


def test_names_that_are_there_are_found() -> None:
    scope = import_module("rehab.people.scope")
    assert resolves(scope, "ScopedManager.visible_to")
    assert not resolves(scope, "ScopedManager.nowhere")
    assert has_module("rehab.people.scope")
    assert not has_module("rehab.nowhere.at_all")


def test_the_glossary_has_every_term() -> None:
    text = (ROOT / "CONTRIBUTING.md").read_text()
    glossary = text[text.index("## Glossary") : text.index("## Tests")]
    rows = re.findall(r"^\| ([^|]+) \| [^|]+ \|$", glossary, re.MULTILINE)
    terms = {term.strip() for row in rows for term in re.split(r"[,()]", row)}
    assert not [term for term in TERMS if term not in terms]
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
