"""Where the patient of a session's test walks."""

from __future__ import annotations

import pytest

from rehab.stations.models import Station
from tests.support.world import World


@pytest.fixture
def station(world: World) -> Station:
    return world.add_station("Free")
