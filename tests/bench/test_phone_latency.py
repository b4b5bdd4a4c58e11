"""A worn phone in Chromium: how soon strides reach the tablet, and whether all of them do."""

from __future__ import annotations

import tempfile
import threading
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import websockets.sync.server as sockets
from websockets.sync.server import ServerConnection

from tests.support.browsers import chromium, signed_in
from tests.support.servers import serve
from tests.support.simulated_leg import CONTACT_S, STRIDE_S, walk_foot
from tests.support.walk_seed import make_walks
from tests.support.worn_phone import WornPhone, read_steps

pytestmark = pytest.mark.bench

WALKED_S = 60
OFFSET_S = 0.011  # a shank's contacts are put earlier by so much than its rate crosses zero
# Feeds samples when they are due, as a phone's browser does, 60 times a second.
PLAY = """rows => {
  const begin = performance.now();
  window.begin_ms = performance.timeOrigin + begin;
  let next = 0;
  const feed = () => {
    for (; next < rows.length && performance.now() - begin >= 1000 * rows[next][0]; next += 1) {
      const [t, ax, ay, az, gx, gy, gz] = rows[next];
      const event = new DeviceMotionEvent("devicemotion", {
        interval: 16,
        accelerationIncludingGravity: { x: ax, y: ay, z: az },
        rotationRate: { beta: gx, gamma: gy, alpha: gz },
      });
      Object.defineProperty(event, "timeStamp", { value: begin + 1000 * t });
      window.dispatchEvent(event);
    }
    if (next < rows.length) setTimeout(feed, 4);
  };
  feed();
}"""
WATCH = """() => {
  window.shown = [];
  const now_ms = () => performance.timeOrigin + performance.now();
  const note = () =>
    requestAnimationFrame(() => window.shown.push([Number(document.body.dataset.step), now_ms()]));
  new MutationObserver(note).observe(document.body, { attributeFilter: ["data-step"] });
}"""

# How long a bare socket takes there and back, in a page of the same browser.
ASK = """port => {
  window.trips = [];
  const socket = new WebSocket(`ws://127.0.0.1:${port}`);
  socket.onmessage = ({ data }) => window.trips.push(performance.now() - Number(data));
  socket.onopen = () => setInterval(() => socket.send(String(performance.now())), 500);
}"""


@pytest.fixture
def echo() -> Iterator[int]:
    """Return the port of a server that sends back what it gets."""

    def answer(connection: ServerConnection) -> None:
        for message in connection:
            connection.send(message)

    with sockets.serve(answer, "127.0.0.1", 0) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield server.socket.getsockname()[1]


def test_from_the_contact_to_the_tablet(echo: int):
    t_s, rate, acceleration = walk_foot(WALKED_S, rate_hz=60)
    rows = np.column_stack((t_s, acceleration, np.degrees(rate))).tolist()
    with tempfile.TemporaryDirectory() as folder, serve(Path(folder)) as server:
        (walk,) = make_walks(server, {"measure": "shank_stance", "goal": 60.0})
        with (
            chromium() as browser,
            signed_in(browser, server, walk) as therapist,
            browser.new_context(base_url=server.url) as pocket,
        ):
            monitor, tablet = therapist.new_page(), therapist.new_page()
            monitor.goto(walk.monitor_path)
            tablet.goto(walk.path)
            tablet.evaluate(WATCH)
            monitor.click("[data-main]")
            phone = pocket.new_page()
            phone.goto(f"/sensor/#token={walk.source}&place=shank&side=left")
            phone.click("[data-begin]")
            phone.wait_for_selector("body[data-step=check]")
            bare = pocket.new_page()
            bare.evaluate(ASK, echo)
            phone.evaluate(PLAY, rows)
            tablet.bring_to_front()
            tablet.wait_for_timeout(1000 * (WALKED_S + 2))
            begin_ms = phone.evaluate("window.begin_ms")
            floor = np.percentile(bare.evaluate("window.trips"), [50, 95])
            shown = {number: at for number, at in tablet.evaluate("window.shown") if number}
    contacts = begin_ms + 1000 * (np.arange(CONTACT_S, WALKED_S, STRIDE_S) - OFFSET_S)
    late = []
    for _, at in sorted(shown.items())[6:]:  # the first ones wait until the sign is known
        before = contacts[contacts < at]
        late.append(at - before[-1])
    middle, most = np.percentile(late, [50, 95])
    print(f"\n{len(late)} strides: {middle:.0f} ms from contact to tablet, 95 %: {most:.0f}; "
          f"a bare socket there and back {floor[0]:.0f}, 95 %: {floor[1]:.0f} ms")  # fmt: skip
    assert len(late) >= 30
    assert middle <= 150
    assert most <= 300


def test_half_an_hour_on_a_slow_phone():
    """Faster than in real time, on a sixth of a core, with two reloads and a cut network."""
    minutes = 30
    with tempfile.TemporaryDirectory() as folder, serve(Path(folder)) as server:
        (walk,) = make_walks(server, {"measure": "shank_stance", "goal": 60.0, "minutes": 40})
        with (
            chromium() as browser,
            signed_in(browser, server, walk) as therapist,
            browser.new_context(base_url=server.url) as pocket,
        ):
            monitor, page = therapist.new_page(), pocket.new_page()
            monitor.goto(walk.monitor_path)
            monitor.click("[data-main]")
            pocket.new_cdp_session(page).send("Emulation.setCPUThrottlingRate", {"rate": 6})
            page.goto(f"/sensor/#token={walk.source}&place=shank&side=left")
            phone: WornPhone | None = None
            found = 0
            for minute in range(minutes):
                if minute in (0, 10, 20):
                    if phone is not None:
                        found += phone.strides
                        page.reload()
                    page.click("[data-begin]")
                    page.wait_for_selector("body[data-step=check]")
                    page.wait_for_timeout(1000)
                    phone = phone or WornPhone(page, 60 * minutes)
                pocket.set_offline(minute == 15)
                phone.walk(60 * minute, 60 * minute + 60)
            assert phone is not None
            found += phone.strides
            page.wait_for_function(
                "() => document.querySelector('[data-show=state]').textContent.includes('· 0 w')"
            )
            stored = len(read_steps(server, walk.session))
    walked = int(60 * minutes / STRIDE_S)
    print(f"\n{stored} of {found} strides stored, of {walked} walked with two reloads")
    assert stored == found
    assert found >= walked - 3 * 6  # each start needs a stance, and the first four seconds stand
