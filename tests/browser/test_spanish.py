"""A session of a patient who speaks Spanish, with a therapist who does and one who does not."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import polib
import pytest
from playwright.sync_api import BrowserContext, Page, expect

from tests.support.browsers import Visit, go_on_to_scores
from tests.support.servers import Server
from tests.support.walk_seed import Walk, feet_of, make_walks

pytestmark = pytest.mark.browser

ROOT = Path(__file__).resolve().parents[2]
SPANISH = {
    entry.msgid: entry.msgstr
    for file in (ROOT / "locale" / "es").rglob("*.po")
    for entry in polib.pofile(str(file))
    if not entry.msgid_plural and entry.msgstr != entry.msgid
}
# Of either language, those that the other does not have.
ENGLISH_WORDS = re.compile(
    r"\b(the|of|and|your|you|is|are|for|with|this|that|from|steps?|strides?|goal|sessions?|points|"
    r"walked|left|right|not|now|today|last|wanted|hits?|back|keep|stop|end|here|feedback)\b",
    re.IGNORECASE,
)
SPANISH_WORDS = re.compile(
    r"\b(el|la|los|las|de|del|su|con|para|pasos?|zancadas?|objetivo|puntos|hoy)\b", re.IGNORECASE
)
READ = """() => {
  const said = [];
  const walker = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  while (walker.nextNode()) {
    const element = walker.currentNode.parentElement;
    const words = walker.currentNode.textContent.trim();
    if (words && !element.closest("script, style, noscript, code, [lang]:not(html)"))
      if (element.checkVisibility() || element.closest("svg")) said.push(words);
  }
  for (const name of ["aria-label", "title", "placeholder", "alt"])
    for (const element of document.querySelectorAll(`[${name}]`))
      said.push(element.getAttribute(name));
  return [document.title, ...said];
}"""


def is_spanish(page: Page) -> None:
    """Fail where a page says something in English."""
    expect(page.locator("html")).to_have_attribute("lang", "es")
    for text in page.evaluate(READ):
        assert text not in SPANISH, text
        assert not ENGLISH_WORDS.search(text), text


def is_english(page: Page) -> None:
    """Fail where a page says something in Spanish."""
    expect(page.locator("html")).to_have_attribute("lang", "en")
    for text in page.evaluate(READ):
        assert not SPANISH_WORDS.search(text), text


@pytest.fixture
def walk(server: Server) -> Walk:
    phases = [{"kind": "baseline", "strides": 2}, {"kind": "training", "strides": 60}]
    seed = {"minutes": 1, "phases": phases, "screen": {"language": "es"}}
    return make_walks(server, seed)[0]


@pytest.fixture(params=["es", "en"])
def language(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture
def therapist(visit: Visit, walk: Walk, language: str) -> BrowserContext:
    """A browser of the therapist's, whose own language is not what the account has chosen."""
    page = visit("/account/", walk, "tablet-landscape", locale="fi")
    page.select_option("#language", language)
    page.click("form[action*=language] button")
    expect(page.locator("html")).to_have_attribute("lang", language)
    return page.context


def test_a_session_is_told_in_the_languages_of_who_reads_it(
    server: Server, walk: Walk, therapist: BrowserContext, language: str
) -> None:
    pt: Callable[[Page], None] = {"es": is_spanish, "en": is_english}[language]
    desk, tablet = therapist.new_page(), therapist.new_page()
    patient = 0
    for path in ("/account/", "/start/", "/tablets/pair/", "/account/second-factor/app/", "/"):
        desk.goto(path)
        pt(desk)
    desk.goto("/start/")
    desk.click("a.tap")
    patient = int(desk.url.rstrip("/").rpartition("/")[2])
    for path in ("", "details/", "screen/", "new/", "sessions/"):
        desk.goto(f"/patients/{patient}/{path}")
        pt(desk)

    monitor = desk
    monitor.goto(f"/sessions/{walk.session}/monitor/")
    tablet.goto(walk.path)
    words = tablet.locator(".words")
    expect(words).to_contain_text("Rosa")
    is_spanish(tablet)
    with feet_of(server, walk) as feet:
        tablet.click("[data-change=start]")
        expect(tablet.locator("body")).to_have_attribute("data-look", "calm")
        is_spanish(tablet)
        for performances in ((1.0, 1.0), (1.3, 1.15), (1.02, 0.8), (0.4, None)):
            feet.walk(*performances)
            expect(tablet.locator("body")).to_have_attribute("data-step", str(feet.number))
            is_spanish(tablet)
        pt(monitor)
        monitor.click("[data-remark=dizziness]")
        expect(monitor.locator("#strip .remark-words")).to_have_text(
            {"es": "mareo", "en": "dizziness"}[language]
        )
        pt(monitor)
        tablet.click("[data-change=pause]")
        expect(tablet.locator("body")).to_have_attribute("data-look", "paused")
        is_spanish(tablet)
        tablet.click("[data-ask=end]")
        is_spanish(tablet)
        tablet.click("[data-change=finish]")
        tablet.wait_for_url("**/ending/")
        is_spanish(tablet)
        go_on_to_scores(tablet)
    is_spanish(tablet)
    monitor.wait_for_url("**/details/")
    pt(monitor)
    tablet.goto(f"/patients/{patient}/home/")
    is_spanish(tablet)


def test_a_language_that_is_changed_in_mid_session_changes_the_page_whole(
    server: Server, visit: Visit
) -> None:
    (walk,) = make_walks(server, {"phases": [{"kind": "training"}]})
    tablet, desk = (
        visit(path, walk, "tablet-landscape") for path in (walk.path, walk.monitor_path)
    )
    with feet_of(server, walk) as feet:
        tablet.click("[data-change=start]")
        feet.walk(1.1)
        expect(tablet.locator("body")).to_have_attribute("data-look", "feedback")
        is_english(tablet)
        desk.click("[aria-label='Back']")
        desk.goto(f"{desk.url}screen/")
        desk.select_option("[name=language]", "es")
        desk.click("main form button.primary")
        expect(tablet.locator("html")).to_have_attribute("lang", "es")
        for performance in (1.2, 0.7):
            feet.walk(performance)
            expect(tablet.locator("body")).to_have_attribute("data-step", str(feet.number))
            is_spanish(tablet)
