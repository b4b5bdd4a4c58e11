"""A clinic for every test of boards."""

from __future__ import annotations

import pytest

from rehab.people.models import Clinic


@pytest.fixture
def clinic() -> Clinic:
    return Clinic.everywhere.create(name="Elm", boards_across=True)
