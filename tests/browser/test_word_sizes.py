"""The size of words is a promise in degrees: kept in each layout, size, language, type and on each
screen that can hold it, and told where one cannot.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import ExitStack
from typing import Any

import pytest
from playwright.sync_api import Browser, Page

from rehab.sessions.pages.walk import COLUMNS
from tests.support.browsers import signed_in
from tests.support.layout import DRAWN, SCREENS
from tests.support.servers import Server
from tests.support.walk_seed import feet_of, make_walks
from tests.support.word_sizes import MEASURE, NEVER_STILL, SIDES, look

pytestmark = pytest.mark.browser

FACTORS = {"normal": 1.0, "large": 1.4, "largest": 1.8}
# On a wide screen that nobody measured there is room for more.
WIDE = {"normal": 1.45, "large": 1.6, "largest": 1.8}
# Diagonal [inches] and distance [m] of the screens: where people would read them from.
READ_FROM = {
    "phone": (6.1, 0.5),
    "tablet-portrait": (10.1, 0.7),
    "old-laptop": (15.0, 1.5),
    "tablet-landscape": (10.1, 0.7),
    "low-laptop": (24.0, 1.5),
    "laptop": (32.0, 2.0),
    "wall": (65.0, 3.0),
}
KEPT_FROM = 0.6  # what the thermometer may cost words where no size is promised (fit_layout.js)


@pytest.fixture(scope="module")
def walking(browser: Browser, server: Server) -> Iterator[Any]:
    """Return a function that opens a page on which somebody walks, once for each language and type.

    Sides and sizes are put on by `look`: they are attributes of the page's body.
    """
    pages: dict[tuple[str, str], Page] = {}
    with ExitStack() as stack:

        def open_page(language: str, valence: str) -> Page:
            if (language, valence) not in pages:
                screen = {"language": language}
                (walk,) = make_walks(server, {"valence": valence, "screen": screen})
                context = stack.enter_context(
                    signed_in(browser, server, walk, reduced_motion="reduce")
                )
                page = context.new_page()
                page.add_init_script(f"({NEVER_STILL})()")
                page.goto(walk.path)
                feet = stack.enter_context(feet_of(server, walk))
                page.click("[data-change=start]")
                page.wait_for_selector("body:not([data-look=ready])")
                feet.walk(1.2, 0.8)
                page.wait_for_function("() => document.body.dataset.step == 2")
                pages[language, valence] = page
            return pages[language, valence]

        yield open_page


def pixels_of_degree(screen: str) -> float:
    diagonal_in, distance_m = READ_FROM[screen]
    px_per_mm = math.hypot(*SCREENS[screen]) / (25.4 * diagonal_in)
    return 2 * 1000 * distance_m * math.tan(math.pi / 360) * px_per_mm


def overlap(one: list[float], other: list[float], most: float) -> bool:
    """Return whether two boxes lie on each other by more pixels; what is not shown does not."""
    across, down = (min(one[i + 2], other[i + 2]) - max(one[i], other[i]) for i in (0, 1))
    return min(across, down) > most


@pytest.mark.essential
@pytest.mark.matrix
@pytest.mark.parametrize("side", SIDES)
@pytest.mark.parametrize("language", ["en", "de", "es", "fr"])
@pytest.mark.parametrize("valence", ["positive", "negative", "binary", "explicit"])
@pytest.mark.parametrize("screen", SCREENS)
@pytest.mark.parametrize("measured", [False, True])
def test_words_are_as_large_as_promised(
    walking: Any, side: str, language: str, valence: str, screen: str, measured: bool
) -> None:
    page = walking(language, valence)
    degree = pixels_of_degree(screen) if measured else None
    sizes = []
    width, height = SCREENS[screen]
    is_wide = not measured and width > height and side not in COLUMNS
    for text, factor in (WIDE if is_wide else FACTORS).items():
        found = look(page, side, screen, text, degree)
        full = (degree or found["degree"]) * factor
        promised = full * found["short"]
        assert found["word"] == pytest.approx(promised, rel=0.01), text
        usual = 2.0
        # Where no size is promised it leaves room to the others, on the side that is seen.
        is_upright = height >= width
        is_beside = text == "largest" or side in COLUMNS
        is_in_half = side.startswith("in_")
        if not measured and is_beside and valence == "explicit":
            usual = 1.33 if is_upright and is_in_half else 1.5
        elif not measured and text == "largest":
            usual = 1.5 if is_upright and is_in_half else 1.6
        # Long words make a number in a half only half as much smaller.
        own = (full + promised) / 2 if is_in_half and not measured else promised
        assert found["key"] == pytest.approx(usual * own, rel=0.01), text
        # What goes, goes in this order.
        assert (found["chart"], found["emblem"], found["scene"]) == (
            found["drop"] < 1,
            found["drop"] < 2 and valence != "explicit",
            found["drop"] < 3,
        )
        # The horizon crosses neither words nor number: it is between them, or there is none.
        if found["drop"] and found["ground"] < height:
            above, below = found["words"], found["label"]
            if valence == "explicit" and is_upright and found["scene"] and not is_beside:
                above, below = found["number"], (0, height)  # both are right below each other
            assert above[3] - 2 <= found["ground"] <= below[1] + 2
        assert found["foot"]  # the same foot, whichever side it is on
        for left, top, right, bottom in (found["words"], found["number"]):
            assert left >= -1
            assert top >= found["head"][3] - 0.35 * found["word"]
            assert right <= width + 1
            assert bottom <= height + 1
        assert found["words"][3] <= found["number"][1] + 2 or (
            found["words"][2] <= found["number"][0] + 2
        )
        assert not overlap(found["number"], found["tube"], width / 400)
        if found["emblem"]:
            is_bulb = is_upright and is_beside
            for other in ("words", "number", "label", *(() if is_bulb else ("tube",))):
                assert not overlap(found["badge"], found[other], width / 400), other
            if is_bulb:  # the thermometer stands in it, on its axis, below the goal
                tube, badge = found["tube"], found["badge"]
                assert badge[0] + badge[2] == pytest.approx(tube[0] + tube[2], abs=4)
                assert found["ground"] < badge[1] < tube[3] < badge[3]
        if side.startswith("in_"):
            low, high = (width / 2, width) if side == "in_right" else (0, width / 2)
            spans = [*found["buttons"], *(box[::2] for box in (found["words"], found["number"]))]
            assert all(low - 1 <= one for span in spans for one in span)
            assert all(one <= high + 1 for span in spans for one in span)
        if side == "center" and (is_upright or not found["scene"]):
            middle = (found["words"][0] + found["words"][2]) / 2
            assert middle == pytest.approx(width / 2, abs=2)
        elif side == "center":  # words and total before the thermometer, about the midline
            assert max(found[one][2] for one in ("words", "number")) < found["tube"][0]
            assert found["words"][0] < width / 2 < found["tube"][0]
        sizes.append(found["word"])
    # A larger setting never makes words smaller; what fits is searched for to half a percent.
    assert sizes[0] <= 1.01 * sizes[1] <= 1.02 * sizes[2]


@pytest.mark.parametrize(
    ("sizes", "is_measured", "least", "level"),
    [
        ([1, 1, 1, 1], False, 0, 0),
        ([1, 1, 1, 1], False, 1, 1),
        ([1, 1, 1, 1], False, 2, 2),
        ([0.9, 1, 1, 1], False, 0, 1),
        ([0.5, 0.8, 0.9, 1], False, 0, 2),
        ([0.4, 0.5, 0.7, 1], False, 0, 2),
        ([0.4, 0.5, 0.5, 1], False, 0, 3),
        ([0.5, 0.8, 0.9, 1], True, 0, 3),
        ([0.5, 0.5, 0.5, 0.5], True, 0, 0),  # the words' own width is too large
        ([0.5, 0.95, 0.95, 1], False, 1, 1),
    ],
)
def test_what_goes_makes_words_larger(
    walking: Any, sizes: list[float], is_measured: bool, least: int, level: int
) -> None:
    """Where nobody measured, badge and thermometer stay for a tenth and two fifths of the size."""
    chosen, size = walking("en", "positive").evaluate(
        """async ([sizes, ...how]) => (await import("garry/walk/fit_layout"))
          .chooseLayout((level, size) => size <= sizes[level], ...how)""",
        [sizes, is_measured, least],
    )
    assert chosen == level
    assert sizes[level] - 0.005 <= size <= sizes[level]


@pytest.mark.parametrize(
    ("side", "screen", "text"),
    [
        ("right", "tablet-landscape", "largest"),
        ("right", "tablet-portrait", "large"),
        ("left", "wall", "largest"),
        ("center", "tablet-landscape", "large"),
        ("in_right", "tablet-landscape", "large"),
    ],
)
def test_common_screens_hold_the_promise(walking: Any, side: str, screen: str, text: str) -> None:
    assert look(walking("en", "positive"), side, screen, text, None)["short"] == 1


@pytest.mark.parametrize("side", ["right", "center"])
@pytest.mark.parametrize("screen", ["tablet-portrait", "tablet-landscape"])
def test_unmeasured_tablets_keep_the_thermometer(walking: Any, side: str, screen: str) -> None:
    found = look(walking("en", "positive"), side, screen, "largest", None)
    assert found["scene"]
    assert found["short"] >= KEPT_FROM
    assert found["word"] > look(walking("en", "positive"), side, screen, "normal", None)["word"]


@pytest.mark.parametrize("side", ["right", "in_left"])
def test_low_windows_keep_the_badge_off_the_thermometer(walking: Any, side: str) -> None:
    page = walking("en", "positive")
    look(page, side, "tablet-landscape", "largest", None)
    shown = []
    for width, height in [(800, 360), (844, 480), (1024, 600)]:
        page.set_viewport_size({"width": width, "height": height})
        page.evaluate(DRAWN)
        found = page.evaluate(MEASURE)
        assert not overlap(found["badge"], found["tube"], 2)
        shown.append(found["emblem"])
    assert shown[-1]


def test_what_no_screen_can_hold_is_told(walking: Any) -> None:
    """The largest words at 3 m on a tablet of ten inches: two letters would fill it."""
    found = look(walking("en", "positive"), "right", "tablet-landscape", "largest", 558)
    assert found["short"] < 0.5
