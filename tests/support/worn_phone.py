"""A phone's page as a leg wears it, in a browser: fed with simulated samples."""

from __future__ import annotations

import sqlite3
from collections.abc import Callable
from contextlib import closing

import numpy as np
from playwright.sync_api import Page

from tests.support.servers import Server
from tests.support.simulated_leg import Floats, random_mounting, walk_foot

Change = Callable[[Floats], Floats]

# What a phone's browser says of a sample, as fast as it is given. Times are the phone's own.
FEED = """([t0, rows]) => rows.forEach(([t, ax, ay, az, gx, gy, gz]) => {
  const event = new DeviceMotionEvent("devicemotion", {
    interval: 16,
    accelerationIncludingGravity: { x: ax, y: ay, z: az },
    rotationRate: { beta: gx, gamma: gy, alpha: gz },
  });
  Object.defineProperty(event, "timeStamp", { value: t0 - performance.timeOrigin + 1000 * t });
  window.dispatchEvent(event);
})"""


def read_steps(server: Server, session: int) -> list[tuple[bool, str]]:
    """Return whether each stored stride of a session counts, and its further values."""
    with closing(sqlite3.connect(server.folder / "garry.sqlite3")) as database:
        return database.execute(
            "SELECT valid, extra FROM rehab_step WHERE session_id = ? ORDER BY number", [session]
        ).fetchall()


class WornPhone:
    """A phone's page, fed with the samples of a simulated leg."""

    def __init__(self, page: Page, seconds: float) -> None:
        self.page = page
        t_s, rate, acceleration = walk_foot(seconds, rate_hz=60)
        rate[t_s < 4], acceleration[t_s < 4] = 0, (0, 0, 9.81)
        matrix = random_mounting(3)
        # An iPhone's acceleration has the other sign.
        self._table = np.column_stack((t_s, -acceleration @ matrix.T, np.degrees(rate) @ matrix.T))
        self._t_s = t_s
        self._start_ms = page.evaluate("performance.timeOrigin + performance.now()")

    def walk(self, begin_s: float, end_s: float, change: Change = lambda part: part) -> None:
        """Feed it with the samples of that time: rows of s, m/s², °/s, which may be changed."""
        part = self._table[(self._t_s >= begin_s) & (self._t_s < end_s)]
        self.page.evaluate(FEED, [self._start_ms, change(part).tolist()])

    @property
    def strides(self) -> int:
        """How many the page has found since it was loaded."""
        self.page.wait_for_timeout(700)  # it is drawn twice a second
        return int(self.page.inner_text("[data-show=strides]"))
