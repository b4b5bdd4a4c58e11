"""What another feedback type needs beside its entry in `training/valences.py`, by name."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import polib
import pytest
from django.apps import apps
from django.utils.choices import CallableChoiceIterator

from rehab.feedback.translation import valence_choices
from rehab.training.feedback_bands import Confetti
from rehab.training.valences import POSITIVE, VALENCES, Valence

ROOT = Path(__file__).parents[2]


def missing_parts(valence: Valence) -> Iterator[str]:
    """Yield what pages lack of a feedback type, each with where it belongs."""
    theme, slug = f'[data-theme="{valence.slug}"] {{', valence.slug
    wanted = [
        ("static/css/shared/tokens.css", theme, f"the colors of its pages ({valence.hue})"),
        ("static/css/sessions/history.css", f".type.{slug}::after", "its sign in lists"),
        ("static/js/shared/labels.js", f'{slug}: _("{valence.label}")', "its name for scripts"),
    ]
    if any(band.confetti is not Confetti.NONE for band in valence.bands):
        wanted.append(("static/css/walk/walk.css", theme, "the colors of its confetti"))
    for file, text, part in wanted:
        if text not in (ROOT / file).read_text():
            yield f"{file}: {part}"
    words = [valence.label, *(phrase for band in valence.bands for phrase in band.phrases)]
    for catalog in sorted(ROOT.glob("locale/*/LC_MESSAGES/django.po")):
        known = {entry.msgid for entry in polib.pofile(str(catalog)) if entry.translated()}
        for text in words:
            if text not in known:
                yield f"{catalog.relative_to(ROOT)}: “{text}” (make messages)"


@pytest.mark.parametrize("valence", VALENCES.values(), ids=list(VALENCES))
def test_each_type_has_all_its_parts(valence: Valence) -> None:
    assert list(missing_parts(valence)) == []


def test_what_a_new_type_lacks_is_named() -> None:
    praise = replace(POSITIVE, slug="praise", label="Praise", hue="moss")
    assert [re.sub(r"^locale/\w+", "locale", part) for part in missing_parts(praise)] == [
        "static/css/shared/tokens.css: the colors of its pages (moss)",
        "static/css/sessions/history.css: its sign in lists",
        "static/js/shared/labels.js: its name for scripts",
        "static/css/walk/walk.css: the colors of its confetti",
        *["locale/LC_MESSAGES/django.po: “Praise” (make messages)"] * 3,
    ]


def test_a_new_type_needs_no_migration(monkeypatch: pytest.MonkeyPatch) -> None:
    columns: list[Any] = [
        field
        for model in apps.get_app_config("rehab").get_models()
        for field in model._meta.get_fields()
        if set(VALENCES) == {value for value, _label in getattr(field, "choices", None) or ()}
    ]
    assert len(columns) >= 3
    praise = replace(POSITIVE, slug="praise")
    monkeypatch.setitem(VALENCES, praise.slug, praise)
    for field in columns:
        assert isinstance(field.choices, CallableChoiceIterator), field
        assert field.deconstruct()[3]["choices"] is valence_choices
        assert ("praise", "Positive") in list(field.choices)
