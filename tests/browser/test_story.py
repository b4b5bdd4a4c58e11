"""A whole session as the clinic walks it: nothing but taps, in a real browser, on a real server."""

from __future__ import annotations

import sqlite3
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product

import pytest
from playwright.sync_api import Browser, Page, expect

from tests.support.browsers import SIZES, go_on_to_scores, sign_in
from tests.support.extent import EVERYTHING
from tests.support.servers import Server, serve

pytestmark = pytest.mark.browser

# `make test-all` walks every type on both sides of a tablet, at the same time.
EVERYWHERE = list(
    product(("positive", "negative", "binary", "explicit"), ("tablet-portrait", "tablet-landscape"))
)
STORIES = EVERYWHERE if EVERYTHING else EVERYWHERE[:1]
STRIDES = 10
PATIENCE_MS = 40_000

# How long each may take on a busy machine [s]; what hangs is found by PATIENCE_MS, well before.
BEGIN_S, TAP_S, STRIDE_S = 60, 4, 3  # server and browser; a tap or a look at a page; a stride
TAPS = 40  # and looks, from the first page of a story to its last
LIMIT_S = BEGIN_S + len(STORIES) * (TAPS * TAP_S + 2 * STRIDES * STRIDE_S)

SEED = """
from rehab.people.sign_in.first_start import first_clinic
from rehab.people.models import Patient
from rehab.stations.models import Station
clinic = first_clinic()
for number in range({count}):
    Station.everywhere.create(clinic=clinic, name=f"Place {{number}}")
    Patient.everywhere.create(
        clinic=clinic, code=f"K7-{{number}}", nickname=f"Rosa {{number}}", paretic_side="left"
    )
"""


@dataclass
class Story:
    """One session on its way."""

    number: int
    valence: str
    page: Page
    monitor: Page
    session: int = 0
    steps: int = 0  # before the goal was raised


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    with serve(tmp_path_factory.mktemp("data")) as running:
        running.run_shell(SEED.format(count=len(STORIES)))
        yield running


@pytest.fixture
def stories(server: Server, browser: Browser) -> Iterator[list[Story]]:
    first = browser.new_context(base_url=server.url)
    page = first.new_page()
    page.goto("/start/")
    sign_in(page, server.password)
    expect(page).to_have_url(f"{server.url}/start/")
    signed_in = first.storage_state()
    first.close()
    begun = []
    for number, (valence, size) in enumerate(STORIES):
        pages: list[Page] = []
        for width, height in (SIZES[size], SIZES["laptop"]):
            # A context each: a tab behind another one is not drawn.
            context = browser.new_context(
                base_url=server.url,
                storage_state=signed_in,
                viewport={"width": width, "height": height},
                has_touch=True,
            )
            context.set_default_timeout(PATIENCE_MS)
            page = context.new_page()
            pages.append(page)
        begun.append(Story(number, valence, pages[0], pages[1]))
    yield begun
    for story in begun:
        story.page.context.close()
        story.monitor.context.close()


def query(server: Server, words: str, *values: object) -> list[sqlite3.Row]:
    database = sqlite3.connect(server.folder / "garry.sqlite3")
    database.row_factory = sqlite3.Row
    try:
        return database.execute(words, values).fetchall()
    finally:
        database.close()


def begin(story: Story) -> None:
    """Tap from the patient to a walking session."""
    page = story.page
    page.goto("/start/")
    page.tap(f"text=Rosa {story.number}")
    page.tap("text=Change something")
    page.tap(f".type[data-theme={story.valence}]")
    page.tap("label:has-text('W/kg')")
    page.tap("label:has-text('Training only')")
    page.tap(".try summary")
    page.tap("label:has-text('Simulated patient, good')")
    page.tap(f"label:has-text('Place {story.number}')")
    page.tap("text=To the patient’s page")
    page.tap("[data-change=start]")
    story.session = int(page.url.rstrip("/").split("/")[-1])


def walk(story: Story, strides: int) -> None:
    story.page.wait_for_function("n => document.body.dataset.step >= n", arg=strides)


def steer(story: Story, server: Server) -> None:
    """Pause on the patient's page; raise the goal and go on from the therapist's."""
    story.page.tap("[data-change=pause]")
    story.page.wait_for_selector("body[data-look=paused]")
    story.steps = int(story.page.evaluate("document.body.dataset.step"))
    monitor = story.monitor
    monitor.goto(f"/sessions/{story.session}/monitor/")
    expect(monitor.locator("[data-main]")).to_contain_text("Go on")
    expect(monitor.locator("[data-show=goal]")).to_have_text("3.90")
    monitor.tap("[aria-label='Goal up']")
    expect(monitor.locator("[data-show=goal]")).to_have_text("4.00")
    monitor.tap("[data-main]")
    expect(monitor.locator("[data-main]")).to_contain_text("Pause")


def numbers_agree(story: Story, server: Server) -> None:
    """What stands on both pages is what is stored."""
    story.page.tap("[data-change=pause]")
    story.page.wait_for_selector("body[data-look=paused]")
    expect(story.monitor.locator("[data-main]")).to_contain_text("Go on")
    rows = query(server, "SELECT * FROM rehab_step WHERE session_id = ?", story.session)
    judged = [row for row in rows if row["hit"] is not None]
    hits = sum(row["hit"] for row in judged)
    expect(story.monitor.locator("[data-show=judged]")).to_have_text(
        f"{hits} of {len(judged)} strides"
    )
    assert {row["goal"] for row in rows} == {3.9, 4.0}
    points = [row["points"] for row in rows]
    assert any(value is not None for value in points) == (story.valence != "explicit")


def end(story: Story, server: Server) -> None:
    """End; the scores follow, with this session marked and in view."""
    page = story.page
    page.tap("[data-ask=end]")
    page.tap("[data-change=finish]")
    go_on_to_scores(page)
    you = page.locator(f"section:not([hidden]) .you[data-session='{story.session}']")
    expect(you).to_be_in_viewport()
    expect(you).to_contain_text("You")
    (metric,) = query(
        server,
        "SELECT value FROM rehab_sessionmetric WHERE session_id = ? AND slug = ?",
        story.session,
        "hit_rate" if story.valence == "explicit" else "score",
    )
    if story.valence == "explicit":
        expect(you.locator(".value")).to_have_text(f"{round(100 * metric['value'])} %")
    elif story.valence != "negative":  # which says what was kept
        expect(you.locator(".value")).to_have_text(f"{metric['value']:.0f}".replace("-", "−"))
    page.tap("role=tab[name='All types']")
    expect(page.locator(f".you[data-session='{story.session}'] >> visible=true")).to_have_count(1)
    page.tap("text=Continue")
    expect(page.locator(".huge")).to_contain_text("Like last time")


@pytest.mark.timeout(LIMIT_S)
def test_a_session_from_start_to_scores(stories: list[Story], server: Server) -> None:
    for story in stories:
        begin(story)
    for story in stories:
        walk(story, STRIDES)
    for story in stories:
        steer(story, server)
    for story in stories:
        walk(story, story.steps + 3)
        numbers_agree(story, server)
    for story in stories:
        end(story, server)
    states = query(server, "SELECT state, simulated FROM rehab_trainingsession")
    assert [tuple(state) for state in states] == [("finished", 1)] * len(stories)
    like_last_time_is_three_taps(stories[0].page, server)


def like_last_time_is_three_taps(page: Page, server: Server) -> None:
    page.goto("/start/")
    page.tap("text=Rosa 0")
    page.tap("text=Like last time")
    page.tap("[data-change=start]")
    page.wait_for_selector("body[data-look=waiting]")  # for the live sensor of a real patient
    before, now = query(
        server,
        "SELECT valence, goal, target_of FROM (SELECT valence, goal, plan ->> 'target' AS "
        "target_of, patient_id, id FROM rehab_trainingsession) WHERE patient_id = (SELECT id FROM "
        "rehab_patient WHERE code = 'K7-0') ORDER BY id",
    )
    assert tuple(before) == tuple(now)
    # The station is taken: nobody else can begin there by mistake.
    page.goto("/start/")
    page.tap("text=Try a demo")
    page.tap("text=Change something")
    page.tap("label:has-text('Place 0')")
    page.tap("text=To the patient’s page")
    expect(page.locator(".wrong")).to_contain_text("still has an open session of Rosa 0")
