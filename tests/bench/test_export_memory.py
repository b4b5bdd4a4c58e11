"""An export of a million strides takes the memory of one of some ten thousand."""

from __future__ import annotations

import json

import pytest

from tests.bench.own_database import run_alone

pytestmark = [pytest.mark.bench, pytest.mark.timeout(3600)]
FEW, MANY = 20, 500  # sessions of 2000 strides
MORE_MB = 20  # of its own memory, for a list of sessions ten times as long


def test_a_million_strides_are_exported_within_flat_memory(tmp_path):
    few, many = (
        run_alone("million_strides", count, folder=tmp_path / str(count)) for count in (FEW, MANY)
    )
    print(f"\n{json.dumps(few)}\n{json.dumps(many)}")
    assert many["strides"] == 1_000_000
    assert 0 < many["peak_own_mb"] < few["peak_own_mb"] + MORE_MB
