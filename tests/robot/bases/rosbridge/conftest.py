"""What tests of the rosbridge base share."""

import pytest

from tests.support.rosbridge_stage import Stage


@pytest.fixture
def stage():
    return Stage()
