"""What tests in a browser share: one server for the tests of a file."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack
from typing import Any

import pytest
from playwright.sync_api import Browser, Page

from tests.support.browsers import SharedChromium, Visit, signed_in
from tests.support.servers import Server, serve


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    """Run a server on a folder of its own."""
    with serve(tmp_path_factory.mktemp("data")) as running:
        yield running


@pytest.fixture
def visit(browser: Browser, server: Server) -> Iterator[Visit]:
    """Return a function that opens a page in a browser of its own, where somebody is signed in.

    It takes an address, and what `signed_in` takes.
    """
    with ExitStack() as stack:

        def visit(path: str, *args: Any, **options: Any) -> Page:
            context = stack.enter_context(signed_in(browser, server, *args, **options))
            page = context.new_page()
            page.goto(path)
            return page

        yield visit


@pytest.fixture(autouse=True)
def _pages_do_not_fail(shared_chromium: SharedChromium) -> Iterator[None]:
    """Fail a test in whose pages a script raised what nobody caught."""
    yield
    errors = shared_chromium.page_errors[:]
    shared_chromium.page_errors.clear()
    assert errors == []
