"""Pages as they are in another language: nothing stays English, and no number is broken."""

from __future__ import annotations

import gettext
import json
import re
from collections.abc import Iterator
from html.parser import HTMLParser

import pytest
from django.conf import settings
from django.urls import get_resolver, reverse
from django.utils import translation
from django.utils.translation import trans_real

from rehab.people.models import Clinic, Patient, User
from rehab.people.roles import Role
from rehab.sessions.models import TrainingSession
from rehab.training.changes import State
from tests.support.tenancy import walk_patterns
from tests.support.world import World, fill_board, signed_in

pytestmark = pytest.mark.django_db

# Addresses of machines, and the guide, which is English alone.
MACHINE = {
    "help",
    "problem-report",
    "healthz",
    "readyz",
    "catalog",
    "tablet-state",
    "tablet-app",
    "sign-out",
}
# What nobody translates: names of ours, units, codes, what people typed, and how dates are told.
AS_IT_IS = re.compile(
    r"[Zz]q\w+qz[\w-]*|\bzq\b|NASA-TLX \(raw\)|System Usability Scale \(SUS\)|GARRY|"
    r"mm/\(steps/min\)|W/kg|\b(?:kg|min|s|m)\b|(?:localhost|testserver|http)\S*|"
    r"\bde\b|\ba las\b|UTC|[A-Z]\w+/\w+|/admin/[\w/]*|"
    r"P-[A-Z0-9]{8}|\b[A-Z0-9]{6}\b|\b[A-Z]\b|"
    r"\b(?:a\.m|p\.m|noon|midnight)\b\.?|msg_[0-9a-f]{32}|[a-z]+(?:_[a-z]+)+|\{\x22.*|\w+\.py"
)
DJANGO_SAYS = {"Search", "True", "False", "None"}  # of its own icons, in every language
NUMBERS = {"x", "y", "x1", "x2", "y1", "y2", "cx", "cy", "r", "rx", "ry", "width", "height"}
LISTS = {"viewbox", "points", "stroke-dasharray"}
WORDS = {"aria-label", "title", "placeholder", "alt"}
VOID = {"area", "base", "br", "col", "hr", "img", "input", "link", "meta", "source", "wbr"}


class Pseudo(gettext.NullTranslations):
    """A language in which every marked word stands in brackets."""

    def __init__(self) -> None:
        super().__init__()
        self._catalog: dict[str, str] = {}

    def gettext(self, message: str) -> str:
        text = message.rpartition("\x04")[2]
        if re.fullmatch(r"\w+(,\w+)+|\w+(, \w+){9,}", text):  # a list, to be taken apart
            return re.sub(r"\w+", r"⟦\g<0>⟧", text)
        return f"⟦{text}⟧" if text else ""

    def ngettext(self, msgid1: str, msgid2: str, n: int) -> str:
        return self.gettext(msgid1 if n == 1 else msgid2)

    def language(self) -> str:
        return "es"

    def to_language(self) -> str:
        return "es"


def unmarked(text: str) -> str:
    """Return what stands outside of brackets, which may stand in each other."""
    while (shorter := re.sub(r"⟦[^⟦⟧]*⟧", "", text)) != text:
        text = shorter
    for _code, name in settings.LANGUAGES:
        text = text.replace(name, "")
    return AS_IT_IS.sub("", text)


class Page(HTMLParser):
    """A page's words and numbers."""

    def __init__(self, source: str) -> None:
        super().__init__()
        self.said: list[str] = []
        self.numbers: list[tuple[str, str]] = []
        self.scripts: list[str] = []
        self._open: list[tuple[str, bool]] = []
        self._json = False
        self.feed(source)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        given = {name: value or "" for name, value in attrs}
        if given.get("lang", "es") == "es":  # else words of another language
            self.said += [value for name, value in given.items() if name in WORDS]
        if tag == "input" and given.get("type") in {"submit", "button"}:
            self.said.append(given.get("value", ""))
        for name, value in given.items():
            if name in NUMBERS or (tag == "progress" and name in {"max", "value"}):
                self.numbers.append((f"{tag} {name}", value.removesuffix("%").removesuffix("px")))
            elif name in LISTS:
                self.numbers += [(f"{tag} {name}", one) for one in re.split(r"[ ,]+", value)]
            elif name.startswith("data-") and re.fullmatch(r"-?\d+,\d+", value):
                self.numbers.append((f"{tag} {name}", value))
            elif given.get("type") == "number" and name in {"min", "max", "step", "value"}:
                self.numbers += [(f"{tag} {name}", value)] * (value not in {"", "any"})
        self._json = tag == "script" and given.get("type") in {"application/json", "importmap"}
        silent = (
            tag in {"script", "style", "code", "pre", "textarea"} or given.get("translate") == "no"
        )
        if tag == "option" and given.get("lang"):
            silent = True
        if tag not in VOID:
            self._open.append((tag, silent))

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.handle_starttag(tag, attrs)
        if tag not in VOID:
            self._open.pop()

    def handle_endtag(self, tag: str) -> None:
        while self._open and self._open.pop()[0] != tag:
            pass

    def handle_data(self, data: str) -> None:
        if self._json:
            self.scripts.append(data)
            self._json = False
        elif not any(silent for _, silent in self._open):
            self.said.append(data)


@pytest.fixture
def world(world: World) -> World:
    fill_board(world)
    Clinic.everywhere.update(language="es")
    Patient.everywhere.update(language="es", boards="clinic")
    again = TrainingSession.everywhere.get(pk=world.session.pk)
    again.pk, again.state = None, State.READY.value
    again.plan["language"] = "es"
    again.save()
    return world


@pytest.fixture
def bracketed(world: World, monkeypatch: pytest.MonkeyPatch) -> None:
    """Have pages in a language that shows what was not marked."""
    monkeypatch.setitem(vars(trans_real)["_translations"], "es", Pseudo())


def paths(world: World, admin: bool) -> Iterator[tuple[str, str]]:
    """Return the pages of one clinic, by name."""
    keys = {"patient_id": [world.patient.pk]}
    keys["session_id"] = list(
        TrainingSession.everywhere.filter(patient=world.patient).values_list("pk", flat=True)
    )
    for name, _, pattern in walk_patterns(get_resolver()):
        if name in MACHINE or name.startswith("api") or admin != name.startswith("admin:"):
            continue
        wanted = list(pattern.pattern.converters)
        if not wanted and not getattr(pattern.pattern.regex, "groupindex", None):
            yield name, reverse(name)
        elif name == "admin:app_list":
            yield name, reverse(name, kwargs={"app_label": "rehab"})
        elif len(wanted) == 1 and wanted[0] in keys:
            for key in keys[wanted[0]]:
                yield name, reverse(name, kwargs={wanted[0]: key})
        elif name.startswith("admin:rehab_") and name.endswith("_change"):
            model = next(m for m in world.rows if f"_{m.__name__.lower()}_" in name)
            yield name, reverse(name, args=[world.rows[model].pk])


def pages(world: World, admin: bool = False) -> Iterator[tuple[str, Page]]:
    """Open every page that a clinic's lead may open."""
    client = signed_in(User.everywhere.select_related("clinic").get(pk=world.people[Role.LEAD].pk))
    for name, path in paths(world, admin):
        answer = client.get(path)
        html = answer.headers.get("Content-Type", "").startswith("text/html")
        if answer.status_code == 200 and html and answer.content:
            yield f"{name} {path}", Page(answer.content.decode())


@pytest.mark.wide
@pytest.mark.parametrize(
    "admin",
    [pytest.param(False, id="pages"), pytest.param(True, id="admin", marks=pytest.mark.long)],
)
def test_no_word_of_a_page_is_left_in_english(world, bracketed, admin):
    found = {}
    for name, page in pages(world, admin):
        left = (text.strip() for text in unmarked("\n".join(page.said)).split("\n"))
        if english := {text for text in left if re.search(r"[^\W\d_]", text)} - DJANGO_SAYS:
            found[name] = english
    assert not found, json.dumps({name: sorted(left) for name, left in found.items()}, indent=1)


@pytest.mark.wide
@pytest.mark.parametrize(
    "admin",
    [pytest.param(False, id="pages"), pytest.param(True, id="admin", marks=pytest.mark.long)],
)
def test_numbers_of_drawings_fields_and_scripts_are_the_same_in_every_language(world, admin):
    seen = 0
    for name, page in pages(world, admin):
        for where, value in page.numbers:
            assert re.fullmatch(r"-?\d*\.?\d+(e-?\d+)?(r?em)?|auto", value), (name, where, value)
            seen += 1
        for script in page.scripts:
            json.loads(script)
    assert seen
    assert translation.get_language() == "en"
