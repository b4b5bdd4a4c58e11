"""Nothing that a worn sensor measures is called A2, power, force or propulsion, in any language."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from django.utils import translation

from rehab.feedback.clinic_valences import default_valence
from rehab.training.measures import WORN_MEASURES
from rehab.training.valences import VALENCES

ROOT = Path(__file__).parents[1]
CLAIM = re.compile(
    r"\b(a2|powers?|forces?|puissant\w*|propulsi\w*|leistung\w*|kraft|kräfte|antrieb\w*|vortrieb\w*|potencia\w*|"
    r"fuerzas?|puissances?|poussée)\b",
    re.IGNORECASE,
)
PUSH = re.compile(r"\b(push|power|abst[oö]ß|stoß|drück|empuj|impuls|pouss)", re.IGNORECASE)
DENIAL = re.compile(
    r"\b(no|none|not|never|nothing|without|instead of|cannot|refuses?)\b", re.IGNORECASE
)
PLACES = [
    "rehab/gait/wearables",
    "rehab/sources/intake/wearable_pipeline.py",
    "rehab/sources/ble",
    "templates/stations/sensor.html",
    "templates/patients/phone_trial.html",
    "static/js/sensor",
]


def find_claims(text: str) -> list[str]:
    """Return the sentences that use such a word without denying it."""
    sentences = re.split(r"(?<=[.!?])\s+|\n\s*\n", text)
    return [one for one in sentences if CLAIM.search(one) and not DENIAL.search(one)]


def test_claims_are_found():
    assert find_claims("The push-off force of the foot. It is no power.") == [
        "The push-off force of the foot."
    ]


@pytest.mark.parametrize("language", ["en", "de", "es", "fr"])
def test_no_measure_is_called_so(language):
    with translation.override(language):
        for measure in WORN_MEASURES:
            assert not CLAIM.search(translation.gettext(measure.name)), measure.slug
            assert not CLAIM.search(measure.slug + " " + measure.channel.replace("_", " "))


@pytest.mark.parametrize("language", ["en", "de", "es", "fr"])
@pytest.mark.parametrize("slug", VALENCES)
def test_no_phrase_praises_a_push(slug, language):
    """A patient reads the same phrases whatever is measured."""
    for band in default_valence(slug, language).bands:
        assert not CLAIM.search(band.words), band.words
        assert not PUSH.search(band.words), band.words


def test_no_code_and_no_page_calls_it_so():
    read = 0
    for place in PLACES:
        path = ROOT / place
        files = [path] if path.is_file() else sorted(path.rglob("*")) if path.is_dir() else []
        for file in (one for one in files if one.suffix in {".py", ".html", ".js"}):
            read += 1
            assert find_claims(file.read_text()) == [], file
    assert read >= 10


def test_the_documentation_says_so():
    text = (ROOT / "docs/sources.md").read_text()
    part = text.split("## Sensors on foot or shank")[1].split("\n## ")[0]
    assert find_claims(part) == []
    assert "r = 0.07" in part
