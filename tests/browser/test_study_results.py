"""A study's figures in a real browser: given out as SVG and as PNG, on the record."""

from __future__ import annotations

import json
from typing import Any

import pytest
from PIL import Image, ImageColor
from playwright.sync_api import expect

from rehab.people.sign_in.first_start import FIRST_CLINIC
from rehab.studies.figures.canvas import COLORS
from tests.support.browsers import Visit, picture
from tests.support.servers import Server

pytestmark = pytest.mark.browser
CLOSED_STUDY = ("simulatestudy", "--seed", "3", "--participants", "12", "--clinic", FIRST_CLINIC)
TELL = """
import json
from rehab.people.audit.audit_log import Act, AuditEntry
from rehab.studies.models import Study
exported = AuditEntry.everywhere.filter(act=Act.EXPORT, by__isnull=False).order_by("pk")
study = Study.everywhere.get(code="SIM3")
print(json.dumps([study.pk, [row.about for row in exported]]))
"""


def tell(server: Server) -> list[Any]:
    told: list[Any] = json.loads(server.run_shell(TELL))
    return told


def test_figures_are_given_out_as_svg_and_png_on_the_record(server: Server, visit: Visit):
    server.manage(*CLOSED_STUDY, "--to", str(server.folder / "simulated"))
    study, _none = tell(server)
    page = visit(f"/studies/{study}/results/", size="laptop")
    picture(page, "study-results")
    with page.expect_download() as fetched:
        page.click("a[href*=learning]")
    assert fetched.value.suggested_filename == "SIM3-learning.svg"
    with page.expect_download() as fetched:
        page.click("button[data-png*=learning]")
    assert fetched.value.suggested_filename == "SIM3-learning.png"
    box = page.locator(".figure svg[role=img]").first.get_attribute("viewBox")
    assert box is not None
    with Image.open(fetched.value.path()) as figure:
        assert figure.format == "PNG"
        assert figure.size == tuple(2 * int(side) for side in box.split()[2:])
        drawn = figure.convert("RGB").getcolors(maxcolors=1 << 24)
    assert drawn is not None
    arms = {ImageColor.getrgb(color) for color in COLORS[:4]}
    assert arms <= {color for _count, color in drawn}
    page.route("**/results/download/*", lambda route: route.abort())  # as without a network
    page.click("button[data-png*=primary]")
    expect(page.locator(".figure [role=alert]:not(:empty)")).to_contain_text("did not arrive")
    assert tell(server)[1] == ["SIM3 learning.svg"] * 2
