"""Pictures of every page at every size, to be looked at; complaints and overflow fail."""

from __future__ import annotations

import subprocess
import sys

import pytest

from tests.browsers import SIZES, chromium
from tests.servers import ROOT, clean_environment, serve

pytestmark = pytest.mark.browser

FOLDER = ROOT / "screenshots"
PAGES = {
    "home": "/",
    "account": "/account/",
    "second-factor": "/account/second-factor/app/",
    "admin": "/admin/",
    "patients": "/admin/rehab/patient/",
    "sessions": "/admin/rehab/trainingsession/",
    "session": "/admin/rehab/trainingsession/1/change/",
    "protocol": "/admin/rehab/protocol/2/change/",
    "leaderboard": "/admin/rehab/leaderboard/add/",
    "feedback": "/admin/rehab/feedbacktype/add/?slug=binary",
    "feedback-types": "/admin/rehab/feedbacktype/",
    "gesture": "/admin/rehab/gesture/1/change/",
    "scores-points": "/sessions/12/scores/",
    "scores-kept": "/sessions/11/scores/",
    "past-sessions": "/patients/2/sessions/",
    "session-details": "/sessions/12/details/",
    "start": "/start/",
    "patient": "/patients/2/",
    "new-patient": "/patients/new/",
    "set-up": "/patients/2/new/",
    "therapist": "/sessions/13/monitor/",  # last: by then there is something to see
}

# A gesture, and patient 2 with the sessions 4 to 12, walked over three weeks.
VISITS = """
from django.utils import timezone
from rehab.people.first_start import first_clinic
from rehab.gestures.models import Gesture
from rehab.people.models import Patient
from tests.walks import visit
rosa = Patient.everywhere.create(
    clinic=first_clinic(), code="R-1", nickname="Rosa", paretic_side="left"
)
wave = Gesture.everywhere.create(clinic=first_clinic(), name="slow-wave")
for position, (turn, way) in enumerate([(40, 0.12), (0, -0.12), (-80, 0.12), (0, -0.12), (40, 0)]):
    wave.steps.create(position=position + 1, turn_deg=turn, forward_m=way)
types = "explicit positive positive negative binary positive binary negative positive".split()
for index, valence in enumerate(types):
    days_ago = 3 * (len(types) - 1 - index)
    visit(rosa, valence, index + 1, days_ago, 360 + 70 * (index % 3), timezone.now())
"""


@pytest.fixture(scope="module")
def signed_in(tmp_path_factory):
    """A browser that is signed in at a server with a dozen sessions."""
    folder = tmp_path_factory.mktemp("data")
    with serve(folder, "--robot", "kinematic") as server, chromium() as browser:
        for seed, valence in enumerate(("positive", "negative", "binary"), start=1):
            subprocess.run(
                [
                    sys.executable,
                    "manage.py",
                    "runsession",
                    f"--synthetic={seed}",
                    "--valence",
                    valence,
                ],
                cwd=ROOT,
                env=clean_environment(server.folder, server.port),
                check=True,
                stdout=subprocess.DEVNULL,
            )
        subprocess.run(
            [sys.executable, "manage.py", "shell", "-v0", "-c", VISITS],
            cwd=ROOT,
            env=clean_environment(server.folder, server.port),
            check=True,
        )
        context = browser.new_context(base_url=server.url, reduced_motion="reduce")
        page = context.new_page()
        page.goto("/admin/")
        page.fill("#id_username", "pt")
        page.fill("#id_password", server.password)
        page.click("[type=submit]")
        page.goto("/start/")
        page.click("text=Try a demo")
        page.click(".huge")
        page.click("[data-change=start]")
        page.wait_for_selector("body[data-step]")
        FOLDER.mkdir(exist_ok=True)
        yield context


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("name", PAGES)
def test_picture(signed_in, name, size):
    width, height = SIZES[size]
    page = signed_in.new_page()
    page.set_viewport_size({"width": width, "height": height})
    complaints: list[str] = []
    page.on("pageerror", lambda error: complaints.append(str(error)))
    page.on("console", lambda said: complaints.append(said.text) if said.type == "error" else None)
    page.goto(PAGES[name], wait_until="networkidle")
    if name == "therapist":
        page.wait_for_timeout(6_000)  # a robot decides every five seconds
    page.screenshot(path=FOLDER / f"{name}-{size}.png")
    overflow = page.evaluate("document.documentElement.scrollWidth - innerWidth")
    page.close()
    assert complaints == []
    assert overflow <= 0, f"{name} scrolls sideways by {overflow} px at {size}"
