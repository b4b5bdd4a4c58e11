"""How much is tried: what a change needs, or everything, as in CI."""

import os

EVERYTHING = "GARRY_TEST_ALL" in os.environ  # set by `make test-all`
FAST = "GARRY_TEST_FAST" in os.environ  # set by `make test-fast`


def examples(count: int) -> int:
    """Return with how many examples a property is tried that has so many in `make test-all`."""
    if EVERYTHING:
        return count
    return max(5, count // 20) if FAST else max(10, count // 5)
