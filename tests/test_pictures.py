"""A picture in the documents is out of date when its page's template or style changed."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tests.support import pictures

PAGE = """{% extends "base.html" %}{% load static %}
<link href="{% static 'css/page.css' %}">{# a remark #}<p>Words</p>"""


@pytest.fixture
def site(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    for name, text in {
        "templates/base.html": "<html></html>",
        "templates/page.html": PAGE,
        "static/css/page.css": "p { color: var(--text); } /* why */",
        "static/css/other.css": "p { color: var(--muted); }",
    }.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    monkeypatch.setattr(pictures, "ROOT", tmp_path)
    monkeypatch.setattr(pictures, "SOURCES", tmp_path / "sources.json")
    monkeypatch.setattr(pictures, "PICTURES", {"page": pictures.Picture("page", "page.html")})
    (tmp_path / "sources.json").write_text(json.dumps({"page": pictures.digest("page.html")}))
    assert pictures.outdated() == []
    return tmp_path


@pytest.mark.parametrize(
    ("file", "old", "new", "changed"),
    [
        ("templates/page.html", "Words", "Other words", True),
        ("templates/base.html", "<html>", "<html><body>", True),
        ("static/css/page.css", "--text", "--muted", True),
        ("static/css/page.css", "why", "why not", False),
        ("static/css/page.css", "{ color", "{\n  color", False),
        ("templates/page.html", "a remark", "another", False),
        ("static/css/other.css", "--muted", "--text", False),
    ],
)
def test_which_changes_make_a_picture_old(
    site: Path, file: str, old: str, new: str, changed: bool
) -> None:
    path = site / file
    path.write_text(path.read_text().replace(old, new))
    assert pictures.outdated() == (["page"] if changed else [])


def test_each_picture_of_the_documents_is_known_and_each_page_exists() -> None:
    assert {file.stem for file in pictures.IMAGES.glob("*.png")} == set(pictures.PICTURES)
    for picture in pictures.PICTURES.values():
        assert all(file.exists() for file in pictures.files_of(picture.template))
