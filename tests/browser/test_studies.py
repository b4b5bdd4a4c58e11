"""A study in a real browser: planned without code, walked blind, an arm revealed on the record."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import pytest
from playwright.sync_api import Browser, Dialog, Page, expect

from tests.support.browsers import SIZES
from tests.support.servers import Server, serve

pytestmark = pytest.mark.browser

PEOPLE = """
import json
from django.utils import timezone
from rehab.people.consent.models import Purpose
from rehab.people.consent.services import record_consent
from rehab.people.models import User
from rehab.people.sign_in.first_start import first_clinic
from tests.support.walk_seed import browser_session
from tests.support.walks import make_patient
clinic = first_clinic()
found = {}
for name, role in (("lena", "lead"), ("theo", "pt"), ("asha", "pt")):
    user = User.everywhere.create_user(name, role=role, clinic=clinic)
    found[name] = browser_session(user)
rosa = make_patient(clinic, code="R1")
record_consent(rosa, Purpose.RESEARCH, None, timezone.now())
found["patient"] = rosa.pk
print(json.dumps(found))
"""
# What would tell the assessor the condition: the arms' names and types, as people and as programs
# call them. The type that a set-up offers to everybody by default is in no arm.
TELLING = re.compile("sunny side|stern side|negative|explicit", re.IGNORECASE)


@contextmanager
def page_of(browser: Browser, server: Server, cookie: str) -> Iterator[Page]:
    width, height = SIZES["laptop"]
    context = browser.new_context(base_url=server.url, viewport={"width": width, "height": height})
    context.add_cookies([{"name": "sessionid", "value": cookie, "url": server.url}])
    context.set_default_timeout(40_000)
    page = context.new_page()
    yield page
    context.close()


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    """Run a server that logs as much as any can."""
    with serve(tmp_path_factory.mktemp("data"), settings={"GARRY_LOG_LEVEL": "DEBUG"}) as running:
        yield running


@pytest.fixture(scope="module")
def people(server: Server) -> dict[str, Any]:
    made: dict[str, Any] = run_inside(server, PEOPLE)
    return made


def plan_by_clicks(page: Page) -> None:
    page.goto("/studies/")
    page.click("text=Plan a study")
    page.fill("#id_code", "VAL")
    page.fill("#id_title", "Two ways to answer a step")
    page.fill("#id_question", "Which way keeps more of the push-off?")
    page.fill("#id_participants", "12")
    page.fill("#id_months_since_stroke", "")
    page.click("summary:has-text('Allocation')")
    page.fill("#id_block_sizes", "2, 4")
    page.select_option("#id_primary_outcome", "washout_change")
    for row, (code, name, valence) in enumerate(
        (("A", "Sunny side", "explicit"), ("B", "Stern side", "negative"))
    ):
        page.fill(f"#id_arm-{row}-code", code)
        page.fill(f"#id_arm-{row}-name", name)
        page.select_option(f"#id_arm-{row}-valence", valence)
        page.select_option(f"#id_arm-{row}-protocol", label="Baseline, training, washout")
    page.click("button:has-text('Save')")
    expect(page.locator("h1")).to_have_text("VAL Draft")
    expect(page.locator(".risk")).to_contain_text("punishment has worked worse")
    page.click("text=Register")
    page.fill("#id_everybody", "Whoever walks on a treadmill.")
    page.click("button:has-text('Register')")
    page.select_option("#mark-assessor", label="asha")
    page.click("form:has(#mark-assessor) button")
    page.click("text=Start enrolling")
    expect(page.locator("dl")).to_contain_text("asha")
    page.click("button:has-text('Start enrolling')")
    expect(page.locator("h1")).to_have_text("VAL Running")


def enroll_and_start(page: Page, study: str) -> str:
    """Take the patient in, start the first visit; return the address of the session."""
    page.goto(study)
    page.click("text=Enroll a patient")
    page.select_option("#id_patient", label="Rosa (R1)")
    page.fill("#id_consent_version", "1.0")
    page.fill("#id_consented_on", "2026-11-20")
    page.check("[name=keep_data][value=yes]")
    page.click("button:has-text('Enroll')")
    expect(page.locator("h1")).to_have_text("VAL-001 Rosa")
    page.click("button:has-text('Start visit 1')")
    page.wait_for_url("**/monitor/")
    return page.url


AUDITED = """
import json
from rehab.people.audit.audit_log import AuditEntry
rows = AuditEntry.everywhere.filter(by__username="asha")
print(json.dumps([f"{row.act} {row.through} {row.about}" for row in rows]))
"""


def run_inside(server: Server, program: str) -> Any:
    """Run a program with the server's rows; return the JSON that it prints."""
    return json.loads(server.run_shell(program))


def look_everywhere(page: Page, addresses: list[str]) -> None:
    """Open what an assessor may open; every title, address and answer is searched."""
    heard: list[tuple[str, str]] = []
    page.on("response", lambda answer: heard.append((answer.url, read(answer))))
    page.on(
        "websocket",
        lambda socket: socket.on(
            "framereceived", lambda frame: heard.append((socket.url, str(frame)))
        ),
    )
    for address in addresses:
        answer = page.goto(address)
        assert answer is not None
        assert answer.status == 200, address
        heard.append((page.url, page.title()))
    found = [
        (url, text[m.start() - 80 : m.end() + 20])
        for url, text in heard
        if (m := TELLING.search(text))
    ]
    assert not [url for url, _ in heard if TELLING.search(url)]
    assert len(heard) > len(addresses)
    assert found == []


def read(answer: Any) -> str:
    """Return an answer's text without the links that pick a type, which everybody's pages list.

    Scripts and pictures are the same for everybody.
    """
    kind = answer.headers.get("content-type", "")
    text = answer.text() if "html" in kind or "json" in kind else ""
    return re.sub(r"(?s)<a\s[^>]*\?type=.*?</a>", "", text)


def test_a_study_is_planned_walked_blind_and_an_arm_is_revealed(server, browser, people):
    with page_of(browser, server, people["lena"]) as lead:
        plan_by_clicks(lead)
        study = lead.url
    with page_of(browser, server, people["theo"]) as pt:
        monitor = enroll_and_start(pt, study)
        participant = f"{server.url}/participants/1/"
        session = re.search(r"/sessions/(\d+)/", monitor).group(1)

        server.read_log()  # up to here others asked
        with page_of(browser, server, people["asha"]) as assessor:
            patient = f"/patients/{people['patient']}/"
            own = ["/start/", patient, f"{patient}sessions/", f"{patient}records/"]
            look_everywhere(assessor, [*own, "/studies/", study, participant, "/api/v1/sessions"])
            for part in ("", "monitor/", "details/", "report/", "scores/"):
                answer = assessor.goto(f"/sessions/{session}/{part}")
                assert answer is not None
                assert answer.status == 404, part
            for kind in ("patient", "monitor"):
                frames = assessor.evaluate(LISTEN, f"/ws/session/{session}/{kind}/")
                assert [json.loads(frame)["code"] for frame in frames] == ["no_session"]
            assessor.goto(participant)
            assessor.click("text=Reveal the arm")
            assessor.fill("#why-reveal", "curious")
            assessor.click("button:has-text('Reveal')")
            expect(assessor.locator(".errorlist")).to_contain_text("Ask a lead")
            assert not TELLING.search(assessor.locator("main").inner_text())
        logged = server.read_log()
        assert not TELLING.search(logged)
        audited = run_inside(server, AUDITED)
        assert any(study.removeprefix(server.url) in row for row in audited)
        assert not TELLING.search(" ".join(audited))

        pt.goto(participant)
        pt.click("text=Reveal the arm")
        pt.fill("#why-reveal", "dizzy after the third block")
        pt.check("[name=emergency]")
        pt.check("[name=alone]")
        pt.click("button:has-text('Reveal')")
        expect(pt.locator(".revealed")).to_contain_text("side")
    with page_of(browser, server, people["lena"]) as lead:
        lead.goto(study)
        told = lead.locator("main")
        expect(told).to_contain_text("dizzy after the third block")
        expect(told).to_contain_text("Arm revealed in an emergency (theo)")
        expect(told).to_contain_text("Revealing the arm was refused (asha)")
        lead.goto("/admin/rehab/auditentry/")
        expect(lead.locator("main, #content").last).to_contain_text("Revealed a study's arm")


def test_a_plan_is_short_answers_at_once_and_keeps_what_was_typed(server, browser, people):
    with page_of(browser, server, people["lena"]) as page:
        page.goto("/studies/new/")
        assert page.evaluate("document.documentElement.scrollHeight") < 2200
        fields = page.locator(":is(input, select, textarea):visible")
        assert fields.count() <= 24
        size = page.locator(".size")
        expect(size).to_be_hidden()
        page.fill("#id_difference", "5")
        page.fill("#id_planned_sd", "10")
        expect(size).to_contain_text("128 participants")
        page.click("text=Plan 144")
        expect(page.locator("#id_participants")).to_have_value("144")
        test = page.locator("#id_primary_outcome option[value='10mwt_follow_up']")
        expect(test).to_be_disabled()
        page.fill("#id_follow_up_days", "28")
        page.locator("#id_follow_up_days").blur()
        expect(test).to_be_enabled()

        page.fill("#id_code", "KEPT")
        page.fill("#id_title", "Two ways")
        page.fill("#id_question", "Which?")
        page.select_option("#id_primary_outcome", "10mwt_follow_up")
        for row, valence in enumerate(("positive", "explicit")):
            page.fill(f"#id_arm-{row}-name", valence)
            page.select_option(f"#id_arm-{row}-valence", valence)
        page.click("summary:has-text('Days and goal')")
        page.fill("#id_days_between", "")
        page.click("summary:has-text('Days and goal')")
        page.click("button:has-text('Save')")  # what is wrong in a fold opens it
        expect(page.locator("#id_days_between")).to_be_visible()
        page.fill("#id_days_between", "2")
        page.fill("#id_follow_up_days", "")
        page.click("summary:has-text('Allocation')")
        page.fill("#id_block_sizes", "3")
        page.click("button:has-text('Save')")
        expect(page.locator(".errorlist").first).to_be_visible()
        expect(page.locator("#id_block_sizes")).to_have_value("3")
        for name, value in (("code", "KEPT"), ("days_between", "2"), ("difference", "5")):
            expect(page.locator(f"#id_{name}")).to_have_value(value)
        page.fill("#id_block_sizes", "2, 4")
        page.click("button:has-text('Save')")
        expect(page.locator("[role=alert] a")).to_contain_text("give the days to it")
        asked: list[str] = []

        def stay(dialog: Dialog) -> None:
            asked.append(dialog.type)
            dialog.dismiss()

        page.on("dialog", stay)
        page.get_by_role("link", name="Back").click()  # not left unasked
        page.wait_for_timeout(500)
        assert asked == ["beforeunload"]
        page.fill("#id_follow_up_days", "28")
        page.click("button:has-text('Save')")
        expect(page.locator("h1")).to_have_text("KEPT Draft")
        expect(page.locator("main")).to_contain_text("128 participants")


LISTEN = """path => new Promise(done => {
  const frames = [];
  const socket = new WebSocket(path.startsWith("/") ? `ws://${location.host}${path}` : path);
  socket.onmessage = (message) => frames.push(message.data);
  socket.onclose = () => done(frames);
  setTimeout(() => done(['{"code": "still open"}']), 10000);
})"""
