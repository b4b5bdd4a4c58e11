"""Pictures of the patient's page in every state at every size."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Page, ViewportSize
from websockets.sync.client import connect

from tests.support.browsers import SIZES, chromium
from tests.support.patient_page import start
from tests.support.servers import ROOT, Server, serve
from tests.support.walk_seed import Walk, feet_of, make_walks

pytestmark = pytest.mark.browser

FOLDER = ROOT / "screenshots"
PAST = (0.82, 0.91, 0.97, 1.06, 0.94, 1.03, 1.1, None, 1.01, 0.89, 1.05, 1.13, 0.52)
CROSSFADE_MS = 900
BURST_MS = 450


class Screens:
    """A session's page on screens of every size at once."""

    def __init__(self, pages: dict[str, Page]) -> None:
        self.pages = pages
        self.complaints: list[str] = []
        for page in pages.values():
            page.on("pageerror", lambda error: self.complaints.append(str(error)))

    def show(self, walk: Walk) -> None:
        """Open a session."""
        for page in self.pages.values():
            page.goto(walk.path)

    def tap(self, button: str) -> None:
        """Tap a button on the first screen."""
        next(iter(self.pages.values())).click(button)

    def start(self, server: Server, walk: Walk) -> None:
        """Tap Start on the first screen, while a sensor is there."""
        start(next(iter(self.pages.values())), server, walk)

    def tap_all(self, button: str) -> None:
        """Tap a button on every screen."""
        for page in self.pages.values():
            page.click(button)

    def take(self, name: str, look: str, after_ms: int = CROSSFADE_MS) -> None:
        """Take a picture of each screen, once all look as they should."""
        for page in self.pages.values():
            page.wait_for_selector(f"[data-look={look}]")
        next(iter(self.pages.values())).wait_for_timeout(after_ms)
        for size, page in self.pages.items():
            page.screenshot(path=FOLDER / f"walk-{name}-{size}.png")
            wide = page.evaluate("document.documentElement.scrollWidth - innerWidth")
            assert wide <= 0, f"{name} scrolls sideways by {wide} px at {size}"
        assert self.complaints == []


# Where a patient's page is seldom shown: a wall, a low laptop, and a phone for the therapist.
ELSEWHERE = {"wall": (3840, 2160), "low-laptop": (1366, 768), "phone": (390, 844)}


@pytest.fixture
def server(tmp_path: Path) -> Iterator[Server]:
    with serve(tmp_path / "data") as running:
        yield running


@pytest.fixture
def stack() -> Iterator[ExitStack]:
    with ExitStack() as running:
        yield running


def open_screens(
    server: Server, stack: ExitStack, cookie: str, sizes: dict[str, tuple[int, int]]
) -> Screens:
    """Open a page of each size for the person of a cookie."""
    browser = stack.enter_context(chromium())
    pages = {}
    for name, (width, height) in sizes.items():
        size = ViewportSize(width=width, height=height)
        context = browser.new_context(base_url=server.url, viewport=size)
        context.add_cookies([{"name": "sessionid", "value": cookie, "url": server.url}])
        pages[name] = context.new_page()
    return Screens(pages)


def test_pictures_in_the_largest_words_of_two_languages(server: Server, stack: ExitStack) -> None:
    FOLDER.mkdir(exist_ok=True)
    languages = ("es", "de")
    wanted = [{"screen": {"screen_text": "largest", "language": each}} for each in languages]
    walks = make_walks(server, *wanted)
    screens = open_screens(server, stack, walks[0].cookie, ELSEWHERE)
    for language, walk in zip(languages, walks, strict=True):
        screens.show(walk)
        screens.take(f"{language}-ready", "ready")
        with feet_of(server, walk) as feet:
            screens.tap("[data-change=start]")
            feet.hear("start")
            feet.walk(*PAST, 0.83)
            screens.take(f"{language}-miss", "feedback")
        screens.take(f"{language}-lost", "lost")
        screens.tap("button.pause")
        screens.take(f"{language}-paused", "paused")


def test_pictures_of_a_walk(server: Server, stack: ExitStack) -> None:
    FOLDER.mkdir(exist_ok=True)
    valences = ("positive", "negative", "binary", "explicit")
    catch = {"phases": [{"kind": "catch", "seconds": 60}]}
    sides = [
        {"screen": {"screen_side": side, "screen_sounds": True}} for side in ("left", "center")
    ]
    largest = {"screen": {"screen_text": "largest"}}
    wanted: list[dict[str, Any]] = [
        *({"valence": valence, "pin": "2468"} for valence in valences),
        *sides,
        largest,
        catch,
    ]
    *walks, left, center, large, calm = make_walks(server, *wanted)
    screens = open_screens(server, stack, calm.cookie, SIZES)
    pages = screens.pages
    for valence, walk in zip(valences, walks, strict=True):
        screens.show(walk)
        if valence == "positive":
            screens.take("ready", "ready")
            screens.tap_all("button.out")
            screens.take("leave", "ready")
            screens.tap_all("text=Stay here")
        screens.start(server, walk)
        if valence == "positive":
            screens.take("waiting", "waiting")
        with feet_of(server, walk) as feet:
            if valence == "positive":
                screens.take("begin", "begin")
            feet.walk(*PAST)
            screens.take(f"{valence}-low", "feedback")
            feet.walk(1.12)
            screens.take(f"{valence}-hit", "feedback", BURST_MS)
            feet.walk(0.83)
            screens.take(f"{valence}-miss", "feedback")
            if valence != "positive":
                continue
            feet.walk(None)
            screens.take("missing", "feedback")
            feet.walk(1.56)
            screens.take("sparkle", "feedback", 2 * CROSSFADE_MS)
        screens.take("lost", "lost")
        screens.tap("button.pause")
        screens.take("paused", "paused")
        for page in pages.values():
            page.click("text=End")
        screens.take("ask", "ask")
    for side, walk in {"left": left, "center": center, "largest": large}.items():
        screens.show(walk)
        with feet_of(server, walk) as feet:
            screens.tap("text=Start")
            feet.hear("start")
            feet.walk(*PAST, 1.12)
            screens.take(f"side-{side}", "feedback", BURST_MS)
    screens.show(calm)
    url = f"ws://127.0.0.1:{server.port}/ws/robot/"
    header = {"Authorization": f"Bearer {calm.robot}"}
    with feet_of(server, calm) as feet, connect(url, additional_headers=header) as robot:
        robot.send(json.dumps({"type": "hello", "version": 1, "base": "null"}))
        screens.tap("text=Start")
        feet.hear("start")
        feet.walk(*[1.0] * 12)
        screens.take("calm-with-robot", "calm")
        screens.tap("text=Stop robot")
        screens.take("robot-stop", "calm")
