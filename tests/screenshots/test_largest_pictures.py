"""Pictures of the largest words in every layout, and of a fall on every screen that shows it."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from playwright.sync_api import Browser, Page, expect

from tests.support.browsers import signed_in
from tests.support.layout import SCREENS, set_screen
from tests.support.servers import ROOT, Server, serve
from tests.support.walk_seed import Walk, feet_of, make_walks, robot_of
from tests.support.word_sizes import NEVER_STILL, SIDES, look

pytestmark = pytest.mark.browser

FOLDER = ROOT / "screenshots"
TABLETS = ("tablet-portrait", "tablet-landscape")
PAST = (1.02, 1.08, 0.97, 1.06, 0.94, 1.13, 1.1, 1.01, 0.89, 1.05, 1.13, 0.92)
WALKED = [PAST[number % len(PAST)] for number in range(90)]
# A type and the last step's share of the goal.
STEPS = (("positive", 1.12), ("negative", 0.83), ("binary", 1.08), ("explicit", 0.94))


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    FOLDER.mkdir(exist_ok=True)
    with serve(tmp_path_factory.mktemp("data")) as running:
        yield running


def take(page: Page, name: str) -> None:
    page.wait_for_timeout(900)
    page.screenshot(path=FOLDER / f"largest-{name}.png")


@pytest.mark.parametrize(("valence", "last"), STEPS)
def test_pictures_of_the_largest_words(
    server: Server, browser: Browser, valence: str, last: float
) -> None:
    wanted = {"valence": valence, "name": "Rosa", "screen": {"screen_text": "largest"}}
    (walk,) = make_walks(server, wanted)
    with signed_in(browser, server, walk, reduced_motion="reduce") as context:
        page = context.new_page()
        page.add_init_script(f"({NEVER_STILL})()")
        page.goto(walk.path)
        with feet_of(server, walk) as feet:
            page.click("[data-change=start]")
            feet.hear("start")
            feet.walk(*WALKED, last)
            page.wait_for_function("n => document.body.dataset.step == n", arg=len(WALKED) + 1)
            for side in SIDES:
                for screen in TABLETS:
                    look(page, side, screen, "largest", None)
                    take(page, f"{valence}-{side}-{screen}")


def test_pictures_of_a_fall(server: Server, browser: Browser) -> None:
    screen = {"screen_text": "largest"}
    walk, _other = make_walks(server, {"name": "Rosa", "screen": screen}, {"name": "Tom"})
    with signed_in(browser, server, walk, reduced_motion="reduce") as context:
        patient, laptop = context.new_page(), context.new_page()
        patient.goto(walk.path)
        set_screen(patient, "tablet-portrait")
        laptop.goto(walk.monitor_path)
        set_screen(laptop, "laptop")
        with feet_of(server, walk) as feet, robot_of(server, walk):
            laptop.click("[data-main]")
            feet.hear("start")
            feet.walk(*WALKED)
            take(laptop, "monitor-laptop")
            laptop.click("[data-fall]")
            expect(laptop.locator(".alarm.red")).to_contain_text("Rosa fell")
            for page, name in ((laptop, "fall-laptop"), (patient, "fall-patient")):
                take(page, name)
            second = context.new_page()
            for name, path, size in second_screens(walk):
                second.goto(path)
                set_screen(second, size)
                take(second, name)
            laptop.click(".alarm .seen")
            take(laptop, "fall-seen-laptop")
            laptop.get_by_role("button", name="Slightly hurt").click()
            second.goto("/incidents/")
            set_screen(second, "laptop")
            take(second, "fall-incidents")


def second_screens(walk: Walk) -> list[tuple[str, str, str]]:
    """Return the name, address and size of the screens that did not note the fall."""
    assert {"laptop", "phone", "tablet-landscape"} <= set(SCREENS)
    return [
        ("fall-second-laptop", walk.monitor_path, "laptop"),
        ("fall-second-phone", walk.monitor_path, "phone"),
        ("fall-start-laptop", "/start/", "laptop"),
        ("fall-start-phone", "/start/", "phone"),
    ]
