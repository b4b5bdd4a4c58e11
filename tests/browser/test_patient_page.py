"""The patient's page in a real browser, against a real server: states, numbers, lost networks."""

from __future__ import annotations

import re
import subprocess
import sys
from contextlib import ExitStack
from typing import Any

import pytest
from playwright.sync_api import Page, expect

from tests.support.browsers import PATIENCE_MS, signed_in
from tests.support.patient_page import DIGEST, open_page, start, stored, until_step
from tests.support.servers import ROOT, Server
from tests.support.walk_seed import Walk, feet_of, hear, make_walks, robot_of
from tests.support.wire import Wire

pytestmark = pytest.mark.browser

VALENCES = ("positive", "negative", "binary", "explicit")
TABLETS = ("tablet-portrait", "tablet-landscape")
STRIDES = 30
# Records what a page is given of steps, through the same module that the page itself uses.
RECORD = """async (path) => {
  const { connect } = await import("garry/shared/session_socket");
  window.given = []; window.links = []; window.snapshots = [];
  window.live = connect(path, {
    onSnapshot: (snapshot) => snapshots.push(snapshot.number),
    onSteps: (steps) => given.push(...steps.map(({ number }) => number)),
    onEvent: (event) => event.kind === "step" && given.push(event.number),
    onLink: (state) => links.push(state),
  });
}"""


UNHEARD = "The stop did not get through. Use the robot’s own switch, or call your therapist."


def looks(page: Page, look: str, words: str | re.Pattern[str] = "") -> None:
    page.wait_for_selector(f"body[data-look={look}]")
    if words:
        expect(page.locator(".words")).to_have_text(words)


def expected_key(valence: str, steps: list[dict[str, Any]]) -> str:
    if valence == "explicit":
        shown = steps[-1]["shown"]
        return "—" if shown is None else f"{shown:.2f}"
    return str(sum(step["points"] or 0 for step in steps)).replace("-", "−")


# Every text at least 32 px and on the screen, every button at least 72.
TOO_SMALL = """() => [...document.querySelectorAll("header *, main *")].filter((element) => {
  if (!element.checkVisibility({ checkVisibilityCSS: true, checkOpacity: true })) return false;
  const own = [...element.childNodes].some((node) => node.nodeType === 3 && node.data.trim());
  const { left, right, top, bottom, width, height } = element.getBoundingClientRect();
  if (element.tagName === "BUTTON" && (width < 72 || height < 72)) return true;
  if (!own) return false;
  const out = left < 0 || right > innerWidth || top < 0 || bottom > innerHeight;
  return out || parseFloat(getComputedStyle(element).fontSize) < 32;
}).map((element) => element.outerHTML)"""


def synthetic(server: Server, walk: Walk, seed: int) -> subprocess.Popen[bytes]:
    command = f"-m rehab.sources synthetic --speed 25 --strides {STRIDES} --seed {seed} --stay"
    return subprocess.Popen(
        [sys.executable, *command.split(), "--server", server.url, "--token", walk.source],
        cwd=ROOT,  # what it says is shown with a failure
    )


@pytest.mark.essential
def test_numbers_on_the_page_equal_the_database(server, browser):
    walks = make_walks(server, *({"valence": valence} for valence in VALENCES))
    with ExitStack() as stack:
        pages = []
        for seed, walk in enumerate(walks):
            # Contexts of their own: a tab behind another one is not drawn.
            contexts = [stack.enter_context(signed_in(browser, server, walk)) for _ in TABLETS]
            both = [open_page(*each) for each in zip(contexts, [walk, walk], TABLETS, strict=True)]
            looks(both[0], "ready", "Hello, Rosa.")
            source = synthetic(server, walk, seed)
            stack.callback(source.wait, 10)
            stack.callback(source.terminate)
            both[0].click("text=Start")
            pages.append(both)
        for valence, walk, both in zip(VALENCES, walks, pages, strict=True):
            for page in both:
                until_step(page, STRIDES)
            steps = stored(server, walk)
            assert [step["number"] for step in steps] == list(range(1, STRIDES + 1))
            hits = [None if s["hit"] is None else bool(s["hit"]) for s in steps[-6:]]
            for page in both:
                expect(page.locator(".key")).to_have_text(
                    expected_key(valence, steps), timeout=PATIENCE_MS
                )
                shown = page.evaluate(DIGEST)
                assert [None if dot == "gap" else dot[0] for dot in shown["dots"]] == hits
                assert page.evaluate(TOO_SMALL) == []


@pytest.mark.parametrize("valence", VALENCES)
def test_what_a_step_shows_is_there_after_a_reload_and_on_a_second_tablet(server, browser, valence):
    (walk,) = make_walks(server, {"valence": valence, "close_percent": 10})
    emblems = {"positive": "gain neutral", "negative": "neutral loss", "binary": "gain loss"}
    hit, miss = emblems.get(valence, "neutral neutral").split()
    with signed_in(browser, server, walk) as context, feet_of(server, walk) as feet:
        page = open_page(context, walk)
        page.click("text=Start")
        looks(page, "begin")
        for performance, emblem, pennant, sd in (
            (1.12, hit, "yes", None),
            (0.83, miss, "no", 0.01),
            (1.01, "neutral", "no", 0.1),  # too uncertain for a verdict
            (None, "none", "no", None),
            (1.56, hit, "yes", 0.1),
        ):
            feet.walk(performance, sd=sd)
            until_step(page, feet.number)
            shown = page.evaluate(DIGEST)
            assert (shown["words"] == "About at the goal.") == (performance == 1.01)
            assert page.locator(".dots .close:not(.gap)").count() == (feet.number > 2)
            assert (shown["look"], shown["theme"], shown["emblem"]) == ("feedback", valence, emblem)
            assert shown["key"] == expected_key(valence, stored(server, walk))
            thermometer = page.locator(".thermometer")
            assert thermometer.get_attribute("data-hit") == pennant
            is_judged = pennant == "yes" and valence != "explicit"
            assert page.locator(".emblem [data-hit]").count() == is_judged
            assert (thermometer.get_attribute("data-over") is not None) == (performance == 1.56)
            missing = thermometer.get_attribute("data-missing") is not None
            assert missing == (performance is None)
            if not missing:
                continue
            tube = page.locator(".hatched").evaluate("one => getComputedStyle(one).fill")
            assert "#hatch" in tube  # a full tube would read as a goal that was beaten
            with signed_in(browser, server, walk) as other:
                second = open_page(other, walk)
                until_step(second, feet.number)
                assert second.evaluate(DIGEST) == shown
        page.wait_for_timeout(400)
        assert page.evaluate(TOO_SMALL) == []
        page.reload()
        until_step(page, feet.number)
        assert page.evaluate(DIGEST) == shown


@pytest.mark.essential
def test_a_session_from_start_to_scores(server, browser):
    phases = [{"kind": "training", "strides": 3}, {"kind": "catch", "strides": 10}]
    (walk,) = make_walks(server, {"phases": phases})
    with signed_in(browser, server, walk) as context:
        page = open_page(context, walk, "tablet-landscape")
        looks(page, "ready")
        assert page.evaluate(TOO_SMALL) == []
        expect(page.locator(".sub")).to_have_text("Waiting for the sensor.")
        expect(page.locator("text=Start")).to_be_hidden()
        start(page, server, walk)
        looks(page, "waiting", "Waiting for the sensor.")
        with feet_of(server, walk) as feet:
            looks(page, "begin", "Start walking.")
            feet.walk(1.0, 1.1)
            looks(page, "feedback", "Above goal!")
            assert page.locator(".said").text_content() == "Above goal. Plus 1. 2 points."
            page.click("button.pause")
            looks(page, "paused", "Pause.")
            assert page.evaluate(TOO_SMALL) == []
            page.dblclick("text=End")  # a second tap is no answer
            looks(page, "ask", "End this session?")
            page.wait_for_timeout(100)
            assert page.evaluate(TOO_SMALL) == []
            page.click("text=No, go back")
            looks(page, "paused")
            page.click("text=Resume")
            looks(page, "feedback", "Above goal!")
            feet.walk(1.2, 1.0, 1.0)
            looks(page, "calm", "Just walk as you usually do.")
            assert page.evaluate(TOO_SMALL) == []
            assert page.locator(".part p").text_content() == "8 steps to go in this part"
            assert page.locator(".part progress").get_attribute("value") in (None, "0.2")
            assert page.evaluate("document.querySelector('.part progress').value") == 0.2
        looks(page, "lost", "No signal from the sensor.")
        page.click("button.pause")
        page.click("text=End")
        page.click("text=Yes, end")
        page.wait_for_url(f"**/sessions/{walk.session}/ending/")
        page.goto(walk.path)  # what has ended shows its scores
        assert page.url.endswith("/scores/")


def test_late_steps_alter_totals_and_nothing_else(server, browser):
    (walk,) = make_walks(server, {})
    with (
        signed_in(browser, server, walk) as context,
        feet_of(server, walk, clock_s=1010.0, speed=1.0) as feet,
    ):
        page = open_page(context, walk)
        page.click("text=Start")
        looks(page, "begin")
        for time_s, words, key in ((1000.0, "", "1"), (1010.0, "Nearly there.", "1")):
            feet.number += 1
            value = 4.4 if time_s == 1000.0 else 3.5
            step = {"number": feet.number, "time_s": time_s, "side": "left", "value": value}
            feet.say({"type": "step", **step})
            until_step(page, feet.number)
            shown = page.evaluate(DIGEST)
            assert (shown["words"], shown["key"]) == (words, key)
            assert len([dot for dot in shown["dots"] if dot != "gap"]) == feet.number


def test_a_lost_network_loses_and_doubles_nothing(server, browser):
    (walk,) = make_walks(server, {})
    with (
        Wire(server.port) as wire,
        signed_in(browser, server, walk, port=wire.port) as context,
        feet_of(server, walk) as feet,
    ):
        page = open_page(context, walk)
        page.click("text=Start")
        looks(page, "begin")
        page.evaluate(RECORD, f"/ws/session/{walk.session}/monitor/")
        page.wait_for_function("() => snapshots.length")
        feet.walk(1.1, 0.9)
        until_step(page, 2)
        for _ in range(3):  # in the middle of steps, again and again
            wire.cut()
            feet.walk(1.0, 1.2)
        until_step(page, feet.number)

        wire.go_down()
        feet.walk(*[1.05] * 30)
        looks(page, "offline", re.compile("No connection"))
        page.click("button.pause")
        expect(page.locator(".note")).to_have_text("There is no connection. Try again in a moment.")
        wire.come_up()
        until_step(page, feet.number)
        looks(page, "feedback", "Goal met!")

        wire.freeze()  # nothing is closed: the tablet's Wi-Fi is just gone
        feet.walk(0.8, 0.8)
        page.wait_for_timeout(6_500)
        wire.thaw()
        wire.freeze()
        feet.walk(1.3)
        context.set_offline(True)
        context.set_offline(False)  # the tablet notices that it is back
        wire.thaw()
        until_step(page, feet.number)
        assert page.evaluate(DIGEST)["key"] == expected_key("positive", stored(server, walk))
        page.wait_for_function("n => given.at(-1) === n", arg=feet.number)
        assert page.evaluate("given") == list(range(1, feet.number + 1))
        shown = page.evaluate(DIGEST)
        page.reload()
        until_step(page, feet.number)
        assert page.evaluate(DIGEST) == shown


def test_a_page_that_is_signed_out_says_so_and_stops(server, browser):
    walk, _ = make_walks(server, {}, {})
    with Wire(server.port) as wire, signed_in(browser, server, walk, port=wire.port) as context:
        page = open_page(context, walk)
        looks(page, "ready")
        context.clear_cookies()
        wire.cut()
        looks(page, "closed", "This screen has stopped.")
        expect(page.locator(".sub")).to_have_text("Please call your therapist.")
        assert page.locator("text=Reload").is_visible()


@pytest.mark.essential
def test_the_robot_can_be_stopped_from_the_page(server, browser):
    (walk,) = make_walks(server, {})
    with signed_in(browser, server, walk) as context:
        page = open_page(context, walk)
        looks(page, "ready")
        assert page.locator("button.robot").is_hidden()
        with robot_of(server, walk) as robot:
            page.click("text=Stop robot")
            hear(robot, "stop")
            expect(page.locator("button.robot")).to_have_text("Robot stopped")
            assert page.evaluate(TOO_SMALL) == []
        expect(page.locator("button.robot")).to_be_hidden()


def test_a_stop_that_may_not_have_arrived_is_not_believed(server, browser):
    (walk,) = make_walks(server, {})
    with (
        Wire(server.port) as wire,
        signed_in(browser, server, walk, port=wire.port) as context,
        robot_of(server, walk),
    ):
        page = open_page(context, walk)
        button = page.locator("button.robot")
        expect(button).to_have_text("Stop robot")
        expect(button).to_be_visible()  # once the page knows of the robot
        wire.freeze()  # nothing is closed: the tablet's Wi-Fi is just gone
        page.click("text=Stop robot")
        expect(button).to_have_text("Stop sent")
        expect(page.locator(".note")).to_have_text(UNHEARD)
        expect(button).to_have_text("Stop robot")
        wire.go_down()
        wire.thaw()
        looks(page, "offline", re.compile("No connection"))
        page.click("text=Stop robot")
        expect(button).to_have_text("Not sent")
        expect(page.locator(".note")).to_have_text(UNHEARD)


@pytest.mark.parametrize("motion", ["no-preference", "reduce"])
def test_confetti_rests_three_seconds_and_heeds_who_wants_no_motion(server, browser, motion):
    (walk,) = make_walks(server, {})
    with (
        signed_in(browser, server, walk, reduced_motion=motion) as context,
        feet_of(server, walk) as feet,
    ):
        page = open_page(context, walk)
        page.click("text=Start")
        looks(page, "begin")
        feet.walk(0.9)
        looks(page, "feedback")
        fired = page.evaluate(
            """async () => {
              const { createCelebration } = await import("garry/walk/confetti");
              const { celebrate } = createCelebration(document.querySelector(".confetti"));
              return ["none", "much", "most"].map(celebrate);
            }"""
        )
        assert fired == [False, motion != "reduce", False]
