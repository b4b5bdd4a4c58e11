"""What tests in a browser share: one server for the tests of a file."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from tests.support.browsers import SharedChromium
from tests.support.servers import Server, serve


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    """Run a server on a folder of its own."""
    with serve(tmp_path_factory.mktemp("data")) as running:
        yield running


@pytest.fixture(autouse=True)
def _pages_do_not_fail(shared_chromium: SharedChromium) -> Iterator[None]:
    """Fail a test in whose pages a script raised what nobody caught."""
    yield
    errors = shared_chromium.page_errors[:]
    shared_chromium.page_errors.clear()
    assert errors == []
