"""Pictures of the clinic that `garry demo` serves: patients with weeks of history."""

from __future__ import annotations

import subprocess
import sys

import pytest

from tests.support.browsers import SIZES, chromium, sign_in
from tests.support.servers import ROOT, clean_environment, serve

pytestmark = pytest.mark.browser

FOLDER = ROOT / "screenshots"
PAGES = {"demo-start": "/start/", "demo-caseload": "/caseload/", "demo-insight": "/insight/"}
DEMO = {"GARRY_DEMO": "look-around"}


@pytest.fixture(scope="module")
def looking_around(tmp_path_factory):
    """A browser that is signed in at a demonstration."""
    folder, fill = tmp_path_factory.mktemp("data"), [sys.executable, "manage.py", "demo", "--fill"]
    environment = clean_environment(folder, 8000) | DEMO
    subprocess.run(fill, cwd=ROOT, env=environment, check=True)
    with serve(folder, settings=DEMO) as server, chromium() as browser:
        page = browser.new_context(base_url=server.url, reduced_motion="reduce").new_page()
        page.goto("/start/")
        sign_in(page, DEMO["GARRY_DEMO"], "lead")
        page.wait_for_selector("text=Caseload")
        FOLDER.mkdir(exist_ok=True)
        yield page


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("name", PAGES)
def test_pictures_of_a_demonstration(looking_around, name, size):
    width, height = SIZES[size]
    looking_around.set_viewport_size({"width": width, "height": height})
    looking_around.goto(PAGES[name], wait_until="networkidle")
    looking_around.screenshot(path=FOLDER / f"{name}-{size}.png")
    assert looking_around.evaluate("document.documentElement.scrollWidth - innerWidth") <= 0
