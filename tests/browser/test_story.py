"""A whole session as the clinic walks it: nothing but taps, in a real browser, on a real server."""

from __future__ import annotations

import sqlite3
from dataclasses import dataclass
from itertools import product

import pytest
from playwright.sync_api import Page, expect

from tests.support.browsers import Visit, go_on_to_scores
from tests.support.extent import EVERYTHING
from tests.support.servers import Server

pytestmark = pytest.mark.browser

# `make test-all` walks every type on both sides of a tablet.
EVERYWHERE = list(
    product(("positive", "negative", "binary", "explicit"), ("tablet-portrait", "tablet-landscape"))
)
STRIDES = 10
SEED = """
from rehab.people.sign_in.first_start import first_clinic
from rehab.stations.models import Station
from tests.support.walks import make_patient
clinic = first_clinic()
for number in range(8):
    Station.everywhere.create(clinic=clinic, name=f"Place {number}")
    make_patient(clinic, f"Rosa {number}", code=f"K7-{number}")
"""


@dataclass
class Story:
    """One session on its way: on the tablet, and on the therapist's page."""

    number: int
    valence: str
    page: Page
    monitor: Page
    session: int = 0
    steps: int = 0  # before the goal was raised


@pytest.fixture(scope="module")
def seeded(server: Server) -> Server:
    server.run_shell(SEED)
    return server


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
    page.locator("label").get_by_text("W/kg", exact=True).tap()
    page.tap("label:has-text('Training only')")
    page.tap(".try summary")
    page.tap("label:has-text('Simulated patient, good')")
    page.tap(f"label:has-text('Place {story.number}')")
    page.tap("[name=then][value=walk]")
    page.tap("[data-change=start]")
    story.session = int(page.url.rstrip("/").split("/")[-1])


def walk(story: Story, strides: int) -> None:
    story.page.wait_for_function("n => document.body.dataset.step >= n", arg=strides)


def steer(story: Story) -> None:
    """Pause on the patient's page; raise the goal and go on from the therapist's."""
    story.page.tap("[data-change=pause]")
    story.page.wait_for_selector("body[data-look=paused]")
    story.steps = int(story.page.evaluate("document.body.dataset.step"))
    monitor = story.monitor
    monitor.goto(f"/sessions/{story.session}/monitor/")
    expect(monitor.locator("[data-main]")).to_contain_text("Resume")
    expect(monitor.locator("[data-show=goal]")).to_have_text("3.90")
    monitor.tap("[aria-label='Goal up']")
    expect(monitor.locator("[data-show=goal]")).to_have_text("4.00")
    monitor.tap("[data-main]")
    expect(monitor.locator("[data-main]")).to_contain_text("Pause")


def numbers_agree(story: Story, server: Server) -> None:
    """What stands on both pages is what is stored."""
    story.page.tap("[data-change=pause]")
    story.page.wait_for_selector("body[data-look=paused]")
    expect(story.monitor.locator("[data-main]")).to_contain_text("Resume")
    rows = query(server, "SELECT * FROM rehab_step WHERE session_id = ?", story.session)
    judged = [row for row in rows if row["hit"] is not None]
    hits = sum(row["hit"] for row in judged)
    expect(story.monitor.locator("[data-show=judged]")).to_have_text(
        f"{hits} of {len(judged)} in all"
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
    expect(page.locator(f".you[data-session='{story.session}'] >> visible=true")).to_have_count(1)
    page.tap("text=Done")
    expect(page.locator(".huge")).to_contain_text("Like last time")


@pytest.mark.timeout(300)
@pytest.mark.parametrize(("valence", "size"), EVERYWHERE if EVERYTHING else EVERYWHERE[:1])
def test_a_session_from_start_to_scores(
    seeded: Server, visit: Visit, valence: str, size: str
) -> None:
    tablet, laptop = (visit("/start/", size=one, has_touch=True) for one in (size, "laptop"))
    story = Story(EVERYWHERE.index((valence, size)), valence, tablet, laptop)
    begin(story)
    walk(story, STRIDES)
    steer(story)
    walk(story, story.steps + 3)
    numbers_agree(story, seeded)
    end(story, seeded)
    (state,) = query(
        seeded, "SELECT state, simulated FROM rehab_trainingsession WHERE id = ?", story.session
    )
    assert tuple(state) == ("finished", 1)
    if story.number == 0:
        like_last_time_is_three_taps(story.page, seeded)


def like_last_time_is_three_taps(page: Page, server: Server) -> None:
    page.goto("/start/")
    page.tap("text=Rosa 0")
    page.tap("text=Like last time")
    page.wait_for_selector("body[data-look=ready]")
    expect(page.locator("[data-change=start]")).to_be_hidden()  # until a live sensor is there
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
    page.tap("[name=then][value=walk]")
    expect(page.locator(".wrong")).to_contain_text("still has an open session of Rosa 0")
