"""A leaderboard from the first click to the tablet: built in the admin with the preview beside it,
seen after a session and while the tablet waits, and left by its patient with one tap.
"""

from __future__ import annotations

import pytest
from playwright.sync_api import Browser, Page, expect

from tests.support.browsers import SIZES, can_be_read, go_on_to_scores, sign_in
from tests.support.servers import serve

pytestmark = pytest.mark.browser

PATIENCE_MS = 40_000

SEED = """
from django.utils import timezone
from rehab.people.sign_in.first_start import first_clinic
from tests.support.walks import make_patient, strides, walk
from tests.support.world import agreeing
clinic = first_clinic()
for number, name in enumerate("Rosa Ken Mia Omar Lena Pavel".split()):
    patient = agreeing(make_patient(clinic, name, code=f"R-{number}", boards="clinic"))
    walk(patient, "positive", strides(20 - number, number), now=timezone.now())
    print(patient.alias)
make_patient(clinic, "Demo", code="demo", simulated=True, boards="clinic")
"""


def choose(page: Page, words: str) -> None:
    page.click(f".radiolist label:has-text('{words}')")


@pytest.mark.essential
def test_a_board_is_built_with_its_preview_and_seen_on_a_tablet(tmp_path, browser: Browser):
    with serve(tmp_path) as server:
        names = server.run_shell(SEED).split("\n")
        complaints: list[str] = []

        def open_page(size: str) -> Page:
            width, height = SIZES[size]
            context = browser.new_context(
                base_url=server.url,
                viewport={"width": width, "height": height},
                reduced_motion="reduce",
            )
            context.set_default_timeout(PATIENCE_MS)
            page = context.new_page()
            page.on(
                "console",
                lambda said: complaints.append(said.text) if said.type == "error" else None,
            )
            return page

        pt, tablet = open_page("laptop"), open_page("tablet-portrait")
        pt.goto("/admin/rehab/leaderboard/add/")
        sign_in(pt, server.password)
        build(pt, names)

        tablet.goto("/tablet/")
        pt.goto("/tablets/pair/")
        pt.fill("#code", tablet.inner_text(".code"))
        pt.click("text=It shows this code")
        expect(tablet.locator(".waiting h1")).to_have_text("First of all", timeout=PATIENCE_MS)
        expect(tablet.locator(".waiting .day").first).to_have_text(names[0])
        can_be_read(tablet)

        walk_a_demo(pt, tablet)
        board = tablet.locator("section.board:not([hidden])")
        expect(tablet.locator("h1")).to_have_text("Steps at the goal")
        expect(board.locator(".you")).to_contain_text("You")
        expect(board.locator("li .day").first).to_have_text(names[0])
        assert "Demo" not in tablet.inner_text("main")
        can_be_read(tablet)

        tablet.click("text=Do not compare me")
        expect(board).to_contain_text("These are your own sessions.")
        assert names[0] not in tablet.inner_text("main")
        assert complaints == []


def build(pt: Page, names: list[str]) -> None:
    """Build two boards; the preview follows every choice and says what cannot be."""
    seen = pt.frame_locator(".preview iframe")
    example = seen.locator("li .day")  # as all walked fewer than 100 steps
    expect(example).to_have_text(["Session 1", "You Session 2", "Session 3"])
    expect(pt.locator(".field-group")).to_be_hidden()
    pt.fill("#id_name", "Steps at the goal")
    expect(seen.locator("h1")).to_have_text("Steps at the goal")
    choose(pt, "All patients of the clinic")
    expect(pt.locator("input[name=aggregation][value=best]")).to_be_checked()
    expect(pt.locator(".facts")).to_contain_text("0 patients on it now.")
    pt.fill("#id_min_valid_strides", "5")
    expect(seen.locator("li")).to_have_count(3)  # of six, the first half
    expect(pt.locator(".facts")).to_have_text("6 patients on it now.")
    pt.select_option("#id_metric", "score")
    choose(pt, "All types")
    expect(seen.locator(".errors")).to_contain_text("negative ones are never above 0")
    pt.select_option("#id_metric", "hit_rate")
    choose(pt, "The best, and you")
    pt.check("#id_include_simulated")
    expect(seen.locator("li .day").first).to_have_text(names[0])
    pt.select_option("#seen_as", label="Pavel (R-5)")
    expect(seen.locator(".you .day")).to_contain_text(names[5])
    pt.click("text=Save and add another")
    pt.fill("#id_name", "First of all")
    pt.fill("#id_min_valid_strides", "5")
    choose(pt, "While the tablet waits")
    expect(pt.locator("input[name=among][value=clinic]")).to_be_checked()
    expect(seen.locator("li .day")).to_have_text(names[:3])
    pt.click("[name=_save]")
    expect(pt.locator(".success")).to_contain_text("First of all")


def walk_a_demo(pt: Page, tablet: Page) -> None:
    pt.goto("/start/")
    pt.click("text=Try a demo")
    pt.click("text=Change something")
    pt.click("[name=then][value=monitor]")
    tablet.wait_for_selector("body[data-look=ready]")
    pt.click("[data-main]")
    tablet.wait_for_function("() => document.body.dataset.step >= 6")
    pt.click("[data-end]")
    pt.click("text=End session")
    go_on_to_scores(tablet)
