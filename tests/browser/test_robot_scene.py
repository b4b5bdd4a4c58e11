"""The robot on the PT's page: seen from above, it moves; and what it waits for is said."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager

import pytest
from playwright.sync_api import Browser, Page, expect
from websockets.sync.client import ClientConnection

from robot.wire.incident import pack, read_lines
from tests.support.browsers import signed_in
from tests.support.incidents import BUMPED
from tests.support.robot_reports import STATUS
from tests.support.servers import Server
from tests.support.walk_seed import hear, make_walks, robot_of

pytestmark = pytest.mark.browser

REAL = STATUS | {"base": "kobuki", "bumpers": True, "battery_v": 15.5, "battery_share": 0.7}


SEED = """
from rehab.gestures.models import ComposedGesture
from rehab.people.sign_in.first_start import first_clinic
wave = ComposedGesture.everywhere.create(clinic=first_clinic(), name="wave")
wave.steps.create(position=1, turn_deg=40)
wave.steps.create(position=2, forward_m=0.1)
wave.steps.create(position=3, forward_m=-0.1)
wave.steps.create(position=4, turn_deg=-40)
print(wave.pk)
"""
# What a page plays is not heard here; its WebAudio graph is looked at instead.
LISTEN = """
window.heard = [];
const { start } = OscillatorNode.prototype;
OscillatorNode.prototype.start = function (at) {
  window.heard.push(this.frequency.value);
  return start.call(this, at);
};
"""


def pose(x_m: float, y_m: float = 0.0, heading_rad: float = 0.0) -> dict[str, float]:
    return {"x_m": x_m, "y_m": y_m, "heading_rad": heading_rad}


@contextmanager
def monitor(browser: Browser, server: Server, size: str) -> Iterator[tuple[Page, ClientConnection]]:
    """Open the PT's page of a session, and dial in as its robot."""
    (walk,) = make_walks(server, {"valence": "positive"})
    with (
        signed_in(browser, server, walk, size, reduced_motion="reduce") as context,
        robot_of(server, walk, "kobuki") as robot,
    ):
        page = context.new_page()
        page.goto(walk.monitor_path)
        yield page, robot


def report(robot: ClientConnection, **more: object) -> None:
    robot.send(json.dumps({"type": "report", "report": REAL | more}))


def middle(page: Page) -> tuple[float, float]:
    """Return where the robot is drawn, in pixels from the middle of its scene."""
    scene = page.locator("#scene").bounding_box()
    base = page.locator("#scene .robot-base circle").first.bounding_box()
    assert scene is not None
    assert base is not None
    return (
        base["x"] + base["width"] / 2 - scene["x"] - scene["width"] / 2,
        base["y"] + base["height"] / 2 - scene["y"] - scene["height"] / 2,
    )


def test_the_scene_moves_and_shows_lights_and_mood(server, browser):
    with monitor(browser, server, "laptop") as (page, robot):
        scene, base = page.locator("#scene"), page.locator("#scene .robot-base")
        report(robot, pose=pose(0.0), lights=["orange", "off"], mood="glad")
        expect(base).to_have_attribute("data-pose", "0.000 0.000 0.000")
        expect(page.locator("[data-show=robot-state]")).to_have_text("it celebrates…")
        page.locator("[data-enlarge]").click()
        box = scene.bounding_box()
        assert box is not None
        assert min(box["width"], box["height"]) >= 280
        assert middle(page) == pytest.approx((0, 0), abs=1.5)
        report(robot, pose=pose(0.1), lights=["green", "green"], mood="glad")
        expect(base).to_have_attribute("data-pose", "0.100 0.000 0.000")
        tenth = min(box["width"], box["height"]) / 10  # the scene is 1 m wide
        assert middle(page) == pytest.approx((0, -tenth), abs=1.5)  # ahead is up
        report(robot, pose=pose(0.1, 0.1, 0.5), lights=["green", "off"], mood="sad")
        expect(base).to_have_attribute("data-pose", "0.100 0.100 0.500")
        assert middle(page) == pytest.approx((-tenth, -tenth), abs=1.5)  # left is left
        expect(base.locator(".light").first).to_have_attribute("data-color", "green")
        expect(base.locator(".light").last).to_have_attribute("data-color", "off")
        expect(base.locator(".mood")).to_have_attribute("data-mood", "sad")
        trail = scene.locator(".trail").get_attribute("d")
        assert trail is not None
        assert trail.count("L") >= 2
        for part in (".tether", ".treadmill", ".heading"):
            expect(scene.locator(part)).to_be_visible()
        page.locator("[data-enlarge]").click()
        expect(scene).to_be_hidden()


@pytest.mark.parametrize("size", ["tablet-portrait", "phone"])
def test_it_is_large_enough_on_small_screens(server, browser, size):
    with monitor(browser, server, size) as (page, robot):
        report(robot, pose=pose(0.0))
        expect(page.locator("[data-show=robot-state]")).to_have_text("it celebrates…")
        box = page.locator("#scene").bounding_box()
        assert box is not None
        assert min(box["width"], box["height"]) >= 280


def test_a_robot_away_from_home_says_so_and_is_let_go_on_by_a_person(server, browser):
    with monitor(browser, server, "laptop") as (page, robot):
        report(robot, state="away", reason="away_from_home", gesture=None, pose=pose(0.08))
        expect(page.locator("[data-show=robot-state]")).to_have_text("away from its place")
        expect(page.locator("[data-show=robot-why]")).to_have_text(
            "It is standing still: away from its place."
        )
        expect(page.locator("[data-show=robot-cure]")).to_have_text(
            "Carry it back to its mark, facing as before."
            " Put it on its mark with nobody near it, then:"
        )
        page.get_by_role("button", name="Let it move").click()
        hear(robot, "arm")
        report(robot, state="idle", gesture=None, pose=pose(0.0))
        expect(page.locator("[data-show=robot-state]")).to_have_text("waiting")


def test_a_composed_gesture_is_played_with_lights_and_sound(server, visit):
    made = server.run_shell(SEED).strip()
    (walk,) = make_walks(server, {})
    page = visit("about:blank", walk)
    page.add_init_script(LISTEN)
    page.goto(f"/admin/rehab/composedgesture/{made}/change/")
    scene, base = page.locator(".gesture-floor svg"), page.locator(".gesture-floor .robot-base")
    scene, film = scene.first, scene.last
    box = scene.bounding_box()
    assert box is not None
    assert min(box["width"], box["height"]) >= 280
    at_home = [part.get_attribute("transform") for part in film.locator("> g").all()]
    page.get_by_role("button", name="Play it, with lights and sound").click()
    expect(base.locator(".light").first).to_have_attribute("data-color", "orange")
    page.wait_for_function(
        "() => parseFloat(document.querySelector('.robot-base').dataset.pose) > 0.05"
    )
    seen = [part.get_attribute("transform") for part in film.locator("> g").all()]
    stays = [now == before for now, before in zip(seen, at_home, strict=True)]
    assert stays == [True, *[False] * 5]  # its mark; three discs of its side, top and face
    expect(page.get_by_role("button", name="Play it, with lights and sound")).to_be_enabled(
        timeout=20_000
    )
    x_m, y_m, heading_rad = map(float, (base.get_attribute("data-pose") or "").split())
    assert (x_m, y_m, heading_rad) == pytest.approx((0, 0, 0), abs=0.03)
    assert page.evaluate("window.heard") == [440]

    page.goto("/admin/rehab/composedgesture/add/")
    page.fill("#id_name", "Big hello")

    def place(ahead_m: float, left_m: float) -> tuple[float, float]:
        scene.scroll_into_view_if_needed()
        x, y = scene.evaluate(
            """(svg, [x, y]) => {
                const at = new DOMPoint(x, y).matrixTransform(svg.getScreenCTM());
                return [at.x, at.y];
            }""",
            [-left_m, -ahead_m],
        )
        return x, y

    def step(index: int) -> tuple[float, float]:
        fields = (
            page.input_value(f"#id_steps-{index}-{name}") for name in ("turn_deg", "forward_m")
        )
        turn_deg, forward_m = map(float, fields)
        return turn_deg, forward_m

    page.mouse.click(*place(0.1, 0.0))
    page.get_by_role("button", name="Lead it home").click()
    expect(page.locator(".gesture-floor .words")).to_contain_text("up to 0.10 m from home")
    assert step(0) == pytest.approx((0, 0.1), abs=0.004)
    assert step(1) == pytest.approx((0, -0.1), abs=0.004)  # straight back
    page.get_by_role("button", name="Add a turn").click()
    spots = [spot.bounding_box() for spot in scene.locator(".spot").all()]  # two of them at home
    assert spots[1]["y"] + spots[1]["height"] <= spots[2]["y"]
    page.fill("#id_steps-2-turn_deg", "0")  # then it is no step
    page.mouse.move(*place(0.1, 0.0))
    page.mouse.down()
    page.mouse.move(*place(0.1, 0.1), steps=3)
    page.mouse.up()
    assert step(0) == pytest.approx((45, 0.141), abs=1)
    expect(page.locator(".gesture-floor .errornote")).to_contain_text("ends turned by 45°")
    page.get_by_role("button", name="Lead it home").click()
    expect(page.locator(".gesture-floor .words")).to_contain_text("up to 0.14 m from home")
    page.click("[name=_save]")
    expect(page.locator("#result_list")).to_contain_text("big-hello")


def test_a_robot_whose_battery_is_low_asks_to_be_charged(server, browser):
    with monitor(browser, server, "laptop") as (page, robot):
        cure = page.locator("[data-show=robot-cure]")
        report(robot, state="idle", gesture=None, pose=pose(0.0), battery_low=True)
        expect(cure).to_contain_text("“Charge me”: battery 70")
        low = {"reason": "battery_low", "battery_share": 0.1, "battery_low": True}
        report(robot, state="idle", gesture=None, pose=pose(0.0), **low)
        expect(page.locator("[data-show=robot-why]")).to_contain_text("its battery is low")
        expect(cure).to_contain_text("Charge it. “Charge me”: battery 10")
        report(robot, state="idle", gesture=None, pose=pose(0.0), battery_low=False)
        expect(cure).to_have_text("")


def test_one_tap_opens_the_report_of_a_stop_which_plays_it_again(server, browser):
    with monitor(browser, server, "laptop") as (page, robot):
        link = page.get_by_role("link", name="Incident report")
        expect(link).to_have_count(0)
        session = int(page.url.split("/")[-3])
        incident = {"type": "incident", "session": session, "reason": "bump", "ago_s": 5}
        robot.send(json.dumps(incident | {"recording": pack(BUMPED)}))
        with page.context.expect_page() as opened:
            link.click()
        told = opened.value
        expect(told.get_by_role("heading", level=1)).to_have_text(
            "Robot stopped: it bumped into something"
        )
        row = told.get_by_role("row").filter(has_text="felt: it bumped into something")
        expect(row).to_contain_text("0.00 s")
        base = told.locator(".replay .robot-base")
        expect(base).to_have_attribute("data-pose", "0.200 0.000 0.000")
        told.get_by_role("button", name="Play it").click()
        told.wait_for_function(
            "() => parseFloat(document.querySelector('.robot-base').dataset.pose) < 0.1"
        )
        expect(base).to_have_attribute("data-pose", "0.200 0.000 0.000")
        with told.expect_download() as download:
            told.get_by_role("link", name="Download").click()
        assert read_lines(download.value.path().read_text()) == BUMPED
