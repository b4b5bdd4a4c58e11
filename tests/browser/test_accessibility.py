"""axe-core finds nothing to complain of on any page; patients' pages have the higher contrast."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from playwright.sync_api import Browser, BrowserContext, Page

from tests.support.axe import check, go_dark
from tests.support.browsers import SIZES, signed_in
from tests.support.patient_page import start
from tests.support.servers import Server
from tests.support.walk_seed import Walk, feet_of, make_walks

pytestmark = pytest.mark.browser

WALKED = """
from django.utils import timezone
from rehab.people.sign_in.first_start import first_clinic
from rehab.sessions.setup.protocol_models import Protocol
from rehab.stations.models import Station
from tests.support.walks import make_patient, visit
rosa = make_patient(first_clinic(), code="R-1")
for number, valence in enumerate(["positive", "negative", "explicit"], start=1):
    visit(rosa, valence, number, 9 - 3 * number, 360, timezone.now())
blocks = Protocol.everywhere.create(clinic=first_clinic(), name="Blocks")
for position, kind in enumerate(["baseline", "training", "washout"], 1):
    blocks.phases.create(position=position, kind=kind, name=kind, feedback=kind == "training")
sessions = rosa.sessions.order_by("pk").values_list("pk", flat=True)
print(Station.everywhere.first().pk, blocks.pk, rosa.pk, *sessions)
"""
PT_PAGES = [
    "/start/",
    "/patients/{patient}/",
    "/patients/new/",
    "/patients/{patient}/new/",
    "/patients/{patient}/details/",
    "/patients/{patient}/screen/",
    "/patients/{patient}/sessions/",
    "/patients/{patient}/home/",
    "/patients/{patient}/records/",
    "/patients/{patient}/consent/",
    "/sessions/{session}/details/",
    "/sessions/{session}/replay/",
    "/sessions/{session}/correct/",
    "/sessions/{session}/report/",
    "/sessions/{walk}/monitor/",
    "/tablets/pair/",
    "/phones/pair/",
    "/sensor/",
    "/first-steps/?step=station",
    "/stations/",
    "/caseload/",
    "/patients/{patient}/tests/",
    "/patients/{patient}/tests/6mwt/",
    "/patients/{patient}/screen/check/",
    "/patients/{patient}/family/",
    "/sessions/two/",
    "/https/",
    "/recordings/check/",
    "/studies/",
    "/export/",
    "/incidents/",
    "/screen-size/",
    "/insight/?goal=any",
    "/help/",
    "/account/",
    "/account/password/",
    "/account/sign-ins/",
    "/account/second-factor/",
    "/account/second-factor/app/",
    "/nowhere/",
]
ADMIN_PAGES = [
    "/admin/",
    "/admin/rehab/trainingsession/?hits_min=90&hits_max=10",
    "/admin/rehab/trainingsession/?also=simulated",
    "/admin/rehab/trainingsession/{session}/change/",
    "/admin/rehab/step/?session__id__exact={session}",
    "/admin/rehab/patient/",
    "/admin/rehab/patient/{patient}/change/",
    "/admin/rehab/protocol/",
    "/admin/rehab/protocol/{protocol}/change/",
    "/admin/rehab/protocol/add/",
    "/admin/rehab/protocol/{protocol}/delete/",
    "/admin/rehab/protocol/{protocol}/history/",
    "/admin/rehab/preset/add/",
    "/admin/rehab/composedgesture/add/",
    "/admin/rehab/station/{station}/change/",
    "/admin/rehab/leaderboard/",
    "/admin/rehab/leaderboard/add/",
]
PATIENT_PAGES = [
    "/sessions/{session}/ending/",
    "/sessions/{session}/scores/",
    "/sessions/{kept}/scores/",
    "/tablet/",
]


@pytest.fixture(scope="module")
def walks(server: Server) -> list[Walk]:
    """One session for each feedback type."""
    types = ("positive", "negative", "binary", "explicit")
    return make_walks(server, *({"valence": valence} for valence in types))


@pytest.fixture(scope="module")
def places(server: Server, walks: list[Walk]) -> dict[str, str]:
    """Somebody who has walked before, and where."""
    told = server.run_shell(WALKED)
    names = ("station", "protocol", "patient", "session", "kept")
    return dict(zip(names, told.split(), strict=False)) | {"walk": str(walks[0].session)}


@pytest.fixture
def context(browser: Browser, server: Server, walks: list[Walk]) -> Iterator[BrowserContext]:
    with signed_in(browser, server, walks[0], reduced_motion="reduce") as made:
        yield made


def open_page(context: BrowserContext, path: str, size: str) -> Page:
    page = context.new_page()
    width, height = SIZES[size]
    page.set_viewport_size({"width": width, "height": height})
    page.goto(path)
    return page


def to_the_foot(page: Page) -> None:
    """Scroll to where a page's buttons, which stay in sight, cover nothing."""
    page.evaluate("scrollTo(0, document.documentElement.scrollHeight)")


@pytest.mark.parametrize("path", [*PT_PAGES, *ADMIN_PAGES])
def test_pages_of_the_staff(context: BrowserContext, places: dict[str, str], path: str) -> None:
    """Light on a laptop, then dark on a phone: the same page, recolored and laid out anew."""
    page = open_page(context, path.format(**places), "laptop")
    page.wait_for_load_state("networkidle")
    assert "/sign-in/" not in page.url
    to_the_foot(page)
    check(page)
    width, height = SIZES["phone"]
    page.set_viewport_size({"width": width, "height": height})
    if page.locator("html[data-pt]").count():  # a worn phone and a patient's screen have one look
        go_dark(page)
    to_the_foot(page)
    check(page)


SPEAK = """
from rehab.people.models import Patient, User
User.everywhere.update(language="{0}")
Patient.everywhere.update(language="{0}")
"""


@pytest.mark.long
@pytest.mark.timeout(600)  # some seventy pages
@pytest.mark.parametrize("language", ["de", "es", "fr", "en"])
def test_every_page_in_each_language_at_twice_its_size(
    context: BrowserContext, server: Server, places: dict[str, str], language: str
) -> None:
    """A laptop's browser at 200 %: half as many pixels each way, and nothing to scroll sideways."""
    server.run_shell(SPEAK.format(language))
    found = []
    for path in [*PT_PAGES, *ADMIN_PAGES, *PATIENT_PAGES]:
        page = open_page(context, path.format(**places), "laptop")
        page.set_viewport_size({"width": 720, "height": 450})
        page.wait_for_load_state("networkidle")
        assert page.locator("html").get_attribute("lang") == language, path
        try:
            check(page, for_patients=path in PATIENT_PAGES)
        except pytest.fail.Exception as problem:
            found.append(f"{path}: {problem}")
        wide = page.evaluate("document.documentElement.scrollWidth - innerWidth")
        if wide > 0:
            found.append(f"{path} scrolls sideways by {wide} px")
        page.close()
    assert found == []


@pytest.mark.parametrize("path", PATIENT_PAGES)
def test_patients_pages(context: BrowserContext, places: dict[str, str], path: str) -> None:
    page = open_page(context, path.format(**places), "tablet-portrait")
    page.wait_for_load_state("networkidle")
    check(page, for_patients=True)


def test_signing_in(browser: Browser, server: Server) -> None:
    with browser.new_context(base_url=server.url) as stranger:
        page = stranger.new_page()
        page.goto("/start/")
        assert page.locator("[type=password]").is_visible()
        check(page)
        page.goto("/")
        check(page)
        page.emulate_media(color_scheme="dark")
        page.wait_for_selector("html[data-pt=dark]")
        check(page)


def test_a_walk_in_every_look(context: BrowserContext, server: Server, walks: list[Walk]) -> None:
    for number, walk in enumerate(walks):
        page = open_page(context, walk.path, ("tablet-portrait", "tablet-landscape")[number % 2])

        def look(name: str, page: Page = page) -> None:
            page.wait_for_selector(f"body[data-look={name}]")
            check(page, for_patients=True)

        look("ready")
        start(page, server, walk)
        look("waiting")
        with feet_of(server, walk) as feet:
            look("begin")
            feet.walk(0.8, None, 1.2)
            page.wait_for_selector("body[data-step='3']")
            look("feedback")
            page.click("[aria-label=Pause]")
            look("paused")
            page.click("[data-ask=end]")
            look("ask")
        page.close()
