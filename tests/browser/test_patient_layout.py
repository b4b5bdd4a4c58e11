"""The patient's page at every size, in every language and size of words: Pause and Stop robot stay
in their places, and nothing is cut.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest
from playwright.sync_api import Page, expect

from tests.support.axe import check
from tests.support.browsers import Visit
from tests.support.extent import EVERYTHING
from tests.support.layout import COMPLAIN, DRAWN, LANGUAGES, TOO_WIDE, TURN, set_screen
from tests.support.servers import Server
from tests.support.walk_seed import feet_of, make_walks, robot_of

pytestmark = pytest.mark.browser

SCREENS = ("phone", "tablet-portrait", "tablet-landscape", "low-laptop", "laptop", "wall")
CORNERS = SCREENS if EVERYTHING else ("phone", "tablet-portrait", "tablet-landscape")
TEXTS = ("normal", "large", "largest") if EVERYTHING else ("normal", "largest")
BUTTONS = "header button, .actions button"
WORDS = ".words, .phrase, .sub, .count, header .who, header button, .actions button, .key, .label"
# What people read and tap; the horizon, which no words cross where nothing is measured.
CROSSING = """() => {
  const words = [...document.querySelectorAll(".words, .sub")]
    .filter((one) => one.checkVisibility()).map((one) => one.getBoundingClientRect().bottom);
  const bottom = Math.max(...words);
  const floor = document.querySelector(".ground").getBoundingClientRect().top;
  const slots = [".phrase", ".count", ".actions", ".part", "header .who", ".pause", ".robot"]
    .map((name) => document.querySelector(name))
    .filter((one) => one.checkVisibility({ visibilityProperty: true }))
    .map((one) => [one.className, one.getBoundingClientRect()]);
  const said = bottom > floor + 1 ? [`the words end at ${bottom}, the floor is at ${floor}`] : [];
  slots.forEach(([name, a], i) => slots.slice(0, i).forEach(([other, b]) => {
    const beside = a.left >= b.right - 1 || b.left >= a.right - 1;
    if (!beside && a.top < b.bottom - 1 && b.top < a.bottom - 1)
      said.push(`${name} overlaps ${other}`);
  }));
  return said;
}"""


# Where line, thermometer, sign, badge and total are in each layout, and what is wrong there.
FRAMES = f"""async ([texts, column]) => {{
  const drawn = {DRAWN};
  const box = (name) => {{
    const one = document.querySelector(name);
    if (!one.checkVisibility()) return null;
    const {{ left, top, right, bottom }} = one.getBoundingClientRect();
    return [left, top, right, bottom].map(Math.round);
  }};
  const parts = [".ground", ".wall", ".pennant", ".emblem svg", ".label"];
  const frames = {{}}, wrong = [];
  for (const text of texts) {{
    document.body.dataset.text = text;
    if (column) document.body.dataset.column = column;
    else delete document.body.dataset.column;
    await drawn();
    const [line, , sign, badge] = frames[`${{column}} ${{text}}`] = parts.map(box);
    const range = document.createRange();
    range.selectNodeContents(document.querySelector(".key"));
    const {{ left, top, right, bottom }} = range.getBoundingClientRect();
    const digits = [left, top, right, bottom], bulb = box(".bulb");
    const beside = box(".key")[1] < bulb?.[3];
    if (beside && right > bulb[0] - 24 && left < bulb[2] + 24)
      wrong.push(`${{column}} ${{text}}: digits at the bulb`);
    const words = box(".words");
    if (badge && badge[1] < line[1] && badge[3] > line[1])
      wrong.push(`${{column}} ${{text}}: the badge crosses the goal`);
    const inMiddle = badge && column === "center"; // across over the goal
    if (inMiddle && (badge[2] > innerWidth || (innerWidth > innerHeight && badge[3] > line[1])))
      wrong.push(`${{column}} ${{text}}: the badge at ${{badge}} leaves the sky`);
    for (const other of [sign, words, digits].filter((one) => badge && one))
      if (badge[0] < other[2] && other[0] < badge[2] && badge[1] < other[3] && other[1] < badge[3])
        wrong.push(`${{column}} ${{text}}: the badge at ${{badge}} is over ${{other}}`);
    if ([sign, box(".tip")].some((one) => one && (one[0] < 0 || one[2] > innerWidth)))
      wrong.push(`${{column}} ${{text}}: the goal's sign leaves the screen`);
  }}
  return [frames, wrong];
}}"""

# The page with each size of words, then turned around with the largest: what is wrong, by how it
# was set, and where the buttons of the header were.
LOOK = f"""async ([texts, buttons, words]) => {{
  const [complain, tooWide, crossing, turn, drawn] =
    [{COMPLAIN}, {TOO_WIDE}, {CROSSING}, {TURN}, {DRAWN}];
  const wrong = () => [...complain([buttons, 60]), ...tooWide(words), ...crossing()];
  const said = {{}}, places = [];
  await document.fonts.ready;
  for (const text of texts) {{
    document.body.dataset.text = text;
    await drawn();
    said[text] = wrong();
    places.push([...document.querySelectorAll("header .robot, header .pause")]
      .map((one) => {{ const {{ x, y, right, bottom }} = one.getBoundingClientRect();
        return [x, y, right, bottom]; }}));
  }}
  turn(false);
  await drawn();
  said["from right to left"] = wrong();
  turn(true);
  await drawn();
  return [Object.entries(said).filter(([, wrong]) => wrong.length), places, innerWidth];
}}"""


# Which drawing a badge has, and how many arcs the thermometer's outline: its top, and its bulb.
BULB = """(emblem) => {
  document.querySelector(".emblem svg").dataset.emblem = emblem;
  const shown = [...document.querySelectorAll(".emblem g")]
    .find((one) => getComputedStyle(one).visibility === "visible");
  const outline = document.querySelector(".shell.wall").getAttribute("d");
  return [shown?.getAttribute("class") ?? "", outline.split("A").length - 1];
}"""

# How far the level is below the goal line, and how many steps are off the chart.
LEVEL = """() => {
  const top = (name) => document.querySelector(name).getBoundingClientRect().top;
  const arrows = document.querySelectorAll('.dots path[d^="M"]').length;
  return [top(".liquid") - top(".goal"), arrows];
}"""


def look_everywhere(
    page: Page, kept: dict[str, Any], before: Callable[[], None] = lambda: None
) -> None:
    """Check the page as it is now at every size, with all sizes of words.

    ``kept``: by screen, where the header's buttons were with each size of words, if they were seen.
    """
    look = page.get_attribute("body", "data-look")
    for screen in CORNERS:
        set_screen(page, screen)
        before()
        said, places, width = page.evaluate(LOOK, [TEXTS, BUTTONS, WORDS])
        assert (look, screen, said) == (look, screen, [])
        assert (look, screen, places) == (look, screen, kept.setdefault(screen, places))
        # Across, the largest words have Pause over their thermometer.
        alike = places[:-1] if page.evaluate("innerWidth > innerHeight") else places
        assert (look, screen, alike) == (look, screen, [places[0]] * len(alike))
        assert places[0][1][2] >= 0.94 * width
        assert places[-1][1][2] >= 0.93 * width
    if EVERYTHING:
        check(page, for_patients=True)


@pytest.mark.parametrize("language", LANGUAGES)
def test_pause_and_stop_robot_keep_their_places_and_no_word_is_cut(
    server: Server, visit: Visit, language: str
) -> None:
    (walk,) = make_walks(server, {"name": "Rosalinda", "screen": {"language": language}})
    page = visit(walk.path, walk, reduced_motion="reduce")
    tablet = visit(walk.path, walk, alone=True, reduced_motion="reduce")
    kept: dict[str, Any] = {}
    with feet_of(server, walk) as feet, robot_of(server, walk):
        page.wait_for_selector(".robot:not([hidden])")
        look_everywhere(page, kept)
        page.click("[data-change=start]")
        feet.hear("start")
        page.wait_for_selector("body[data-look=begin]")
        look_everywhere(page, kept)

        def step() -> None:
            feet.walk(1.2)
            page.wait_for_function("n => document.body.dataset.step == n", arg=feet.number)

        step()
        look_everywhere(page, kept, step)
        page.wait_for_selector("body[data-look=still]")
        look_everywhere(page, kept)
        page.click(".pause")
        page.wait_for_selector("body[data-look=paused]")
        look_everywhere(page, kept)
        tablet.wait_for_selector("body[data-look=paused]")
        look_everywhere(tablet, kept)
        assert tablet.locator(".actions button:visible").count() == 0
        page.click("[data-ask=end]")
        look_everywhere(page, kept)


def test_the_frame_stays_from_step_to_step(server: Server, visit: Visit) -> None:
    """Only what a step came to changes: its level, words, badge and total."""
    (walk,) = make_walks(server, {"valence": "binary", "words_vary": True})
    page = visit(walk.path, walk, reduced_motion="reduce")
    with feet_of(server, walk) as feet:
        page.click("[data-change=start]")
        page.wait_for_selector("body[data-look=begin]")
        for screen in CORNERS:
            set_screen(page, screen)
            found = []
            for performance in (1.12, 0.83, None, 1.56, 0.3):
                frames: dict[str, Any] = {}
                for column in ("", "center", "right", "left"):
                    feet.walk(performance)  # for each, before the page says that none arrive
                    page.wait_for_function("n => document.body.dataset.step == n", arg=feet.number)
                    seen, wrong = page.evaluate(FRAMES, [TEXTS, column])
                    assert (screen, wrong) == (screen, [])
                    frames |= seen
                found.append(frames)
            assert found == [found[0]] * len(found), screen


def test_the_frame_stays_when_a_hundred_points_are_lost(server: Server, visit: Visit) -> None:
    (walk,) = make_walks(server, {"valence": "negative"})
    page = visit(walk.path, walk, reduced_motion="reduce")
    key = page.locator(".key")
    with feet_of(server, walk) as feet:
        page.click("[data-change=start]")
        page.wait_for_selector("body[data-look=begin]")
        feet.walk(*[0.8] * 90)
        found, sizes = [], []
        for _ in range(2):
            frames: dict[str, Any] = {}
            for screen in ("tablet-portrait", "tablet-landscape"):
                set_screen(page, screen)
                for column in ("", "center", "right", "left"):
                    feet.walk(0.8)
                    page.wait_for_function("n => document.body.dataset.step == n", arg=feet.number)
                    seen, wrong = page.evaluate(FRAMES, [TEXTS, column])
                    assert (screen, wrong) == (screen, [])
                    # All but the total's name, right over it, and a badge that is beside it.
                    for name, frame in seen.items():
                        is_beside = not column and name != " largest"
                        frames[f"{screen} {name}"] = frame[: 3 if is_beside else 4]
                    assert key.evaluate("one => one.scrollWidth <= one.clientWidth + 1")
                    sizes.append(key.evaluate("one => parseFloat(getComputedStyle(one).fontSize)"))
            found.append(frames)
            feet.walk(*[0.8] * 10)
        expect(key).to_have_text("−126")
    assert found[0] == found[1]
    for usual, long in zip(sizes[:8], sizes[8:], strict=True):  # a total of four signs is smaller
        assert 0.75 < long / usual < 0.96


def test_upright_a_step_that_is_not_answered_leaves_the_thermometer_its_bulb(
    server: Server, visit: Visit
) -> None:
    (walk,) = make_walks(server, {"valence": "binary", "screen": {"screen_text": "largest"}})
    page = visit(walk.path, walk, reduced_motion="reduce")
    with feet_of(server, walk) as feet:
        page.click("[data-change=start]")
        page.wait_for_selector("body[data-look=begin]")
        feet.walk(1.1)
        page.wait_for_selector("body[data-step='1']")
        seen = []
        for screen in ("tablet-portrait", "tablet-landscape"):
            set_screen(page, screen)
            seen += [page.evaluate(BULB, emblem) for emblem in ("gain", "")]
    assert seen == [["gain", 1], ["neutral", 1], ["gain", 2], ["", 2]]


def test_a_near_miss_is_seen_to_miss_and_a_step_off_the_chart_to_be_off(
    server: Server, visit: Visit
) -> None:
    (walk,) = make_walks(server, {"valence": "explicit"})
    page = visit(walk.path, walk, reduced_motion="reduce")
    set_screen(page, "tablet-landscape")
    with feet_of(server, walk) as feet:
        page.click("[data-change=start]")
        page.wait_for_selector("body[data-look=begin]")
        gaps, arrows = [], []
        for performance in (0.995, 1.0, 0.05):
            feet.walk(performance)
            page.wait_for_function("n => document.body.dataset.step == n", arg=feet.number)
            gap, drawn = page.evaluate(LEVEL)
            gaps.append(gap)
            arrows.append(drawn)
    assert gaps[0] > 20  # pixels of a tablet
    assert gaps[1] < 0
    assert arrows == [0, 0, 1]
