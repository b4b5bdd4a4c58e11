"""What all senders of noise share: the same nonsense in every run, and what no answer may hold."""

from __future__ import annotations

from typing import Any, TypeVar

from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st

# Words of Python's and Django's own reports of failures.
TELLTALES = (b"Traceback (most recent", b'File "/', b"Exception Value", b"OperationalError")

T = TypeVar("T")


def draw(strategy: st.SearchStrategy[T], count: int) -> list[T]:
    """Return so many examples of a strategy, the same in every run."""
    drawn: list[T] = []

    @settings(
        max_examples=count,
        deadline=None,
        derandomize=True,
        database=None,
        phases=[Phase.generate],
        suppress_health_check=list(HealthCheck),
    )
    @given(strategy)
    def take(example: Any) -> None:
        drawn.append(example)

    take()
    return drawn[:count]
