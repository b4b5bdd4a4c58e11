"""A plug-in of pytest, `garry-testing`: `pytest --garry` tries what installed packages add."""

from __future__ import annotations

from importlib.util import find_spec

import pytest

CONTRACTS = ("robot.testing", "rehab.testing")

pytest.register_assert_rewrite(*CONTRACTS)  # a failure says which values there were


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the option."""
    parser.getgroup("garry").addoption(
        "--garry",
        action="store_true",
        help="also try the contracts of the bases, gestures, sources, measures and readers that "
        "installed packages add to GARRY",
    )


def pytest_configure(config: pytest.Config) -> None:
    """Add the contracts to what is collected, where they are asked for."""
    if config.getoption("garry"):
        found = (find_spec(name) for name in CONTRACTS)
        config.args += [str(spec.origin) for spec in found if spec is not None]
