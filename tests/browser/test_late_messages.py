"""What is late is not celebrated by the patient's page; a server whose clock is set is live."""

from __future__ import annotations

import json
import re

import pytest
from playwright.sync_api import Page, WebSocketRoute, expect

from tests.support.browsers import Visit
from tests.support.patient_page import start
from tests.support.servers import Server
from tests.support.walk_seed import Walk, feet_of, make_walks

pytestmark = pytest.mark.browser


@pytest.fixture
def walk(server: Server) -> Walk:
    return make_walks(server, {"phases": [{"kind": "training"}]})[0]


class Road:
    """What lies between a page and its server."""

    def __init__(self) -> None:
        self.shift_s = 0.0  # of the server's clock
        self.held: list[str] | None = None  # messages that are on their way

    def pass_on(self, socket: WebSocketRoute) -> None:
        """Carry messages between both ends."""
        server_side = socket.connect_to_server()
        socket.on_message(server_side.send)

        def carry(text: str | bytes) -> None:
            message = json.loads(text)
            for event in message.get("events", ()):
                if "at" in event:
                    event["at"] += self.shift_s
            if self.held is None:
                socket.send(json.dumps(message))
            else:
                self.held.append(json.dumps(message))

        self._deliver = socket.send
        server_side.on_message(carry)

    def deliver(self) -> None:
        """Let the messages arrive that were held."""
        for text in self.held or ():
            self._deliver(text)
        self.held = None


@pytest.fixture
def road() -> Road:
    return Road()


@pytest.fixture
def patient(server: Server, visit: Visit, walk: Walk, road: Road) -> Page:
    page = visit("about:blank", walk, reduced_motion="reduce")
    page.route_web_socket(re.compile("/patient/"), road.pass_on)
    page.goto(walk.path)
    start(page, server, walk)
    return page


def test_what_took_too_long_to_arrive_is_not_celebrated(
    server: Server, walk: Walk, patient: Page, road: Road
) -> None:
    with feet_of(server, walk) as feet:
        feet.walk(1.2)
        patient.wait_for_selector("body[data-step='1']")
        words = patient.locator(".words").inner_text()
        road.held = []
        feet.walk(0.3)
        patient.wait_for_timeout(2_500)
        road.deliver()
        patient.wait_for_selector("body[data-step='2']")
        expect(patient.locator(".words")).to_have_text(words)
        expect(patient.locator(".dots circle:not(.gap)")).to_have_count(2)  # it is in the chart


def test_a_server_whose_clock_is_set_is_shown_as_live(
    server: Server, walk: Walk, patient: Page, road: Road
) -> None:
    emblems = []
    with feet_of(server, walk) as feet:
        for number, (performance, road.shift_s) in enumerate(
            [(1.2, 0), (0.3, 0), (1.2, 3600), (0.3, 0), (1.2, -3600)], start=1
        ):
            feet.walk(performance)
            patient.wait_for_selector(f"body[data-step='{number}']")
            emblems.append(patient.locator("[data-emblem]").get_attribute("data-emblem"))
    hit, miss = emblems[:2]
    assert hit != miss
    assert emblems[2:] == [hit, miss, hit]
