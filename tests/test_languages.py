"""What is to be translated is marked, collected, translated and compiled."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from collections.abc import Iterable, Iterator
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import polib
import pytest
from django.conf import settings
from django.utils.translation import override

from rehab.people.aliases import ANIMALS, MANNERS, format_alias, split_list

ROOT = Path(__file__).resolve().parent.parent
CATALOGS = sorted((ROOT / "locale").rglob("*.po"))
PLACE = re.compile(
    r"\{\w+(?:![rs])?(?::[^}]*)?\}|%\(\w+\)\d*(?:\.\d+)?[sdifg]|%%|</?\w+>|https?://\S+"
)
SENTENCE = 6  # words
PLURALS = {  # as Django's own catalogs have them
    "es": "nplurals=2; plural=(n != 1);",
    "de": "nplurals=2; plural=(n != 1);",
    "fr": "nplurals=2; plural=(n > 1);",
}
# Words that are the same in English and in another language.
ALIKE = (
    "and android ipad iphone linux mac timed windows borg django garry min quattrocchi neurol "
    "neurosurg psychiatry paul medrxiv standard webhook webhooks"
)
ALIKE_IN = {
    "es": "factor robot sensor extra normal plan total",
    "de": "arm code codes design feedback hand hedges index minus monitor name normal passkey "
    "patient pause person phase plan plus sensor start tablet tablets training",
    "fr": "cadence code correction corrections date description distance effort formats incident "
    "incidents menu migrations minutes moment normal options pages participant participants "
    "patient patients pause performance phase phases phrases plan plus point points position "
    "questionnaire questionnaires questions robot signature source test total type variation "
    "version",
}


def entries(language: str = "*") -> Iterator[polib.POEntry]:
    for file in CATALOGS:
        if file.relative_to(ROOT / "locale").match(f"{language}/*/*"):
            yield from polib.pofile(str(file))


def forms(entry: polib.POEntry) -> list[str]:
    """Return a translation; of a count, one for each number."""
    if not entry.msgid_plural:
        return [entry.msgstr]
    return [entry.msgstr_plural.get(index, "") for index in range(2)]


def test_each_language_but_english_has_both_catalogs():
    wanted = {
        f"{code}/LC_MESSAGES/{domain}.po"
        for code, _ in settings.LANGUAGES
        for domain in ("django", "djangojs")
        if code != settings.LANGUAGE_CODE
    }
    assert {str(file.relative_to(ROOT / "locale")) for file in CATALOGS} == wanted


def test_everything_is_translated():
    for entry in entries():
        assert not entry.fuzzy, entry
        assert not entry.obsolete, entry
        assert all(forms(entry)), f"no translation of {entry.msgid!r}"


@pytest.mark.parametrize("language", ALIKE_IN)
def test_hardly_anything_is_the_same_as_in_english(language):
    same = {entry.msgid for entry in entries(language) if entry.msgid in forms(entry)}
    words = {word for text in same for word in re.findall(r"[^\W\d_]{3,}", PLACE.sub("", text))}
    assert {word.lower() for word in words} <= set(f"{ALIKE} {ALIKE_IN[language]}".split())


def test_translations_have_the_same_places_for_values():
    for entry in entries():
        for index, form in enumerate(forms(entry)):
            source = entry.msgid_plural if entry.msgid_plural and index else entry.msgid
            wanted, found = sorted(PLACE.findall(source)), sorted(PLACE.findall(form))
            if entry.msgid_plural and not index:  # "a step" may well say "1 step"
                assert set(found) <= set(PLACE.findall(entry.msgid_plural)), entry
            else:
                assert found == wanted, entry


def test_translations_end_and_are_written_as_their_sources():
    for entry in entries():
        sources = [entry.msgid, entry.msgid_plural or entry.msgid]
        for source, form in zip(sources, forms(entry) * 2, strict=False):
            assert form == form.strip() or source != source.strip(), entry
            for sign in (".", "?", "!", ":", "…"):
                assert form.endswith(sign) == source.endswith(sign), entry
            assert '"' not in form or '"' in source, entry  # it may stand in an attribute


def test_patients_read_sentences_of_six_words_at_most():
    """As English is written for them: after a stroke, reading is work."""
    read = {
        "static/js/walk/text.js",
        "rehab/training/valences.py",
        "rehab/training/phases.py",
    }
    for entry in entries():
        if entry.comment == "refusal":  # a therapist reads it
            continue
        if read & {file for file, _ in entry.occurrences}:
            for form in forms(entry):
                for sentence in re.split(r"[.!?;] ", PLACE.sub("x", form)):
                    words = [word for word in sentence.split() if re.search(r"\w", word)]
                    assert len(words) <= SENTENCE, entry


def test_compiled_catalogs_are_those_that_can_be_read():
    for file in CATALOGS:
        compiled = polib.mofile(str(file.with_suffix(".mo")))

        def read(catalog: Iterable[Any]) -> dict[tuple[str | None, str], list[str]]:
            return {(entry.msgctxt, entry.msgid): forms(entry) for entry in catalog}

        assert read(compiled) == read(polib.pofile(str(file))), f"make messages ({file.name})"


def test_plurals_have_two_forms_with_a_known_rule():
    for file in CATALOGS:
        metadata = polib.pofile(str(file)).metadata
        assert metadata["Plural-Forms"] == PLURALS[metadata["Language"]]


def test_a_language_that_nobody_native_has_read_says_so_where_it_is_chosen():
    for code, name in settings.LANGUAGES:
        headers = {polib.pofile(str(file)).header for file in CATALOGS if f"/{code}/" in str(file)}
        unread = any("native reader has not read" in header for header in headers)
        assert unread == ("(" in name), code


@pytest.mark.skipif(not shutil.which("xgettext"), reason="no gettext: apt-get install gettext")
@pytest.mark.server
def test_the_catalogs_have_every_marked_word(tmp_path):
    for name in ("rehab", "robot", "garry_site", "templates", "static", "locale", "manage.py"):
        if (ROOT / name).is_dir():
            ignore = shutil.ignore_patterns("__pycache__")
            shutil.copytree(ROOT / name, tmp_path / name, ignore=ignore)
        else:
            shutil.copy(ROOT / name, tmp_path / name)
    for domain in ("django", "djangojs"):
        collect = "makemessages --all --no-obsolete --add-location file --verbosity 0 --domain"
        done = subprocess.run(
            [sys.executable, "manage.py", *collect.split(), domain],
            cwd=tmp_path,
            capture_output=True,
            text=True,
        )
        assert done.returncode == 0, done.stderr
    for file in CATALOGS:
        fresh = polib.pofile(str(tmp_path / file.relative_to(ROOT)))
        marked = {(entry.msgctxt, entry.msgid, entry.msgid_plural) for entry in fresh}
        known = {(e.msgctxt, e.msgid, e.msgid_plural) for e in polib.pofile(str(file))}
        assert marked == known, "make messages"


# --- templates ----------------------------------------------------------------------------------

UNMARKED = {"GARRY", "JSON", "PDF", "csv", "png", "svg", "W/kg", "W", "kg", "min", "s"}
SAID = {"aria-label", "title", "placeholder", "alt", "label"}
BLOCK = re.compile(
    r"{% (blocktranslate|comment)\b.*?{% end\1 %}|{#.*?#}|"
    r"{% block (?:page|body)_?class %}.*?{% endblock %}",
    re.DOTALL,
)
TAG = re.compile(r"{%.*?%}|{{.*?}}", re.DOTALL)
# Filters whose words or formats are English whatever the page's language. What a machine reads, in
# an attribute, stands in single quotes: yesno:'true,false'.
SPEAKS = re.compile(
    r"""\|(?:default|default_if_none|add):["'][^"']*[A-Za-z]{2}"""
    r"""|\|pluralize|\|yesno(?!:'|:_)"""
    r"""|\|(?:date|time):["'](?![A-Z_]+_FORMAT|[, cHis:]+["']|Y-m-d["'])"""
    r"""|{% now ["'](?![A-Z_]+_FORMAT)"""
)


class Words(HTMLParser):
    """Collects what a page says beside its marked words."""

    def __init__(self) -> None:
        super().__init__()
        self.said: list[str] = []
        self.silent = 0

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.said += [value or "" for name, value in attrs if name in SAID]
        self.silent += tag in {"script", "style", "code", "pre"}

    def handle_endtag(self, tag: str) -> None:
        self.silent -= tag in {"script", "style", "code", "pre"}

    def handle_data(self, data: str) -> None:
        if not self.silent:
            self.said.append(data)

    @property
    def words(self) -> set[str]:
        """The words that are no marks or units."""
        found = {word for text in self.said for word in re.findall(r"[^\W\d_][\w/’']*", text)}
        return found - UNMARKED


@pytest.mark.parametrize(
    "template",
    sorted((ROOT / "templates").rglob("*.html")),
    ids=lambda file: str(file.relative_to(ROOT / "templates")),
)
def test_templates_say_nothing_that_is_not_marked(template):
    source = template.read_text()
    assert not (found := SPEAKS.search(source)), f"say it in the page's language: {found[0]}"
    page = Words()
    page.feed(TAG.sub("", BLOCK.sub("", source)))
    assert page.words == set()


# --- animal names -------------------------------------------------------------------------------


@pytest.mark.parametrize("language", [code for code, _ in settings.LANGUAGES])
def test_animal_names_are_said_in_each_language(language):
    with override(language):
        names = {format_alias(f"{a} {b}") for a in split_list(MANNERS) for b in split_list(ANIMALS)}
    assert len(names) == len(split_list(MANNERS)) * len(split_list(ANIMALS))


def test_an_animal_name_keeps_its_number_and_an_unknown_one_stays():
    with override("es"):
        assert format_alias("Brave Otter 7") == "Nutria valiente 7"
        assert format_alias("Odd Fellow") == "Odd Fellow"
