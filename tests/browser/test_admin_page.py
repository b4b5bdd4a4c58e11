"""What the admin's scripts do: phases move and are drawn, so is the week, in light and dark."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from playwright.sync_api import Locator, Page, expect

from tests.support.browsers import Visit
from tests.support.servers import Server
from tests.support.walk_seed import make_walks

pytestmark = pytest.mark.browser

SEED = """
from django.utils import timezone
from rehab.people.sign_in.first_start import first_clinic
from rehab.sessions.setup.protocol_models import Protocol
from tests.support.walks import make_patient, strides, walk
rosa = make_patient(first_clinic(), code="R-1")
for valence in ("positive", "binary"):
    walk(rosa, valence, strides(60, 60), now=timezone.now(), wanted=0.6)
blocks = Protocol.everywhere.create(clinic=first_clinic(), name="Blocks")
blocks.phases.create(position=1, kind="baseline", name="Look", feedback=False, strides=60)
blocks.phases.create(position=2, kind="training", name="Push", feedback=True, gain=0.85)
print(blocks.pk)
"""


@pytest.fixture(scope="module")
def protocol(server: Server) -> str:
    return server.run_shell(SEED).strip()


@pytest.fixture
def page(visit: Visit, server: Server, protocol: str) -> Iterator[Page]:
    (walk,) = make_walks(server, {})
    made = visit("about:blank", walk, color_scheme="light")
    complaints: list[str] = []
    made.on("console", lambda said: complaints.append(said.text) if said.type == "error" else None)
    yield made
    assert complaints == []


def drawn_names(page: Page) -> Locator:
    return page.locator(".protocol-drawing text.name")


def test_phases_move_are_added_and_are_drawn_as_they_will_be_walked(page, protocol):
    url = f"/admin/rehab/protocol/{protocol}/change/"
    page.goto(url)
    drawing = page.locator(".protocol-drawing")
    expect(drawing.locator("text.length")).to_have_text(["66 s", "until you move on"])
    expect(drawing.locator("text.gain")).to_have_text("85 %")
    page.get_by_role("button", name="Move down").first.click()
    expect(drawn_names(page)).to_have_text(["Push", "Look"])
    page.locator("#phases-group .add-row a").click()
    row = page.locator("#phases-group tr.form-row:not(.empty-form)").last
    row.locator("[name$=-kind]").select_option("washout")
    row.locator("[name$=-name]").fill("Cool")
    row.locator("[name$=-seconds]").fill("120")
    expect(drawn_names(page)).to_have_text(["Push", "Look", "Cool"])
    expect(drawing.locator(".total")).to_have_text("3 min and the phases that you end")
    page.get_by_role("button", name="Save", exact=True).click()
    expect(page.locator(".messagelist .success")).to_be_visible()
    page.goto(url)
    expect(drawn_names(page)).to_have_text(["Push", "Look", "Cool"])


def test_a_shared_protocol_is_drawn_for_who_may_not_change_it(page):
    page.goto("/admin/rehab/protocol/1/change/")
    expect(drawn_names(page)).not_to_have_count(0)
    assert not page.get_by_role("button", name="Move down").count()


def test_the_week_is_drawn_in_light_and_in_dark(page):
    page.goto("/admin/")
    expect(page.locator("[data-chart=minutes] rect.bar")).to_have_count(1)
    rates = page.locator(".week tbody tr td:nth-of-type(4)")
    expect(rates).to_have_text(["50 %"] * 2)  # a row for each type
    bright = page.evaluate("getComputedStyle(document.body).backgroundColor")
    page.emulate_media(color_scheme="dark")
    expect(page.locator("html")).to_have_attribute("data-pt", "dark")
    assert page.evaluate("getComputedStyle(document.body).backgroundColor") != bright
    page.locator(".theme-toggle").click()  # the reader's own choice beats the device's
    expect(page.locator("html")).to_have_attribute("data-pt", "light")
    assert page.evaluate("getComputedStyle(document.body).backgroundColor") == bright


def test_what_is_used_on_a_tablet_is_large_enough_for_a_finger(page, protocol):
    page.set_viewport_size({"width": 800, "height": 1280})
    for path in (
        "/admin/",
        "/admin/rehab/trainingsession/",
        f"/admin/rehab/protocol/{protocol}/change/",
        "/admin/rehab/preset/add/",
    ):
        page.goto(path)
        small = page.evaluate(
            """() => [...document.querySelectorAll(
              "button, input:not([type=hidden], [type=checkbox], [type=radio]), select, "
              + "header a, .object-tools a, summary, #result_list tbody a, .submit-row a")]
              .filter((one) => one.checkVisibility({ visibilityProperty: true }))
              .filter((one) => one.getBoundingClientRect().height < 43.5)
              .map((one) => one.outerHTML.slice(0, 120))"""
        )
        assert small == [], path


def speak(page: Page, language: str) -> None:
    page.goto("/account/")
    page.select_option("#language", language)
    page.click("form:has(#language) button")


def test_djangos_own_scripts_speak_the_language_of_the_page_as_well(page: Page) -> None:
    speak(page, "de")
    page.goto("/admin/rehab/patient/")
    expect(page.locator(".action-counter")).to_contain_text("ausgewählt")
    page.goto("/admin/rehab/leaderboard/add/")
    expect(page.locator(".datetimeshortcuts").first).to_contain_text("Heute")
    speak(page, "")
