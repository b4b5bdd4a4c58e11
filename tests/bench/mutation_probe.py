"""Which tests run which mutant, as a plugin of pytest and a call in the product's code.

`hit` stands before each statement that will be changed. Servers and robots that a test starts count
for it: they inherit its name. Each file of tests begins with empty caches: what one of them had
computed counts for its own file only, and the next must come to the mutant itself.
"""

from __future__ import annotations

import os
import sys
import traceback
from functools import _lru_cache_wrapper
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import pytest

# Not GARRY_…: of those a server that a test starts inherits none (tests/support/servers.py).
HITS = "MUTATION_HITS"  # the file that says so
PASSED = "MUTATION_PASSED"  # the file of tests that passed, with their seconds
CHOSEN = "MUTATION_CHOSEN"  # the file of tests to run, of those collected
FAILED = "MUTATION_FAILED"  # the file of the test that failed
OURS = ("garry_site", "rehab", "robot", "tests")
_seen: set[tuple[int, str]] = set()
_begun: set[Path] = set()  # files of tests


def hit(mutant: int) -> None:
    """Note that the test of this moment came here; no test where a module was being imported."""
    test = os.environ.get("PYTEST_CURRENT_TEST", "").rpartition(" ")[0]
    if (mutant, test) not in _seen:
        _seen.add((mutant, test))
        _write(HITS, f"{mutant}\t{'' if _is_importing() else test}")


def _is_importing() -> bool:
    frames = traceback.walk_stack(None)
    return any("importlib._bootstrap" in frame.f_code.co_filename for frame, _ in frames)


def _write(variable: str, line: str) -> None:
    if file := os.environ.get(variable):
        with Path(file).open("a") as lines:
            lines.write(f"{line}\n")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    if file := os.environ.get(CHOSEN):
        chosen = set(Path(file).read_text().splitlines())
        items[:] = [item for item in items if item.nodeid in chosen]


def pytest_runtest_setup(item: pytest.Item) -> None:
    if HITS not in os.environ or item.path in _begun:
        return
    _begun.add(item.path)
    ours = [module for name, module in sys.modules.items() if name.partition(".")[0] in OURS]
    for value in [value for module in ours for value in vars(module).values()]:
        if isinstance(value, _lru_cache_wrapper):
            value.cache_clear()


def pytest_runtest_logreport(report: pytest.TestReport) -> None:
    if os.environ.get("PYTEST_XDIST_WORKER"):
        return
    if report.failed:
        _write(FAILED, report.nodeid)
    elif report.passed and report.when == "call":
        _write(PASSED, f"{report.duration:.4f}\t{report.nodeid}")
