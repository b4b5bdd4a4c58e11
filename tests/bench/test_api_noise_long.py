"""Ten thousand calls with nonsense in them: no failure, no leak, no lock-up."""

import pytest

from tests.support.api_fuzz import run_noise


@pytest.mark.django_db(transaction=True)
def test_ten_thousand_calls_of_noise(monkeypatch):
    print(f"\nAPI noise: {run_noise(10_000, monkeypatch)}")
