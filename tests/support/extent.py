"""How much is tried: what a change needs, or everything, as in CI."""

import os

EVERYTHING = "GARRY_TEST_ALL" in os.environ  # set by `make test-all`
