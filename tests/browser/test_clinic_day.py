"""A clinic's day in a real browser: three taps, no way out by accident, keys alone, one page A4."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager

import pytest
from playwright.sync_api import Browser, Page, expect

from tests.support.browsers import signed_in
from tests.support.servers import Server
from tests.support.walk_seed import Walk, feet_of, make_walks

pytestmark = pytest.mark.browser


def run(server: Server, script: str) -> list[str]:
    """Run a script beside the server; return the words that it prints."""
    return server.run_shell(script).split()


@contextmanager
def page_with(
    browser: Browser,
    server: Server,
    walk: Walk,
    size: str = "tablet-portrait",
    *,
    alone: bool = False,
) -> Iterator[Page]:
    """Open a page of the PT's, or of the paired tablet alone."""
    with signed_in(browser, server, walk, size, alone=alone, has_touch=True) as context:
        yield context.new_page()


# --- today --------------------------------------------------------------------------------------

EXPECTED = """
from datetime import time
from django.utils import timezone
from rehab.people.sign_in.first_start import first_clinic
from rehab.patients.visits import plan_visit
from rehab.stations.models import Station
from tests.support.walks import make_patient
amara = make_patient(first_clinic(), "Amara", code="A-1")
plan_visit(amara, timezone.now().date(), time(9, 30))
Station.everywhere.create(clinic=first_clinic(), name="Window")
"""
SESSIONS = """
from rehab.sessions.models import TrainingSession
print(TrainingSession.everywhere.filter(patient__nickname="Amara").count())
"""


@pytest.mark.essential
def test_from_today_to_walking_in_three_taps(server: Server, browser: Browser) -> None:
    (walk,) = make_walks(server, {})
    run(server, EXPECTED)
    with page_with(browser, server, walk) as page:
        page.goto("/start/")
        page.tap(".today >> text=Amara")
        page.dblclick(".huge")  # a tap that trembles is one tap
        page.wait_for_selector("body[data-look=ready]")
        expect(page.locator(".sub")).to_have_text("Waiting for the sensor.")
        expect(page.locator("[data-change=start]")).to_be_hidden()  # until the sensor is there
        assert run(server, SESSIONS) == ["1"]
        with page_with(browser, server, walk, "laptop") as pt:  # who may begin without one
            pt.goto(f"{page.url}monitor/")
            pt.click("[data-main]")
            page.wait_for_selector("body[data-look=waiting]")
        # Going back asks; whoever walks may rest meanwhile.
        here = page.url
        page.go_back()
        expect(page.locator("dialog.leave")).to_be_visible()
        assert page.url == here
        page.tap("button.pause")
        page.wait_for_selector("body[data-look=paused]")
        page.tap("text=Stay here")
        expect(page.locator("dialog.leave")).to_be_hidden()
        page.go_back()
        page.tap("dialog >> text='Leave'")
        # What is true now, and nothing to be posted again.
        expect(page.locator(".open")).to_contain_text("Open now")
        expect(page.locator(".huge")).to_have_count(0)
        page.goto("/start/")
        expect(page.locator(".today .paused")).to_contain_text("Amara")
        page.tap("text=Try a demo")
        page.wait_for_selector(".huge")
        page.go_back()
        expect(page.locator("h1").first).to_contain_text("Today")


COUNT_TAPS = """addEventListener("click", ({ isTrusted }) => {
  if (isTrusted) localStorage.taps = Number(localStorage.taps ?? 0) + 1;
}, true)"""
WALKED_BEFORE = """
from django.utils import timezone
from rehab.sessions.models import TrainingSession
now = timezone.now()
ended = {{"state": "finished", "started_at": now, "ended_at": now}}
TrainingSession.everywhere.filter(pk={}).update(**ended)
"""


@pytest.mark.essential
def test_three_taps_lead_from_a_patient_to_a_walk_on_the_tablet(
    server: Server, browser: Browser
) -> None:
    """With a paired tablet they end on the therapist's page; no address is typed on the tablet."""
    (walk,) = make_walks(server, {"name": "Bela"})
    run(server, WALKED_BEFORE.format(walk.session))
    with (
        page_with(browser, server, walk, "laptop") as page,
        page_with(browser, server, walk, alone=True) as tablet,
    ):
        tablet.goto("/tablet/")
        page.add_init_script(COUNT_TAPS)
        page.goto("/start/")
        page.click("a.tap:has-text('Bela')")
        page.click(".huge")
        page.wait_for_url("**/monitor/")
        page.click("[data-main]")
        tablet.wait_for_selector("body[data-look=waiting]")
        expect(tablet.locator("header")).to_contain_text("Bela")
        assert page.evaluate("localStorage.taps") == "3"


# --- leaving ------------------------------------------------------------------------------------

FORGET = """
from rehab.stations.models import PinAttempts
PinAttempts.everywhere.all().delete()
"""


def test_nobody_leaves_a_tablet_without_the_pin(server: Server, browser: Browser) -> None:
    (walk,) = make_walks(server, {"pin": "4711"})
    with page_with(browser, server, walk, alone=True) as page:
        page.goto("/tablet/")
        page.wait_for_selector("body.alone[data-look=ready]")
        dialog, wrong = page.locator("dialog.leave"), page.locator("dialog .wrong")
        page.go_back()
        expect(dialog).to_be_visible()
        for pin, said in (("1234", "not the PIN"), ("0000", "not the PIN"), ("9999", "Wait 30")):
            page.fill("[name=pin]", pin)
            page.keyboard.press("Enter")
            expect(wrong).to_contain_text(said)
            expect(page.locator("[name=pin]")).to_have_value("")
        page.tap("text=Stay here")
        page.wait_for_function("document.fullscreenElement")  # any touch fills the screen
        page.evaluate("document.exitFullscreen()")
        expect(dialog).to_be_visible()
        page.tap("text=Stay here")
        assert page.url.endswith(walk.path)
        run(server, FORGET)
        page.tap("button.out")
        page.fill("[name=pin]", "4711")
        page.tap("dialog >> text='Leave'")
        page.wait_for_url("**/sign-in/**")


# --- keys ---------------------------------------------------------------------------------------

# Where the focus is, and what would make it hard to find.
FOCUS = """() => {
  const at = document.activeElement;
  const { outlineStyle, outlineWidth, outlineColor } = getComputedStyle(at);
  const { top, bottom, left, right } = at.getBoundingClientRect();
  const dark = outlineColor.match(/\\d+/g).slice(0, 3).every((part) => part < 70);
  const ringed = outlineStyle !== "none" && parseFloat(outlineWidth) >= 3 && dark;
  const inside = bottom > 0 && right > 0 && top < innerHeight && left < innerWidth;
  const name = at.outerHTML.slice(0, 160);
  return { name, lost: at === document.body, ringed, inside };
}"""


def tab_to(page: Page, selector: str) -> None:
    """Go on by the Tab key until something is reached; what is on the way is seen as well."""
    for _ in range(80):
        page.keyboard.press("Tab")
        focus = page.evaluate(FOCUS)
        if focus["lost"]:
            continue  # the browser's own bar
        if not focus["name"].startswith("<iframe"):
            assert focus["ringed"], focus
            assert focus["inside"], focus
        if page.evaluate("wanted => document.activeElement.matches(wanted)", selector):
            return
    pytest.fail(f"{selector} is not reached on {page.url}")


def test_a_session_by_keys_alone(server: Server, browser: Browser) -> None:
    (walk,) = make_walks(server, {"name": "Keyla"})
    with (
        page_with(browser, server, walk, "laptop") as patient,
        page_with(browser, server, walk, "laptop") as pt,
        feet_of(server, walk) as feet,
    ):
        patient.goto("/start/")
        open_here = f"a[href='{walk.path}']"
        tab_to(patient, open_here)
        patient.keyboard.press("Enter")
        patient.wait_for_selector("body[data-look=ready]")
        tab_to(patient, "[data-change=start]")
        patient.keyboard.press("Enter")
        patient.wait_for_selector("body[data-look=begin]")
        expect(patient.locator("button.pause")).to_be_focused()
        feet.walk(1.1, 0.9)
        patient.wait_for_selector("body[data-look=feedback]")
        expect(patient.locator("button.pause")).to_be_focused()
        patient.keyboard.press("Space")
        patient.wait_for_selector("body[data-look=paused]")
        expect(patient.locator("[data-change=resume]")).to_be_focused()
        patient.keyboard.press("Enter")
        patient.wait_for_selector("body[data-look=feedback]")

        pt.goto("/start/")
        tab_to(pt, f"a[href='{walk.path}monitor/']")
        pt.keyboard.press("Enter")
        expect(pt.locator("[data-show=goal]")).to_have_text("4.00")
        tab_to(pt, "[data-goal='1']")
        pt.keyboard.press("Enter")
        expect(pt.locator("[data-show=goal]")).to_have_text("4.10")
        tab_to(pt, "[data-main]")
        pt.keyboard.press("Space")
        expect(pt.locator("[data-main]")).to_contain_text("Resume")
        expect(pt.locator("[data-main]")).to_be_focused()
        tab_to(pt, "[data-end]")
        pt.keyboard.press("Enter")
        tab_to(pt, "dialog [value=end]")
        pt.keyboard.press("Enter")
        pt.wait_for_url("**/details/")
        expect(pt.locator(".figures")).to_contain_text("50")
        tab_to(pt, ".skip")
        pt.keyboard.press("Enter")
        tab_to(pt, ".more summary")
        pt.keyboard.press("Enter")
        tab_to(pt, f"a[href='{walk.path}report/']")
        pt.keyboard.press("Enter")
        pt.wait_for_url("**/report/")
        patient.wait_for_url("**/ending/")


# --- paper --------------------------------------------------------------------------------------

LONG_DAY = """
from django.utils import timezone
from rehab.people.sign_in.first_start import first_clinic
from rehab.sessions.log import Remark, SessionEvent
from tests.support.walks import make_patient, visit, walk
long = make_patient(first_clinic(), "Maximiliana-Konstantina-Schmidt.", code="C" * 32)
session = visit(long, "negative", 1, 0, 1600, timezone.now())
SessionEvent.everywhere.bulk_create(
    SessionEvent(
        session=session, kind=kind, after_number=n, at=timezone.now(),
        value=n % 11 if kind == Remark.BORG else 1.0, old=3.9,
        data={"phase": "started", "above": True},
    )
    for n in range(40)
    for kind in [*Remark, "robot_stop", "robot_gesture", "robot_decision"]
)
print(session.pk, walk(long, "explicit", []).pk)
"""


def test_a_report_is_one_page_of_paper(server: Server, browser: Browser) -> None:
    (walk,) = make_walks(server, {})
    for session, fewest in zip(run(server, LONG_DAY), (1400, 0), strict=True):
        with page_with(browser, server, walk, "laptop") as page:
            answer = page.goto(f"/sessions/{session}/report/")
            assert answer is not None
            assert answer.ok, page.inner_text("body")
            paper = page.pdf(prefer_css_page_size=True)
            assert len(re.findall(rb"/Type\s*/Page\b", paper)) == 1
            page.emulate_media(media="print")
            page.set_viewport_size({"width": 703, "height": 1030})  # 186 mm between the margins
            cut = "sheet => sheet.scrollHeight - sheet.clientHeight"
            assert page.locator(".sheet").evaluate(cut) <= 0
            notes = page.locator(".notes-space").bounding_box()
            assert notes is not None
            assert notes["height"] > 60
            marks = page.locator("svg path.hit, svg path.miss").evaluate_all(
                "paths => paths.map(({ attributes }) => attributes.d.value.split('M').length - 1)"
            )
            assert sum(marks) >= fewest
