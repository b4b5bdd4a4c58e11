"""Who walks, and where, in tests of sessions."""

from __future__ import annotations

import pytest

from rehab.people.models import Patient
from rehab.stations.models import Station
from tests.support.walks import make_patient
from tests.support.world import World


@pytest.fixture
def patient(world: World) -> Patient:
    return make_patient(world.clinic, code="K7-204")


@pytest.fixture
def station(world: World) -> Station:
    return Station.everywhere.create(clinic=world.clinic, name="Free")
