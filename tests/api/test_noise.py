"""Whatever is sent to the API: a described answer in JSON, soon, and nobody else's rows."""

from __future__ import annotations

import pytest

from tests.support.api_fuzz import run_noise


# tests/bench has 10,000.
@pytest.mark.wide
@pytest.mark.parametrize("calls", [40, pytest.param(300, marks=pytest.mark.long)])
@pytest.mark.django_db(transaction=True)  # changes are written by a connection of their own
def test_noise_is_answered_as_described_and_leaks_nothing(capsys, monkeypatch, calls):
    told = run_noise(calls, monkeypatch)
    with capsys.disabled():
        print(f"\nAPI noise: {told}")
