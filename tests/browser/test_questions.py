"""A questionnaire on the tablet: in the patient's language, in the largest words, skippable."""

from __future__ import annotations

import json

import pytest
from playwright.sync_api import Browser, expect

from tests.support.axe import check
from tests.support.browsers import SIZES, picture
from tests.support.servers import Server

pytestmark = pytest.mark.browser
# A finger that is not steady needs some room; nothing may lie beyond the screen's sides.
SMALLEST = """() => {
  const all = [...document.querySelectorAll(".scale label, footer > *")];
  const boxes = all.filter((one) => one.checkVisibility()); // Continue waits for an answer
  const sides = boxes.map((one) => one.getBoundingClientRect());
  return {
    least: Math.min(...sides.flatMap(({ width, height }) => [width, height])),
    wide: document.documentElement.scrollWidth <= innerWidth,
  };
}"""
NOTHING_BELOW = "() => document.documentElement.scrollHeight <= innerHeight"
ENDED = """
import json
from django.utils import timezone
from rehab.people.sign_in.first_start import first_clinic
from rehab.sessions.questionnaires import ask
from rehab.stations.builtin import first_station
from rehab.stations.tablets import COOKIE
from tests.support.tablets import approved
from tests.support.walks import make_patient, walk
clinic = first_clinic()
rosa = make_patient(clinic, code="R1", language="es", screen_text="largest")
session = walk(rosa, "positive", [2.5, 1.5] * 10, now=timezone.now())
session.station = first_station(clinic)
session.save()
ask(session, ["sus", "tlx"], timezone.now())
_, token = approved(session.station)
print(json.dumps({"session": session.pk, "name": COOKIE, "value": token}))
"""


def test_a_patient_answers_in_spanish_with_the_largest_words(server: Server, browser: Browser):
    made = json.loads(server.run_shell(ENDED))
    width, height = SIZES["tablet-portrait"]
    context = browser.new_context(base_url=server.url, viewport={"width": width, "height": height})
    context.add_cookies([{"name": made["name"], "value": made["value"], "url": server.url}])
    context.set_default_timeout(40_000)
    page = context.new_page()
    page.goto(f"/sessions/{made['session']}/ending/")
    page.click(".go")
    page.wait_for_url("**/questions/")
    expect(page.locator("h1")).to_have_text(
        "Creo que me gustaría usar este sistema con frecuencia."
    )
    for size in ("tablet-portrait", "tablet-landscape", "phone"):
        page.set_viewport_size({"width": SIZES[size][0], "height": SIZES[size][1]})
        picture(page, f"sus-{size}")
        fits = page.evaluate(SMALLEST)
        assert fits["wide"], size
        assert fits["least"] >= 44, size
    page.set_viewport_size({"width": width, "height": height})
    check(page)
    assert page.evaluate(NOTHING_BELOW)

    page.click(".scale label:nth-child(4)")
    page.keyboard.press("ArrowRight")  # by a key as by a finger
    page.click(".go")
    expect(page.locator("h1")).to_have_text("Encontré el sistema innecesariamente complejo.")
    page.click("footer a")
    expect(page.locator(".scale :checked")).to_have_value("5")
    page.click("[name=skip]")
    expect(page.locator("h1")).to_have_text("Encontré el sistema innecesariamente complejo.")
    page.click("[name=stop]")
    expect(page.locator("h1")).to_have_text("¿Qué exigencia mental tuvo la tarea?")
    for size in ("tablet-portrait", "tablet-landscape", "phone"):
        page.set_viewport_size({"width": SIZES[size][0], "height": SIZES[size][1]})
        picture(page, f"tlx-{size}")
        assert page.evaluate(NOTHING_BELOW), size
        assert page.evaluate(SMALLEST)["wide"], size
    for value in (5, 40, 0, 100, 55):
        page.click(f".scale label:has([value='{value}'])")
        page.click(".go")
    page.wait_for_function("() => document.querySelector('[name=number]').value === '5'")
    page.click("[name=skip]")
    page.wait_for_url("**/scores/")
    context.close()
