"""What strangers forge is a line of warning, not an error, and not each time."""

from __future__ import annotations

import io
import logging
from collections.abc import Callable, Iterator
from typing import Any

import pytest
from django.conf import settings
from django.test import Client
from django.utils.module_loading import import_string

from garry_site.logs import REFUSAL_EVERY_S, REFUSALS_AT_ONCE, LineFormatter

pytestmark = pytest.mark.django_db


class Log:
    """What the server's handler writes, by a clock of its own."""

    def __init__(self) -> None:
        self.now_s = 0.0
        self._stream = io.StringIO()
        self.handler = logging.StreamHandler(self._stream)
        self.handler.setFormatter(LineFormatter("%(levelname)s %(name)s: %(message)s"))
        served: Any = settings.LOGGING
        for name in served["handlers"]["stderr"]["filters"]:
            make = import_string(served["filters"][name]["()"])
            self.handler.addFilter(make(lambda: self.now_s))

    def lines(self) -> list[str]:
        """Return the lines since this was asked last."""
        written = self._stream.getvalue().splitlines()
        self._stream.seek(0)
        self._stream.truncate()
        return written


@pytest.fixture
def log() -> Iterator[Log]:
    made, root = Log(), logging.getLogger()
    root.addHandler(made.handler)
    yield made
    root.removeHandler(made.handler)


def forge_host(lead: Client, text: str = "evil.example") -> int:
    return Client(raise_request_exception=False).get("/sign-in/", HTTP_HOST=text).status_code


def forge_filter(lead: Client, text: str = "") -> int:
    url = f"/admin/rehab/patient/?clinic__users__password__startswith=a{text}"
    return lead.get(url).status_code


@pytest.mark.parametrize(
    ("forge", "name"),
    [(forge_host, "DisallowedHost"), (forge_filter, "DisallowedModelAdminLookup")],
)
def test_a_forgery_is_one_line_of_warning_and_few_in_a_minute(
    world, log, forge: Callable[[Client], int], name
):
    lead = world.lead
    lead.raise_request_exception = False
    assert forge(lead) in {302, 400}
    for _ in range(20):
        forge(lead)
    lines = log.lines()
    assert len(lines) == REFUSALS_AT_ONCE
    assert all(line.startswith(f"WARNING django.security.{name}: Refused: ") for line in lines)
    log.now_s += REFUSAL_EVERY_S
    forge(lead)
    assert [
        line.endswith(f"(and {21 - REFUSALS_AT_ONCE} more before)") for line in log.lines()
    ] == [True]


def test_a_refusals_line_is_short_and_one(log):
    forge_host(Client(), f"evil.example{'x' * 5000}")
    [line] = log.lines()
    assert len(line) < 300


def test_errors_of_ours_keep_their_traceback(log):
    try:
        raise RuntimeError("ours")
    except RuntimeError:
        for _ in range(5):
            logging.getLogger("rehab.x").exception("A call failed")
    assert len([line for line in log.lines() if line == "RuntimeError: ours"]) == 5
