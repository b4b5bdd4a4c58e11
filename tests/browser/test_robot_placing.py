"""The robot is driven to its mark by a button that is held, and only while nobody walks."""

from __future__ import annotations

import json
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import Any

import pytest
from playwright.sync_api import expect
from websockets.exceptions import ConnectionClosed

from tests.support.callers import Message
from tests.support.fake_ros import wait_until
from tests.support.robot_reports import STATUS
from tests.support.servers import Server
from tests.support.walk_seed import Walk, make_walks, robot_of

pytestmark = pytest.mark.browser

REAL = STATUS | {"base": "kobuki", "state": "idle", "gesture": None, "simulated": False}


@contextmanager
def driven(
    server: Server, walk: Walk, status: Message = REAL, ways: tuple[str, ...] = ("ahead", "left")
) -> Iterator[tuple[list[tuple[Any, ...]], Callable[[Message], None]]]:
    """Give what a real robot that is armed hears of driving, and how it reports a status."""
    heard: list[tuple[Any, ...]] = []

    def listen() -> None:
        with suppress(ConnectionClosed):
            for text in robot:
                message = json.loads(text)
                if message["type"] == "drive":
                    heard.append(tuple(message.get(way, False) for way in ways))

    with robot_of(server, walk, "kobuki") as robot:
        thread = threading.Thread(target=listen)
        thread.start()
        robot.send(json.dumps({"type": "report", "report": status}))
        yield heard, lambda more: robot.send(json.dumps({"type": "report", "report": more}))
        robot.close()
        thread.join()


def test_it_drives_while_the_button_is_held_and_stands_when_it_is_let_go(server, visit):
    (walk,) = make_walks(server, {"valence": "positive"})
    with driven(server, walk) as (heard, _):
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


def test_one_that_has_learned_a_tag_drives_home_while_its_button_is_held(server, visit):
    (walk,) = make_walks(server, {"valence": "positive"})
    knows = REAL | {"state": "away", "reason": "away_from_home", "homing": "no_tag"}
    with driven(server, walk, knows, ("home",)) as (heard, told):
        page = visit(walk.monitor_path, walk, "laptop")
        home = page.locator("[data-home]")
        expect(home).to_be_visible()
        expect(page.locator("[data-show='robot-homing']")).to_contain_text("does not see its tag")
        home.hover()
        page.mouse.down()
        wait_until(lambda: heard.count((True,)) >= 4)
        place = home.bounding_box()
        told(knows | {"state": "idle", "reason": "not_running", "homing": "driving"})
        expect(page.locator("[data-show='robot-homing']")).to_contain_text("drives to its mark")
        assert home.bounding_box() == place  # it stays under the finger
        page.mouse.up()
        wait_until(lambda: heard[-1] == (False,))


def test_one_that_has_learned_none_has_no_such_button(server, visit):
    (walk,) = make_walks(server, {"valence": "positive"})
    with driven(server, walk):
        page = visit(walk.monitor_path, walk, "laptop")
        expect(page.locator("[data-drive='1 0']")).to_be_visible()
        expect(page.locator("[data-home]")).to_be_hidden()
