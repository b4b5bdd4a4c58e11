"""A clinic lives in one of two servers behind HAProxy: its pages and forms find it."""

from __future__ import annotations

import json
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Browser, WebSocket

from tests.support.hosted import find_missing, run_haproxy, run_postgres
from tests.support.pair import Pair

pytestmark = [
    pytest.mark.browser,
    pytest.mark.server,
    pytest.mark.long,
    pytest.mark.timeout(200),
    pytest.mark.skipif(bool(find_missing()), reason=f"two servers: {find_missing()}"),
]
BACK_S = 5.0  # on a machine that does much else; the pause before it is 0.25 s at most


@pytest.fixture(scope="module")
def pair(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Pair]:
    with run_postgres() as database:
        both = Pair(tmp_path_factory.mktemp("pair"), database)
        try:
            both.begin_all()
            yield both
        finally:
            both.kill_all()


def test_a_page_and_its_forms_at_the_wrong_server_find_the_right_one(
    pair: Pair, browser: Browser, tmp_path: Path
) -> None:
    (row,) = pair.seed(1)
    right, wrong = (f"127.0.0.1:{pair.ports[place ^ pair.place_of(row)]}" for place in (0, 1))
    heard: list[tuple[float, str]] = []

    def hear(socket: WebSocket) -> None:
        socket.on("framereceived", lambda text: heard.append((time.monotonic(), str(text))))

    with run_haproxy(tmp_path / "haproxy", *pair.ports) as (_, secure, _tls):
        context = browser.new_context(ignore_https_errors=True)
        cookies = {"sessionid": row["cookie"], "garry_server": wrong}
        context.add_cookies([{"name": n, "value": v, "url": secure} for n, v in cookies.items()])
        page = context.new_page()
        page.on("websocket", hear)
        page.goto(f"{secure}/sessions/{row['session']}/monitor/")
        page.wait_for_function("right => document.cookie.includes(right)", arg=right)
        while not any('"snapshot"' in text for _, text in heard):
            page.wait_for_timeout(20)
        sent_away_s = next(at for at, text in heard if '"elsewhere"' in text)
        back_s = next(at for at, text in heard if '"snapshot"' in text) - sent_away_s
        print(f"back after {back_s:.2f} s")
        assert back_s < BACK_S
        # A program without the cookie, or with the wrong one, is sent there by HAProxy itself.
        for named in (wrong, right, ""):
            context.add_cookies([{"name": "garry_server", "value": named, "url": secure}])
            kind = "pause" if named == wrong else "resume" if named == right else "pause"
            answer = context.request.post(
                f"{secure}/api/v1/sessions/{row['session']}/changes",
                headers={"Authorization": f"Bearer {row['token']}"},
                data={"kind": kind},
            )
            assert answer.status == 200, answer.text()
            assert json.loads(answer.text())["state"] == (
                "running" if kind == "resume" else "paused"
            )
        context.close()
