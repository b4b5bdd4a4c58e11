"""An export for analysis by one button: prepared before one's eyes, left, gone on with, fetched."""

from __future__ import annotations

import zipfile

import pytest

from tests.support.browsers import Visit, picture
from tests.support.servers import Server

pytestmark = pytest.mark.browser
WALKED = """
from django.utils import timezone
from rehab.people.sign_in.first_start import first_clinic
from tests.support.walks import make_patient, walk
rosa = make_patient(first_clinic(), code="R1")
for day in range(3):
    walk(rosa, "positive", [2.5, 1.5] * 10, days_ago=day, now=timezone.now())
"""


def test_an_export_is_prepared_left_gone_on_with_and_fetched(server: Server, visit: Visit):
    server.run_shell(WALKED)
    page = visit("/export/", size="laptop")
    if "confirm" in page.url:
        page.fill("input[type=password]", server.password)
        page.click("main [type=submit], main button")
        page.wait_for_url("**/export/")
    picture(page, "export-before")
    page.route("**/advance/", lambda route: route.abort())  # as without a network
    page.click("button:has-text('Prepare')")
    page.wait_for_selector(".preparing [role=alert]:not([hidden])")
    assert page.is_hidden(".preparing a[download]")
    page.unroute("**/advance/")
    page.reload()  # it goes on where it was
    page.wait_for_selector(".preparing a[download]:not([hidden])")
    assert page.inner_text("#how-far") == "3 / 3 sessions"
    picture(page, "export-done")
    with page.expect_download() as fetched:
        page.click(".preparing a[download]")
    with zipfile.ZipFile(fetched.value.path()) as archive:
        names = archive.namelist()
    assert {"README.txt", "steps.csv", "codebook.csv", "bids/participants.tsv"} <= set(names)
    page.click("[name=discard]")
    page.wait_for_selector("button:has-text('Prepare')")
    assert not list((server.folder / "exports").iterdir())
