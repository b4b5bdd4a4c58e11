"""Whatever is sent to a page: no failure, nobody else's rows, nothing of the inside, and soon."""

from __future__ import annotations

import pytest

from tests.form_noise import run_noise

REQUESTS = 230  # tests/bench has 10,000


@pytest.mark.django_db
def test_noise_to_every_form_fails_nowhere_and_leaks_nothing(capsys):
    told = run_noise(REQUESTS)
    with capsys.disabled():
        print(f"\nForm noise: {told}")
