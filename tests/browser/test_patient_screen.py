"""The patient's page, fitted to one patient: on which side, how calm, with which sounds."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import pytest
from playwright.sync_api import Browser, Page

from tests.support.browsers import signed_in
from tests.support.patient_page import start, until_step
from tests.support.servers import Server
from tests.support.walk_seed import Walk, feet_of, make_walks

pytestmark = pytest.mark.browser

# Keeps what is played, as [frequency, seconds after the first].
LISTEN = """() => {
  window.heard = [];
  const start = OscillatorNode.prototype.start;
  OscillatorNode.prototype.start = function (at) {
    heard.push([Math.round(this.frequency.value), at]);
    return start.call(this, at);
  };
}"""
MOVES = """() => {
  window.moved = 0;
  const animate = Element.prototype.animate;
  Element.prototype.animate = function (...how) { moved += 1; return animate.apply(this, how); };
}"""
# Where the middle of something is, as a share of the window's width; whether words read forward.
MIDDLE = """(selector) => {
  const { left, width } = document.querySelector(selector).getBoundingClientRect();
  return (left + width / 2) / innerWidth;
}"""
BOX = """(selector) => {
  const { left, top, right, bottom } = document.querySelector(selector).getBoundingClientRect();
  return [left, top, right, bottom].map(Math.round);
}"""
READS_FORWARD = """(selector) => {
  const range = document.createRange();
  const text = document.querySelector(selector).firstChild;
  const left = (n) => {
    range.setStart(text, n);
    range.setEnd(text, n + 1);
    return range.getBoundingClientRect().left;
  };
  return left(0) < left(2);
}"""


@contextmanager
def page_of(
    browser: Browser, server: Server, walk: Walk, size: str = "tablet-portrait"
) -> Iterator[Page]:
    """Open a running session's page, with what it plays and moves on record."""
    with signed_in(browser, server, walk, size) as context:
        page = context.new_page()
        page.add_init_script(f"({LISTEN})(); ({MOVES})();")
        page.goto(walk.path)
        start(page, server, walk)
        yield page


@pytest.mark.parametrize("size", ["tablet-portrait", "tablet-landscape"])
def test_the_thermometer_stands_where_the_patient_looks(
    browser: Browser, server: Server, size: str
) -> None:
    sides = ("right", "left", "center")
    walks = make_walks(server, *({"screen": {"screen_side": side}} for side in sides))
    at, wide = {}, {}
    for side, walk in zip(sides, walks, strict=True):
        with page_of(browser, server, walk, size) as page, feet_of(server, walk) as feet:
            feet.walk(0.9, 1.1)
            until_step(page, 2)
            parts = (
                *(".thermometer .wall", ".key", ".words", ".phrase", ".emblem"),
                *(".pennant text", ".tip"),
            )
            at[side] = {part: page.evaluate(MIDDLE, part) for part in parts}
            wide[side] = page.evaluate(
                "() => document.querySelector('.thermometer').getBoundingClientRect().width"
            )
            assert page.evaluate(READS_FORWARD, ".words span")
    for part in (".thermometer .wall", ".phrase", ".pennant text"):
        assert at["left"][part] == pytest.approx(1 - at["right"][part], abs=0.02), part
    assert at["right"][".thermometer .wall"] > 0.7
    assert wide["left"] == pytest.approx(wide["right"], rel=0.01)
    center = at["center"]
    thermometer, total, badge = (center[one] for one in (parts[0], ".key", ".emblem"))
    if size == "tablet-portrait":  # all on the midline
        assert [center[".phrase"], thermometer, total, badge] == pytest.approx(4 * [0.5], abs=0.02)
        assert center[".tip"] > thermometer
    else:  # words and total on one side of it, thermometer and badge on the other
        assert 0.3 < center[".phrase"] < 0.5 < thermometer < 0.7
        assert 0.3 < total < thermometer
        assert badge == pytest.approx(thermometer, abs=0.01)
    assert center[".pennant text"] < thermometer


def test_across_the_largest_words_name_the_goal_on_its_line(
    browser: Browser, server: Server
) -> None:
    """Its tip is there, else its sign. The frame stays; what follows is in its own place."""
    (walk,) = make_walks(server, {"valence": "explicit", "screen": {"screen_text": "largest"}})
    sign, frames = {}, []
    screen = page_of(browser, server, walk, "tablet-landscape")
    with screen as page, feet_of(server, walk) as feet:
        for performance in (0.9, None, 1.1):
            feet.walk(performance)
            until_step(page, feet.number)
            words = page.locator(".words").inner_text().split()[0]
            sign[words] = [page.locator(one).is_visible() for one in (".pennant", ".tip")]
            frames.append([page.evaluate(BOX, part) for part in (".wall", ".goal")])
        near = page.evaluate(BOX, ".goal")[1] - page.evaluate(BOX, ".words")[3]
        page.click(".pause")
        page.wait_for_selector("body[data-look=paused]")
        down = page.evaluate("() => getComputedStyle(document.querySelector('.phrase')).translate")
    assert 40 < near < 60  # clear of the tip
    assert down == "none"
    assert sign == {"Goal:": [False, True], "Not": [True, False]}
    assert frames == [frames[0]] * 3


def test_on_a_calm_page_nothing_moves_and_nothing_bursts(browser: Browser, server: Server) -> None:
    lively, calm = make_walks(server, {}, {"screen": {"screen_still": True}})
    moved = {}
    for walk in (lively, calm):
        with page_of(browser, server, walk) as page, feet_of(server, walk) as feet:
            for number in range(1, 4):
                feet.walk(1.3)
                until_step(page, number)
            moved[walk] = page.evaluate("moved")
            drawn = """() => {
              const canvas = document.querySelector("canvas.confetti");
              const { width, height } = canvas;
              const { data } = canvas.getContext("2d").getImageData(0, 0, width, height);
              return data.some((byte) => byte);
            }"""
            if walk is calm:
                assert page.evaluate(drawn) is False
            else:
                page.wait_for_function(drawn)
    assert moved[lively] > 3
    assert moved[calm] == 0


@pytest.mark.parametrize(
    ("valence", "performance", "tones"),
    [
        ("positive", 1.0, [440, 660]),
        ("positive", 0.8, [383]),
        ("negative", 1.0, [440]),
        ("negative", 0.8, [383, 287]),
        ("binary", 1.2, [505, 758]),
        ("binary", 0.8, [383, 287]),
        ("explicit", 1.2, [505]),
        ("explicit", 0.2, [311]),
    ],
)
def test_pitch_tells_the_performance_and_a_second_tone_the_points(
    browser: Browser, server: Server, valence: str, performance: float, tones: list[int]
) -> None:
    (walk,) = make_walks(server, {"valence": valence, "screen": {"screen_sounds": True}})
    with page_of(browser, server, walk) as page, feet_of(server, walk) as feet:
        page.wait_for_selector(".sound[aria-pressed=true]")  # Start was a touch
        feet.walk(performance)
        until_step(page, 1)
        heard = page.evaluate("heard")
        assert [hz for hz, _ in heard] == tones
        assert heard == sorted(heard, key=lambda tone: tone[1])
        feet.walk(None)
        until_step(page, 2)
        assert len(page.evaluate("heard")) == len(tones)  # what was not measured has no sound
        page.click(".sound")
        assert page.get_attribute(".sound", "aria-pressed") == "false"
        feet.walk(performance)
        until_step(page, 3)
        assert len(page.evaluate("heard")) == len(tones)


def test_without_the_setting_it_is_silent_until_somebody_asks(
    browser: Browser, server: Server
) -> None:
    (walk,) = make_walks(server, {})
    with page_of(browser, server, walk) as page, feet_of(server, walk) as feet:
        feet.walk(1.0)
        until_step(page, 1)
        assert page.evaluate("heard") == []
        page.click(".pause")
        page.click(".sound")
        page.wait_for_selector(".sound[aria-pressed=true]")
        page.click("text=Resume")
        page.wait_for_selector("body:not([data-look=paused])")
        feet.walk(1.0)
        until_step(page, 2)
        assert [hz for hz, _ in page.evaluate("heard")] == [440, 660]
