"""What the therapist's page draws: a baseline in its unit, minutes, what is beyond, phases."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from playwright.sync_api import Page, expect

from tests.support.browsers import Visit
from tests.support.layout import boxes
from tests.support.servers import Server
from tests.support.walk_seed import Feet, feet_of, make_walks

pytestmark = pytest.mark.browser

PHASES = [
    {"kind": "baseline", "name": "Baseline", "strides": 50},
    {"kind": "training", "name": "Training", "seconds": 110},
    {"kind": "washout", "name": "Washout", "seconds": 55},
]
OVERLAP = """(selector) => {
  const boxes = [...document.querySelectorAll(selector)].map((one) => one.getBoundingClientRect());
  return boxes.some((a, i) => boxes.slice(0, i).some((b) =>
    a.left < b.right && b.left < a.right && a.top < b.bottom - 2 && b.top < a.bottom - 2));
}"""
# By how much of the goal the baseline is drawn off it; the scale reaches from 50 to 150 %.
FARTHEST = """() => {
  const y = (one) => +one.getAttribute("cy");
  const strip = document.getElementById("strip");
  const [top, goal] = [".above", ".goal"].map((one) => strip.querySelector(one).getBBox().y);
  const calm = [...strip.querySelectorAll(".calm")];
  return Math.max(...calm.map((one) => Math.abs(y(one) - goal))) / (goal - top) / 2;
}"""
MEANS = """async () =>
  (await import("garry/monitor/strip")).runningMeans([2, 4, null, 6]).map((one) => one &&
    [one.mean, one.sd])"""

# Whether the line about the goal is hidden: at a suggestion, once it is declined, at another one,
# at one that is as good as the goal.
KEPT = """async () => {
  const { createGoalCoach } = await import("garry/monitor/controls/goal_coach");
  const session = {
    goal: 3.9, span: 1, unit: "W/kg", wanted_hit_rate: 0.6, goal_adaptation: "suggest", phase: {},
  };
  let press;
  const onPress = (selector, act) => selector === "[data-keep]" && (press = act);
  const coach = createGoalCoach({ show() {}, change() {}, onPress });
  const draw = (suggested_goal) => {
    coach.draw({ ...session, suggested_goal });
    return document.querySelector(".coach").hidden;
  };
  const first = draw(3.7);
  press(null, { ...session, suggested_goal: 3.7 });
  return [first, draw(3.7), draw(3.8), draw(3.95)];
}"""


@pytest.fixture
def walking(server: Server, visit: Visit) -> Iterator[tuple[Page, Feet]]:
    (walk,) = make_walks(server, {"phases": PHASES, "goal_percent": 100})
    page = visit(walk.monitor_path, walk, "laptop", reduced_motion="reduce")
    with feet_of(server, walk) as feet:
        page.click("[data-main]")
        feet.hear("start")
        yield page, feet


def at_stride(page: Page, number: int) -> None:
    expect(page.locator("[data-show=number]")).to_have_text(f"no. {number}")


def test_the_charts_tell_unit_mean_minutes_and_what_is_out_of_range(
    walking: tuple[Page, Feet],
) -> None:
    page, feet = walking
    strip = page.locator("#strip")
    feet.walk(0.9, 1.0, None, 1.1, 1.0)
    at_stride(page, 5)
    expect(page.locator("[data-show=strip]")).to_have_text("Strides in W/kg, mean ± SD")
    coach = page.locator("[data-show=coach]")
    expect(coach).to_contain_text("4 strides. The goal needs at least 50.")
    expect(strip.locator("circle.calm")).to_have_count(4)
    expect(strip.locator(".mean, .spread")).to_have_count(2)
    expect(strip).to_contain_text("W/kg")
    page.reload()  # what was walked before is plotted as well
    expect(strip.locator("circle.calm")).to_have_count(4)
    assert page.evaluate(KEPT) == [False, True, False, True]
    assert page.evaluate(MEANS) == [
        None,
        [3, pytest.approx(2**0.5)],
        [3, pytest.approx(2**0.5)],
        [4, 2],
    ]

    feet.walk(*[1.0] * 47, 1.9, 0.2, *[1.1] * 10)
    at_stride(page, 64)
    expect(page.locator("[data-show=strip]")).to_have_text("Strides against the goal")
    expect(strip.locator("circle.calm")).to_have_count(50)
    assert page.evaluate(FARTHEST) == pytest.approx(0.1, abs=0.01)
    page.reload()  # the latest 60 are read again, and the first five were another than the goal
    expect(strip.locator("circle.calm")).to_have_count(47)
    assert page.evaluate(FARTHEST) == 0
    expect(strip.locator("path.hit")).to_have_count(1)
    expect(strip.locator("path.miss")).to_have_count(1)
    expect(strip.locator(".minute")).to_have_text(["now", "−1 min"])
    feet.walk(0.9996)
    expect(page.locator("[data-show=verdict]")).to_have_text("below")
    expect(page.locator("[data-show=performance]")).to_have_text("99\u00a0%")
    for remark in ("rest", "dizziness", "verbal_cue"):
        page.click(f"[data-remark={remark}]")
    expect(strip.locator(".remark-words")).to_have_count(3)
    assert page.evaluate(OVERLAP, "#strip text:not(.part)") is False

    feet.walk(*[1.1] * 5, *[0.5] * 15)
    at_stride(page, 85)
    expect(page.locator("[data-show=of-twenty]")).to_have_text("5 of 20 hit")
    expect(page.locator("#ring .rate")).to_have_text("25\u00a0%")  # of the same


def test_a_phase_is_as_wide_as_it_is_long_and_filled_as_far_as_it_is_walked(
    walking: tuple[Page, Feet],
) -> None:
    page, feet = walking
    feet.walk(*[1.0] * 50, *[1.0] * 50)
    at_stride(page, 100)
    _, training, washout = boxes(page, ".phases li")
    assert training["width"] == pytest.approx(2 * washout["width"], rel=0.05)
    done = page.locator(".phases .is").evaluate("(one) => +one.style.getPropertyValue('--done')")
    assert done == pytest.approx(50 * 1.07 / 110, abs=0.03)
    expect(page.locator(".phases .is")).to_contain_text("left")


def test_what_to_do_about_signals_that_are_late_lost_or_drifting(
    walking: tuple[Page, Feet],
) -> None:
    page, feet = walking
    step = {"side": "left", "value": 4.0}
    told = {
        1: (step | {"reasons": ["late"], "value": None}, "Late: close other programs"),
        2: (step | {"extra": {"flag_lost": 1.0}}, "Lost: look at the network"),
        3: (step | {"reasons": ["angle_out_of_step"]}, "drifting: let one clock stamp"),
    }
    for number, (row, words) in told.items():
        feet.say({"type": "steps", "steps": [row | {"number": number, "time_s": 1.07 * number}]})
        at_stride(page, number)
        expect(page.locator("[data-show=extras]")).to_contain_text(words)
