"""Every document that is cited exists, with its heading, and every link in a document leads on.

A citation is the name of a Markdown file, in code from the root on (``docs/reference/`` + page +
``#`` + heading), in a document from its own folder, ``docs`` or the root.
"""

from __future__ import annotations

import ast
import io
import re
import tokenize
from collections.abc import Iterator
from functools import cache
from itertools import chain
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
FOLDERS = (
    ".ci",
    "deploy",
    "docs",
    "examples",
    "garry_site",
    "rehab",
    "robot",
    "static",
    "templates",
    "tests",
)
TEXTS = {".py", ".js", ".css", ".html", ".txt", ".svg", ".urdf", ".ino", ".md", ".toml", ".cfg"}
DOCUMENTS = sorted([*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md")])
REFERENCE = "docs/reference/"

# A bare name in quotation marks of code is part of a path or of a message.
CITATION = re.compile(r"(?<![\w./\"-])([\w./-]+\.md)\b(?:#([\w-]+))?")
LINK = re.compile(r"\]\(([^()\s]+)\)|\b(?:src|href)=\"([^\"]+)\"")
# A path in quotation marks of code, without places to fill in.
PATH = re.compile(r"`((?:docs|rehab|robot|static|templates|tests)/[\w./-]+)(?:::\w+)?`")
# The end of a path, as documents and comments shorten them (people/scope.py).
SHORTENED = re.compile(r"(?<![\w./\"'{%*-])((?:[\w.-]+/)*[\w-]+\.(?:css|html|js|py))\b(?![\"'(])")
OTHERS = {
    "GARRY-Server/sqliteHelper.py",  # three files of the original
    "data_processing.py",
    "gesture_generation.py",
    "admin/js/theme.js",  # Django's
}
COMMENTS = {
    ".css": re.compile(r"/\*.*?\*/", re.DOTALL),
    ".html": re.compile(r"\{#.*?#\}|<!--.*?-->", re.DOTALL),
    ".js": re.compile(r"/\*.*?\*/|(?<!:)//[^\n]*", re.DOTALL),
}
FENCE = re.compile(r"^ *(```|~~~).*?^ *\1 *$", re.MULTILINE | re.DOTALL)
HEADING = re.compile(r"^#{1,6} +(.+?) *#* *$", re.MULTILINE)


@pytest.fixture(scope="module")
def sources() -> list[Path]:
    """All files that may cite a document, but for this one, which plants bad citations."""
    files = chain(
        (file for file in ROOT.iterdir() if file.name == "Makefile" or file.suffix in TEXTS),
        *((ROOT / folder).rglob("*") for folder in FOLDERS),
    )
    found = [
        file
        for file in files
        if file.is_file()
        and (file.suffix in TEXTS or file.name in ("Makefile", "run"))
        and file != Path(__file__).resolve()
    ]
    assert len(found) > 400
    return found


def anchors(text: str) -> set[str]:
    """Return the anchors that GitHub makes of a document's headings."""
    made: dict[str, int] = {}
    found = set()
    for heading in HEADING.findall(FENCE.sub("", text)):
        words = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", heading).lower()
        anchor = re.sub(r"[^\w\- ]", "", words).replace(" ", "-")
        times = made.get(anchor, 0)
        made[anchor] = times + 1
        found.add(f"{anchor}-{times}" if times else anchor)
    return found


@cache
def anchors_of(document: Path) -> set[str]:
    return anchors(document.read_text(encoding="utf-8"))


def find_target(path: str, source: Path) -> Path | None:
    """Return the file or folder of that path, seen from a document or from the root."""
    folders = [source.parent, ROOT / "docs", ROOT] if source.suffix == ".md" else [ROOT]
    return next((folder / path for folder in folders if (folder / path).exists()), None)


def find_bad_citations(text: str, source: Path) -> Iterator[str]:
    """Find the citations in a file's text that lead to no document or to none of its headings."""
    for cited in CITATION.finditer(text):
        path, anchor = cited.groups()
        document = find_target(path, source)
        if document is None:
            yield f"{cited[0]}: there is no such document"
        elif anchor and anchor not in anchors_of(document):
            yield f"{cited[0]}: there is no such heading"
        elif path.startswith(REFERENCE) and not anchor and source.suffix != ".md":
            yield f"{cited[0]}: name the heading as well"


def find_bad_links(text: str, source: Path) -> Iterator[str]:
    """Find the relative links in a document, and the paths in it, that lead nowhere."""
    text = FENCE.sub("", text)
    for link in chain.from_iterable(LINK.findall(text)):
        path, _, anchor = link.partition("#")
        if not link or re.match(r"[a-z]+:", link) or path.startswith("/"):
            continue
        target = source.parent / path if path else source
        if not target.exists():
            yield f"{link}: there is no such file"
        elif anchor and anchor not in anchors_of(target):
            yield f"{link}: there is no such heading"
    for path in PATH.findall(text):
        places = [folder / (path + end) for folder in (ROOT, ROOT / "tests") for end in ("", ".py")]
        if not any(place.exists() for place in places):
            yield f"{path}: there is no such file"


def test_whatever_is_cited_exists(sources):
    bad = [
        f"{file.relative_to(ROOT)} cites {citation}"
        for file in sources
        for citation in find_bad_citations(file.read_text(encoding="utf-8"), file)
    ]
    assert not bad, "\n".join(bad)


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda file: str(file.relative_to(ROOT)))
def test_links_lead_on(document):
    assert not list(find_bad_links(document.read_text(encoding="utf-8"), document))


def read_prose(file: Path) -> str:
    """Return what a file says to people: a document, or the comments and docstrings of code."""
    text = file.read_text(encoding="utf-8")
    if file.suffix == ".md":
        return text
    if file.suffix != ".py":
        return "\n".join(COMMENTS[file.suffix].findall(text))
    tokens = tokenize.generate_tokens(io.StringIO(text).readline)
    comments = [token.string for token in tokens if token.type == tokenize.COMMENT]
    documented = ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef
    nodes = [node for node in ast.walk(ast.parse(text)) if isinstance(node, documented)]
    return "\n".join([*comments, *(ast.get_docstring(node, clean=False) or "" for node in nodes)])


def find_unknown_files(text: str, there: str) -> list[str]:
    """Return the files that a text names and that no path ends with.

    ``there``: all paths, each in a line, after a ``/``.
    """
    named = {path for path in SHORTENED.findall(text) if path not in OTHERS}
    return sorted(path for path in named if f"/{path.lstrip('./')}\n" not in there)


def test_files_that_documents_and_comments_name_exist(sources):
    files = [*sources, Path(__file__).resolve()]
    there = "".join(f"/{file.relative_to(ROOT)}\n" for file in files)
    bad = [
        f"{file.relative_to(ROOT)} names {path}"
        for file in sources
        if file.suffix in (".md", ".py", *COMMENTS) and REFERENCE not in str(file)
        for path in find_unknown_files(read_prose(file), there)
    ]
    assert not bad, "\n".join(bad)
    assert find_unknown_files("`gone.py` scope.py x/e.py:7", there) == ["gone.py", "x/e.py"]


def test_every_reference_is_listed_and_cited(sources):
    """A page that nobody needs is no reference."""
    pages = {file.name for file in (ROOT / REFERENCE).glob("*.md")} - {"README.md"}
    listed = (ROOT / REFERENCE / "README.md").read_text(encoding="utf-8")
    cited = {
        match[1]
        for file in sources
        if file.suffix != ".md"
        for match in re.finditer(rf"{REFERENCE}([\w-]+\.md)#", file.read_text(encoding="utf-8"))
    }
    assert {page for page in pages if f"({page})" in listed} == pages
    assert cited == pages


@pytest.mark.parametrize(
    ("text", "wrong"),
    [
        ("# see docs/nowhere.md for more", "docs/nowhere.md: there is no such document"),
        ("stack.md, T3", "stack.md: there is no such document"),
        ("(docs/using.md#flying)", "docs/using.md#flying: there is no such heading"),
        (f"{REFERENCE}gait.md 2.1", f"{REFERENCE}gait.md: name the heading as well"),
    ],
)
def test_a_bad_citation_is_found(text, wrong):
    assert list(find_bad_citations(f"# First.\n{text}.\n", ROOT / "rehab" / "x.py")) == [wrong]


@pytest.mark.parametrize(
    "text",
    [
        "as docs/using.md says.",
        f"({REFERENCE}gait.md#filters)",
        "docs/using.md#the-patients-screen.",
        "README.md, CONTRIBUTING.md",
    ],
)
def test_a_good_citation_is_not_found(text):
    assert not list(find_bad_citations(text, ROOT / "rehab" / "x.py"))


def test_a_bad_link_is_found():
    text = (
        "[a](using.md#a-session) [b](using.md#there) [c](../README.md) [d](gone.md)\n"
        '<img src="images/gone.png"> [e](https://example.org/gone.md)\n'
        "`rehab/gone.py` `rehab/gait/`\n"
        "```\n[f](never.md)\n```\n"
    )
    source = ROOT / "docs" / "planted.md"
    bad = list(find_bad_links(text, source))
    assert [complaint.partition(":")[0] for complaint in bad] == [
        "using.md#there",
        "gone.md",
        "images/gone.png",
        "rehab/gone.py",
    ]


def test_anchors_are_those_of_github():
    text = (
        "# What to do when …\n## `/ws/<id>/`: *all* of it\n## All_of [it](x.md)\n## Twice\n"
        "```\n# no heading\n```\n### Twice ##\n"
    )
    assert anchors(text) == {"what-to-do-when-", "wsid-all-of-it", "all_of-it", "twice", "twice-1"}
