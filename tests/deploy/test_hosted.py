"""The hosted set as deploy/ and docs/hosting.md say: PostgreSQL, one server, HAProxy with TLS."""

from __future__ import annotations

import asyncio
import ssl
import subprocess
import sys
import time
import urllib.error
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from email.message import Message
from pathlib import Path
from typing import Any

import pytest

from tests.support.hosted import find_missing, run_haproxy, run_postgres
from tests.support.servers import ROOT
from tests.support.torture import Entrance, Torture

pytestmark = [
    pytest.mark.server,
    pytest.mark.long,
    pytest.mark.skipif(bool(find_missing()), reason=find_missing()),
]

TOKEN = "only who watches the server has this"
SECRET = "Q" * 43  # opens a family's page


@dataclass
class Hosted:
    """A hosted set that waits for its server."""

    torture: Torture
    plain: str
    secure: str
    tls: ssl.SSLContext

    def get(self, url: str, **headers: str) -> tuple[int, Message, str]:
        """Return what a GET answers: status, headers, text. Redirects are not followed."""
        opener = urllib.request.build_opener(
            NoRedirect, urllib.request.HTTPSHandler(context=self.tls)
        )
        try:
            request = urllib.request.Request(url, headers=headers)  # noqa: S310 (our own address)
            with opener.open(request, timeout=20) as answer:
                return answer.status, answer.headers, answer.read().decode(errors="replace")
        except urllib.error.HTTPError as answer:
            return answer.code, answer.headers, answer.read().decode(errors="replace")

    def wait_until_checked(self) -> None:
        """Wait until the proxy has found the server."""
        until_s = time.monotonic() + 20
        while self.get(f"{self.secure}/readyz")[0] == 503 and time.monotonic() < until_s:
            time.sleep(0.1)

    @contextmanager
    def serve(self) -> Iterator[subprocess.Popen[str]]:
        """Run the server until the block ends."""
        with subprocess.Popen(
            [sys.executable, "manage.py", "serve", *self.torture.serve],
            cwd=ROOT,
            env=self.torture.environment,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        ) as process:
            try:
                for line in process.stdout:
                    if line.startswith("Ready"):
                        break
                yield process
            finally:
                process.terminate()
                process.communicate(timeout=40)


class NoRedirect(urllib.request.HTTPRedirectHandler):
    """Leaves a redirect as it is."""

    def redirect_request(self, *_: Any, **__: Any) -> None:
        """Follow nothing."""


@pytest.fixture
def hosted(tmp_path: Path) -> Iterator[Hosted]:
    """Return a set after the commands of docs/hosting.md: tables made, static files collected."""
    with run_postgres() as database:
        torture = Torture(tmp_path / "garry", seed=17, rate=20, database=database)
        torture.folder.mkdir()
        torture.environment |= {
            "GARRY_HOSTED": "1",
            "GARRY_SECRET_KEY": "0123456789" * 6,
            "GARRY_ALLOWED_HOSTS": "localhost,127.0.0.1",
            "GARRY_METRICS_TOKEN": TOKEN,
            "GARRY_LOG_FORMAT": "json",
        }
        torture.run_python("manage.py", "migrate", "--verbosity", "0")
        torture.run_python("manage.py", "collectstatic", "--no-input", "--verbosity", "0")
        with run_haproxy(tmp_path / "haproxy", torture.port) as (plain, secure, tls):
            torture.entrance = Entrance(secure, tls)
            yield Hosted(torture, plain, secure, tls)


@pytest.mark.timeout(300)
def test_a_walk_through_the_proxy_outlives_restarts_and_a_kill(hosted: Hosted) -> None:
    ended = asyncio.run(hosted.torture.run(sessions=4, rounds=4, orderly=0.7))
    assert hosted.torture.find_faults(ended) == []
    assert 0 < ended["kills"] < 4
    assert sum(walk.acknowledged for walk in hosted.torture.walks) > 100


def test_what_the_proxy_lets_through(hosted: Hosted, tmp_path: Path) -> None:
    assert hosted.get(f"{hosted.secure}/readyz")[0] == 503  # no server yet
    assert hosted.get(f"{hosted.secure}/family/{SECRET}/")[0] == 503
    assert hosted.get(f"{hosted.plain}/family/{SECRET}/")[0] == 308
    log = (tmp_path / "haproxy" / "log").read_text()
    assert "/readyz" in log
    assert SECRET not in log
    with hosted.serve():
        hosted.wait_until_checked()
        assert hosted.get(f"{hosted.secure}/readyz")[::2] == (200, "ok\n")
        status, headers, _ = hosted.get(f"{hosted.plain}/start/?a=b")
        there = hosted.plain.replace("http:", "https:")  # 80 and 443 stand in no address
        assert (status, headers["Location"]) == (308, f"{there}/start/?a=b")
        status, headers, page = hosted.get(f"{hosted.secure}/sign-in/")
        assert status == 200
        assert headers["Strict-Transport-Security"].startswith("max-age=31536000")
        assert len(headers["X-Request-ID"]) == 32  # HAProxy's
        style = page.split('rel="stylesheet" href="')[1].split('"')[0]
        status, headers, _ = hosted.get(f"{hosted.secure}{style}", **{"Accept-Encoding": "gzip"})
        assert (status, headers.get("Content-Encoding")) == (200, "gzip")
        assert "immutable" in headers["Cache-Control"]

        own = f"http://127.0.0.1:{hosted.torture.port}/metrics"
        assert hosted.get(own)[0] == 404
        allowed = {"Authorization": f"Bearer {TOKEN}"}  # as Prometheus asks, past the proxy
        status, _, figures = hosted.get(own, **allowed)
        assert status == 200
        assert "garry_ready 1.0" in figures
        for path in ("/metrics", "/livez"):
            assert hosted.get(f"{hosted.secure}{path}", **allowed)[0] == 404
