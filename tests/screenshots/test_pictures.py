"""Pictures of every page at every size, to be looked at; complaints and overflow fail."""

from __future__ import annotations

import subprocess
import sys

import pytest

from rehab.sessions.setup.default_protocols import PROTOCOLS
from tests.support.browsers import SIZES, chromium, sign_in
from tests.support.servers import ROOT, clean_environment, serve

pytestmark = pytest.mark.browser

FOLDER = ROOT / "screenshots"
PAGES = {
    "home": "/",
    "account": "/account/",
    "second-factor": "/account/second-factor/app/",
    "admin": "/admin/",
    "patients": "/admin/rehab/patient/",
    "patient-in-admin": "/admin/rehab/patient/2/change/",
    "sessions": "/admin/rehab/trainingsession/",
    "sessions-found": "/admin/rehab/trainingsession/?hits_min=95&hits_max=90&who=2",
    "session": "/admin/rehab/trainingsession/12/change/",
    "protocols": "/admin/rehab/protocol/",
    "protocol": "/admin/rehab/protocol/2/change/",
    "own-protocol": f"/admin/rehab/protocol/{len(PROTOCOLS) + 1}/change/",
    "delete-protocol": f"/admin/rehab/protocol/{len(PROTOCOLS) + 1}/delete/",
    "presets": "/admin/rehab/preset/",
    "preset": "/admin/rehab/preset/1/change/",
    "stations": "/admin/rehab/station/",
    "station": "/admin/rehab/station/1/change/",
    "devices": "/admin/rehab/device/",
    "device": "/admin/rehab/device/1/change/",
    "accounts": "/admin/rehab/user/",
    "account-in-admin": "/admin/rehab/user/1/change/",
    "leaderboards": "/admin/rehab/leaderboard/",
    "leaderboard": "/admin/rehab/leaderboard/add/",
    "feedback": "/admin/rehab/feedbacktype/add/?slug=binary",
    "feedback-types": "/admin/rehab/feedbacktype/",
    "gesture": "/admin/rehab/composedgesture/1/change/",
    "ending": "/sessions/12/ending/",
    "ending-explicit": "/sessions/4/ending/",
    "scores-points": "/sessions/12/scores/",
    "scores-kept": "/sessions/11/scores/",
    "past-sessions": "/patients/2/sessions/",
    "session-details": "/sessions/12/details/",
    "report": "/sessions/12/report/",
    "take-home": "/patients/2/home/",
    "start": "/start/",
    "first-steps": "/first-steps/?step=tablet",
    "first-steps-sensor": "/first-steps/?step=sensor",
    "stations-and-devices": "/stations/",
    "incidents": "/incidents/",
    "screen-size": "/screen-size/",
    "insight": "/insight/?by=type",
    "replay": "/sessions/12/replay/?at=120",
    "help": "/help/#today",
    "patient": "/patients/2/",
    "standard-tests": "/patients/2/tests/",
    "six-minute-walk": "/patients/2/tests/6mwt/",
    "caseload": "/caseload/",
    "check-screen": "/patients/2/screen/check/",
    "side-by-side": "/sessions/two/",
    "new-patient": "/patients/new/",
    "screen": "/patients/2/screen/",
    "pairing": "/tablet/",
    "pair": "/tablets/pair/",
    "phone": "/phones/pair/",
    "sensor": "/sensor/#token=x&place=shank&side=left",
    "check-recording": "/recordings/check/",
    "set-up": "/patients/2/new/",
    "set-up-preset": "/patients/2/new/?preset=1",
    "correct": "/sessions/12/correct/",
    "corrected": "/sessions/11/details/",
    "records": "/patients/2/records/",
    "consent": "/patients/2/consent/",
    "family-links": "/patients/2/family/",
    "consent-words": "/consent/words/",
    "export": "/export/",
    "audit-log": "/admin/rehab/auditentry/",
    "changes": "/admin/rehab/patient/2/history/",
    "ending-largest": "/sessions/14/ending/",  # of a patient who reads German
    "scores-largest": "/sessions/14/scores/",
    "therapist": "/sessions/15/monitor/",  # last: by then there is something to see
}
# How else some of them are looked at: width, height, language, and whether in the dark.
LOOKS = {
    "low-laptop": (1366, 768, "", False),
    "wall": (3840, 2160, "", False),
    "dark": (1440, 900, "", True),
    "es": (800, 1280, "es", False),
    "de": (390, 844, "de", True),
}
LOOKED_AT = (
    *("home", "account", "admin", "start", "patient", "new-patient", "screen", "set-up", "records"),
    *("past-sessions", "session-details", "insight", "replay", "report", "stations-and-devices"),
    *("pair", "first-steps", "check-recording", "protocol", "ending", "ending-largest"),
    *("scores-points", "scores-kept", "scores-largest", "take-home", "therapist"),
)

# A gesture, patient 2 with the sessions 4 to 12, walked over three weeks, and who else is expected.
VISITS = """
from datetime import time, timedelta
from django.utils import timezone
from rehab.people.consent.services import offered_purposes, record_consent
from rehab.people.sign_in.first_start import first_clinic
from rehab.gestures.models import ComposedGesture
from rehab.people.models import Patient, User
from rehab.sessions.corrections import CorrectedField, correct_session
from rehab.sessions.log import SessionEvent, Step
from rehab.sessions.models import TrainingSession
from rehab.sessions.setup.protocol_models import MeasureDefinition, Protocol
from rehab.sessions.setup.presets import Preset
from rehab.patients.visits import plan_visit
from rehab.stations.models import Device, Station
from tests.support.tablets import approved
from tests.support.walks import visit
rosa = Patient.everywhere.create(
    clinic=first_clinic(), code="K7-204", nickname="Rosa", paretic_side="left"
)
for purpose in offered_purposes(rosa.clinic):
    record_consent(rosa, purpose, None, timezone.now())
wave = ComposedGesture.everywhere.create(clinic=first_clinic(), name="slow-wave")
for position, (turn, way) in enumerate([(40, 0.12), (0, -0.12), (-80, 0.12), (0, -0.12), (40, 0)]):
    wave.steps.create(position=position + 1, turn_deg=turn, forward_m=way)
types = "explicit positive positive negative binary positive binary negative positive".split()
for index, valence in enumerate(types):
    days_ago = 3 * (len(types) - 1 - index)
    last = visit(rosa, valence, index + 1, days_ago, 360 + 70 * (index % 3), timezone.now())
walked = Protocol.everywhere.get(clinic=None, name="Baseline, training, washout")
TrainingSession.everywhere.filter(pk=last.pk).update(protocol=walked)
lead = User.everywhere.get(username="pt")
jutta = Patient.everywhere.create(
    clinic=first_clinic(), code="K7-260", nickname="Jutta", paretic_side="left", language="de",
    screen_text="largest",
)
for days_ago in (7, 1):
    visit(jutta, "positive", 20 + days_ago, days_ago, 360, timezone.now())
plan_visit(jutta, timezone.now().date() + timedelta(2), time(14, 15))
excluded = TrainingSession.everywhere.get(pk=11)
changes = {
    CorrectedField.COUNTS: "no",
    CorrectedField.NOTE: "Walked with a cane from minute four on.",
}
correct_session(excluded, changes, "The sensor slipped.", lead, timezone.now())
blocks = Protocol.everywhere.create(
    clinic=first_clinic(), name="Short blocks", description="Four blocks, each a little harder."
)
for position, (kind, name, gain, seconds) in enumerate([
    ("baseline", "Baseline", 1, 60), ("training", "Block 1", 1, 180), ("catch", "Catch", 1, 15),
    ("training", "Block 2", 0.9, 240), ("washout", "Washout", 1, None),
], 1):
    blocks.phases.create(
        position=position, kind=kind, name=name, gain=gain, seconds=seconds,
        feedback=kind == "training",
    )
for name, valence, percent, minutes in (
    ("Gentle start", "positive", 95, 10), ("Challenge", "binary", 118, 20),
):
    Preset.everywhere.create(
        clinic=first_clinic(), name=name, protocol=blocks,
        measure=MeasureDefinition.everywhere.get(clinic=None, slug="a2"),
        options={"valence": valence, "goal_percent": percent, "minutes": minutes},
    )
for station, kind, name, seen in (
    ("Treadmill 1", "tablet", "Tablet by the window", True),
    ("Treadmill 1", "source", "Force plates", True),
    ("Treadmill 1", "robot", "Kobuki", False),
    ("Treadmill 2", "tablet", "Old tablet", True),
):
    place, _ = Station.everywhere.get_or_create(clinic=first_clinic(), name=station)
    device, _ = approved(place, name, kind=kind, browser="Safari, iPad", network="192.168.7.0/24")
    if seen:
        Device.everywhere.filter(pk=device.pk).update(last_seen_at=timezone.now())
    Device.everywhere.filter(name="Kobuki").update(
        created_at=timezone.now() - timedelta(days=1)
    )
    Device.everywhere.filter(name="Old tablet").update(revoked_at=timezone.now())
for number, kind, value in (
    (60, "borg", 3), (180, "pain", 3), (332, "rest", None), (480, "borg", 5),
):
    at = Step.everywhere.get(session=last, number=number).received_at
    SessionEvent.everywhere.create(
        session=last, kind=kind, value=value, after_number=number, at=at
    )
today = timezone.now().date()
plan_visit(rosa, today, time(9, 30))
plan_visit(rosa, today + timedelta(7), time(9, 30))
for name, code, side, at in (
    ("Joon", "K7-211", "right", time(10, 15)),
    ("Amara", "K7-230", "left", time(11, 0)),
    ("Walter", "K7-118", "right", min(time(23, 59), (timezone.now() + timedelta(hours=1)).time())),
):
    who = Patient.everywhere.create(
        clinic=first_clinic(), code=code, nickname=name, paretic_side=side
    )
    plan_visit(who, today, at)
"""

# A second walk, which is set up while the first one is walked.
SECOND = """
from rehab.people.models import Patient
from rehab.stations.models import Station
from rehab.training.steps import Side
from tests.support.walks import make_session
joon = Patient.everywhere.get(code="K7-211")
make_session(joon, trained_side=Side.RIGHT, station=Station.everywhere.get(name="Treadmill 2"))
"""


@pytest.fixture(scope="module")
def signed_in(tmp_path_factory):
    """A browser that is signed in at a server with a dozen sessions."""
    folder = tmp_path_factory.mktemp("data")
    with serve(folder) as first:
        password, environment = first.password, clean_environment(first.folder, first.port)
    for seed, valence in enumerate(("positive", "negative", "binary"), start=1):
        run = ["manage.py", "runsession", f"--synthetic={seed}", "--valence", valence]
        subprocess.run(
            [sys.executable, *run], cwd=ROOT, env=environment, check=True, stdout=subprocess.DEVNULL
        )
    with serve(folder, "--robot", "kinematic") as server, chromium() as browser:
        server.run_shell(VISITS)
        context = browser.new_context(base_url=server.url, reduced_motion="reduce")
        page = context.new_page()
        page.goto("/admin/")
        sign_in(page, password)
        page.goto("/start/")
        page.click("text=Try a demo")
        page.click(".huge")
        page.click("[data-change=start]")
        page.wait_for_selector("body[data-step]")
        server.run_shell(SECOND)
        FOLDER.mkdir(exist_ok=True)
        yield context


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("name", PAGES)
def test_picture(signed_in, name, size):
    width, height = SIZES[size]
    take(signed_in, name, size, width, height)


@pytest.fixture(scope="module", params=LOOKS)
def look(request, signed_in):
    """The name of a look; what is shown has its language."""
    language = LOOKS[request.param][2]
    speak(signed_in, language)
    yield request.param
    if language:
        speak(signed_in, "")


@pytest.mark.parametrize("name", LOOKED_AT)
def test_look(signed_in, name, look):
    width, height, _language, dark = LOOKS[look]
    take(signed_in, name, look, width, height, dark=dark)


def speak(context, language):
    page = context.new_page()
    page.goto("/account/")
    page.select_option("#language", language)
    page.click("form:has(#language) button")
    page.close()


def take(context, name, size, width, height, *, dark=False):
    """Take a picture of a page; fail where it complains or scrolls sideways."""
    page = context.new_page()
    page.set_viewport_size({"width": width, "height": height})
    page.emulate_media(color_scheme="dark" if dark else "light", reduced_motion="reduce")
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
