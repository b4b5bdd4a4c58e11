"""The server that the tests of the client talk to."""

import pytest

from tests.sources.fake_garry import FakeGarry


@pytest.fixture
def garry():
    return FakeGarry()
