"""A hospital's sign-on by a real provider: link, sign in, roles, confirmation, and out again."""

from __future__ import annotations

import json
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Browser, Page, expect

from tests.support.browsers import SIZES
from tests.support.servers import ROOT, Server, free_port, serve

pytestmark = pytest.mark.browser
PROVIDER = ROOT / "tests" / "support" / "sign_on.mjs"
GROUP = """
from rehab.people.models import Clinic, SignOnGroup
SignOnGroup.everywhere.create(name="gait", clinic=Clinic.everywhere.get(), role="pt")
"""
PATIENT = """
from rehab.people.models import Clinic, Patient
Patient.everywhere.create(clinic=Clinic.everywhere.get(), nickname="Rosa", code="K7-204")
"""
ROLES = """
from rehab.people.models import User
print(sorted(User.everywhere.values_list("username", "role")))
"""


class Hospital:
    """Who works at the hospital, and its sign-on."""

    def __init__(self, folder: Path, server: Server, issuer: str) -> None:
        self.staff, self.server, self.issuer = folder / "staff.json", server, issuer

    def employ(self, **groups: list[str]) -> None:
        """Say who works there now, in which groups."""
        self.staff.write_text(json.dumps({name: {"groups": own} for name, own in groups.items()}))

    def open_patient(self, number: str) -> None:
        """Say whom the health record has open."""
        Path(f"{self.staff}.number").write_text(number)


@pytest.fixture
def hospital(tmp_path: Path) -> Iterator[Hospital]:
    node = shutil.which("node")
    if node is None:
        pytest.skip("no node here, which runs the provider")
    port = free_port()
    settings = {
        "GARRY_OIDC_ISSUER": f"http://localhost:{port}",
        "GARRY_OIDC_CLIENT_SECRET": "a secret between the two of them, of this test",
        "GARRY_OIDC_NAME": "City Hospital",
        "GARRY_OIDC_CREATE": "1",
        "GARRY_SMART_FHIR": f"http://localhost:{port}/fhir",
        "GARRY_SMART_IDENTIFIER": "urn:city-hospital:mrn",
    }
    with serve(tmp_path / "data", settings=settings) as server:
        made = Hospital(tmp_path, server, settings["GARRY_OIDC_ISSUER"])
        made.employ()
        address = f"http://localhost:{server.port}"
        words = [node, str(PROVIDER), str(port), address, str(made.staff)]
        with subprocess.Popen(words, stdout=subprocess.PIPE, text=True) as process:
            assert process.stdout is not None
            assert process.stdout.readline().strip() == "ready"
            try:
                yield made
            finally:
                process.terminate()


@pytest.fixture
def page(browser: Browser, hospital: Hospital) -> Iterator[Page]:
    width, height = SIZES["phone"]
    with browser.new_context(
        base_url=f"http://localhost:{hospital.server.port}",
        viewport={"width": width, "height": height},
    ) as context:
        context.route("https://**", lambda route: route.abort())  # the provider's fonts
        yield context.new_page()


def sign_on(page: Page, name: str) -> None:
    """Sign in at the hospital, which asks once whether GARRY may know who it is."""
    page.fill("[name=login]", name)
    page.fill("[name=password]", "any: the provider's own test pages ask for none")
    page.click("[type=submit]")
    if (agree := page.locator("text=Continue")).count():
        agree.click()


def sign_out(page: Page) -> None:
    page.goto("/account/")
    page.click("main >> text=Sign out")
    page.click("text=Yes, sign me out")
    page.wait_for_url("**/sign-in/**")


def roles(server: Server) -> dict[str, str]:
    listed: list[tuple[str, str]] = eval(server.run_shell(ROLES))  # noqa: S307  # our own print
    return dict(listed)


def test_from_a_link_to_a_role_that_the_hospital_takes_away(hospital: Hospital, page: Page) -> None:
    hospital.employ(anna=["gait"])
    page.goto("/account/")
    page.fill("#id_username", "pt")
    page.fill("#id_password", hospital.server.password)
    page.click("text=Sign in >> nth=-1")
    page.goto("/account/")
    page.click("text=Link with this account")
    sign_on(page, "anna")
    expect(page.locator("main")).to_contain_text("Linked with this account.")
    # Who it is can be confirmed there, by signing in anew.
    page.goto("/account/confirm/?next=/account/sign-ins/")
    page.click("text=City Hospital")
    sign_on(page, "anna")
    page.wait_for_url("**/account/sign-ins/")
    sign_out(page)
    # Without groups here, a role is what it was.
    page.goto("/patients/new/")
    page.click("text=City Hospital")
    sign_on(page, "anna")
    page.wait_for_url("**/patients/new/")
    assert roles(hospital.server) == {"pt": "lead"}
    sign_out(page)
    # With groups, the hospital says it.
    hospital.server.run_shell(GROUP)
    page.click("text=City Hospital")
    sign_on(page, "anna")
    page.wait_for_url("**/start/")
    assert roles(hospital.server) == {"pt": "pt"}
    # Signing out at the hospital ends it here, without this browser's doing.
    page.goto(f"{hospital.issuer}/session/end")
    page.click("text=Yes, sign me out")
    page.goto("/account/")
    expect(page.locator("h1")).to_have_text("Sign in")
    # In no group any more: refused, with the cure.
    hospital.employ(anna=[])
    page.click("text=City Hospital")
    sign_on(page, "anna")
    expect(page.locator(".notes")).to_contain_text("in no group of your clinic any more")


def test_a_stranger_of_a_group_gets_an_account_and_another_none(
    hospital: Hospital, page: Page
) -> None:
    hospital.employ(ben=["gait"], eve=["cardiology"])
    hospital.server.run_shell(GROUP)
    page.goto("/sign-in/")
    page.click("text=City Hospital")
    sign_on(page, "ben")
    page.wait_for_url("**/start/")
    assert roles(hospital.server)["ben"] == "pt"
    sign_out(page)
    page.click("text=City Hospital")
    sign_on(page, "eve")
    expect(page.locator(".notes")).to_contain_text("No account here is linked to your hospital")
    assert "eve" not in roles(hospital.server)


def test_the_health_record_opens_its_patient(hospital: Hospital, page: Page) -> None:
    hospital.employ(ben=["gait"])
    hospital.server.run_shell(GROUP + PATIENT)
    hospital.open_patient("K7-204")
    page.goto(f"{hospital.issuer}/ehr/launch")
    sign_on(page, "ben")
    page.wait_for_url("**/patients/*/")
    expect(page.get_by_role("heading", name="Rosa")).to_be_visible()
    # The same person, and a patient whom nobody here knows.
    hospital.open_patient("K7-999")
    page.goto(f"{hospital.issuer}/ehr/launch")
    page.wait_for_url("**/start/")
    expect(page.locator(".notes")).to_contain_text("No patient here has the number")
    # Another server's record launches nothing here.
    answer = page.goto(f"{hospital.issuer}/ehr/launch?iss=https://elsewhere.example/fhir")
    assert answer is not None
    assert answer.status == 404
