"""Pictures of a study's pages, from planning to results, and of a questionnaire."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import ExitStack

import pytest
from playwright.sync_api import BrowserContext

from rehab.people.sign_in.first_start import FIRST_CLINIC
from tests.support.browsers import SIZES, chromium, sign_in
from tests.support.servers import ROOT, serve

pytestmark = pytest.mark.browser

FOLDER = ROOT / "screenshots"
CLOSED_STUDY = ("simulatestudy", "--seed", "1", "--participants", "24", "--visits", "2")
# A draft with power simulations, a study that runs with five participants, and what is asked.
STUDIES = """
import json
from types import SimpleNamespace
from django.utils import timezone
from rehab.people.models import User
from rehab.people.roles import Role
from rehab.people.sign_in.first_start import first_clinic
from rehab.sessions.questionnaires import ask
from rehab.studies.blinding import Task, give_mark, reveal_arms
from rehab.studies.enrolling import withdraw
from rehab.studies.models import Study
from rehab.studies.power_runs import plan_run
from rehab.studies.visits import Place, start_session
from tests.support.studies import draft_study, enrolled, new_patient, running_study
from tests.support.walks import walk
now, lead = timezone.now(), User.everywhere.get(username="pt")
world = SimpleNamespace(clinic=first_clinic(), people={Role.LEAD: lead})
draft = draft_study(
    world, "positive", "negative", "binary", code="NEXT", title="Three ways to answer a step",
    months_since_stroke=None, factors=[["severity", ["mild", "moderate", "severe"]]],
)
draft.arms.filter(code="B").update(schedule="summary", schedule_steps=5)
assumed = {
    "effects": {"A": 0.0, "B": 4.0, "C": 8.0}, "participants": 60, "sd_percent": 10.0,
    "kept_percent": 25.0, "dropout_percent": 5.0,
}
run = plan_run(draft, assumed, 200, lead, now)
run.found = {
    str(seed): [
        ["B", "A", 4.0, 4.0 - 6 + seed % 9, 10.0], ["C", "A", 8.0, 8.0 - 9 + seed % 12, 16.0],
        ["C", "B", 4.0, 4.0 - 7 + seed % 8, 9.0],
    ]
    for seed in range(84)
}
run.worked_at = now
run.save()
study = running_study(world)
asha = User.everywhere.create_user("asha", role=Role.PT, clinic=first_clinic())
give_mark(study, asha, Task.ASSESSOR, lead, now)
people = [
    enrolled(study, new_patient(world, number), now=now, by=lead) for number in range(1, 6)
]
session = start_session(people[0], Place(), lead, now)
session.state, session.started_at, session.ended_at = "finished", now, now
session.save()
reveal_arms(people[1], "Dizzy after the third block", emergency=True, by=lead, now=now)
withdraw(people[2], lead, now, reason="moves to another city")
asked = walk(new_patient(world, 9), "positive", [2.5, 1.5] * 10, now=now)
ask(asked, ["sus", "tlx"], now)
closed = Study.everywhere.get(code="SIM1")
print(json.dumps({
    "studies": "/studies/",
    "study-new": "/studies/new/",
    "study-change": f"/studies/{draft.pk}/plan/",
    "study-draft": f"/studies/{draft.pk}/",
    "study-register": f"/studies/{draft.pk}/register/",
    "study-power": f"/studies/{draft.pk}/power/",
    "study-running": f"/studies/{study.pk}/",
    "study-enroll": f"/studies/{study.pk}/enroll/",
    "study-participant": f"/participants/{people[1].pk}/",
    "study-closed": f"/studies/{closed.pk}/",
    "study-results": f"/studies/{closed.pk}/results/",
    "questions": f"/sessions/{asked.pk}/questions/",
    "questions-asked": f"/sessions/{asked.pk}/details/",
}))
"""
PAGES = (
    *("studies", "study-new", "study-change", "study-draft", "study-register"),
    *(
        "study-power",
        "study-running",
        "study-enroll",
        "study-participant",
        "study-closed",
        "study-results",
    ),
    *("questions", "questions-asked"),
)
Pages = tuple[BrowserContext, dict[str, str]]


@pytest.fixture(scope="module")
def signed_in(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Pages]:
    """A browser that is signed in, and the addresses of the pages."""
    with ExitStack() as stack:
        server = stack.enter_context(serve(tmp_path_factory.mktemp("data")))

        server.manage(*CLOSED_STUDY, "--clinic", FIRST_CLINIC, "--to", str(server.folder / "files"))
        addresses = json.loads(server.run_shell(STUDIES))
        browser = stack.enter_context(chromium())
        context = browser.new_context(base_url=server.url, reduced_motion="reduce")
        page = context.new_page()
        page.goto("/start/")
        sign_in(page, server.password)
        page.wait_for_url("**/start/")
        FOLDER.mkdir(exist_ok=True)
        yield context, addresses


@pytest.mark.parametrize("size", ["laptop", "phone"])
@pytest.mark.parametrize("name", PAGES)
def test_picture(signed_in: Pages, name: str, size: str) -> None:
    context, addresses = signed_in
    width, height = SIZES[size]
    page = context.new_page()
    page.set_viewport_size({"width": width, "height": height})
    complaints: list[str] = []
    page.on("pageerror", lambda error: complaints.append(str(error)))
    page.on("console", lambda said: complaints.append(said.text) if said.type == "error" else None)
    page.goto(addresses[name], wait_until="load" if name == "study-power" else "networkidle")
    page.screenshot(path=FOLDER / f"{name}-{size}.png", full_page=name != "questions")
    overflow = page.evaluate("document.documentElement.scrollWidth - innerWidth")
    page.close()
    assert complaints == []
    assert overflow <= 0, f"{name} scrolls sideways by {overflow} px at {size}"
