"""A plug-in of pytest, `garry-testing`: `pytest --garry` tries what installed packages add."""

from __future__ import annotations

import sys
from importlib.util import find_spec
from pathlib import Path

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
        config.args += map(str, _files())


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    """Find them also in an environment within the tested folder, which else is left out."""
    if not config.getoption("garry"):
        return None
    if any(file.is_relative_to(collection_path) for file in _files()):
        return False
    return collection_path.is_relative_to(sys.prefix) or None


def pytest_collect_file(file_path: Path, parent: pytest.Collector) -> pytest.Module | None:
    """Collect one that is no argument of its own, as the folder around it is one."""
    if not parent.config.getoption("garry") or file_path not in _files():
        return None
    given = parent.session.isinitpath(file_path)  # pytest itself collects it then
    return None if given else pytest.Module.from_parent(parent, path=file_path)


def _files() -> list[Path]:
    found = (find_spec(name) for name in CONTRACTS)
    return [Path(str(spec.origin)) for spec in found if spec is not None]
