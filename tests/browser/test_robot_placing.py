"""The robot is driven to its mark by a button that is held, and only while nobody walks."""

from __future__ import annotations

import json
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress

import pytest
from playwright.sync_api import expect
from websockets.exceptions import ConnectionClosed

from tests.support.fake_ros import wait_until
from tests.support.robot_reports import STATUS
from tests.support.servers import Server
from tests.support.walk_seed import Walk, make_walks, robot_of

pytestmark = pytest.mark.browser

REAL = STATUS | {"base": "kobuki", "state": "idle", "gesture": None, "simulated": False}


@contextmanager
def driven(server: Server, walk: Walk) -> Iterator[list[tuple[float, float]]]:
    """Give what a real robot that is armed hears of driving."""
    heard: list[tuple[float, float]] = []

    def listen() -> None:
        with suppress(ConnectionClosed):
            for text in robot:
                message = json.loads(text)
                if message["type"] == "drive":
                    heard.append((message["ahead"], message["left"]))

    with robot_of(server, walk, "kobuki") as robot:
        thread = threading.Thread(target=listen)
        thread.start()
        robot.send(json.dumps({"type": "report", "report": REAL}))
        yield heard
        robot.close()
        thread.join()


def test_it_drives_while_the_button_is_held_and_stands_when_it_is_let_go(server, visit):
    (walk,) = make_walks(server, {"valence": "positive"})
    with driven(server, walk) as heard:
        page = visit(walk.monitor_path, walk, "laptop")
        ahead, left = page.locator("[data-drive='1 0']"), page.locator("[data-drive='0 1']")
        expect(ahead).to_be_visible()
        ahead.hover()
        page.mouse.down()
        wait_until(lambda: heard.count((1, 0)) >= 4)
        page.mouse.up()
        wait_until(lambda: heard[-1] == (0, 0))
        left.hover()
        page.mouse.down()
        wait_until(lambda: (0, 1) in heard)
        page.mouse.move(5, 5)  # the finger slides off
        wait_until(lambda: heard[-1] == (0, 0))
        ahead.focus()
        page.keyboard.down(" ")
        wait_until(lambda: heard[-1] == (1, 0))
        page.evaluate("dispatchEvent(new Event('blur'))")  # another window comes before this one
        wait_until(lambda: heard[-1] == (0, 0))
        page.keyboard.up(" ")
        page.locator("[data-main]").click()
        expect(ahead).to_be_hidden()
