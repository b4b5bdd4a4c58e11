"""Of a test's table a few cases that show each of its values: what a change needs.

A test marked `matrix` runs whole in `make test-all`; its other cases are marked `long`.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Hashable, Iterable, Sequence
from typing import Any


def choose(cases: Sequence[set[Hashable]]) -> set[int]:
    """Return the indices of cases that together have every value of all.

    The next one is always the first of those with the most values that none before it has.
    """
    missing: set[Hashable] = set().union(*cases)
    chosen: set[int] = set()
    while missing:
        best = max(range(len(cases)), key=lambda index: len(cases[index] & missing))
        chosen.add(best)
        missing -= cases[best]
    return chosen


def values_of(item: Any) -> set[Hashable]:
    """Return a case's values: one for each `parametrize`, also of several names, and fixture."""
    named = [mark.args[0] for mark in item.iter_markers("parametrize")]
    tables = [name.replace(" ", "").split(",") if isinstance(name, str) else name for name in named]
    params = item.callspec.params
    of_fixtures = set(params) - {name for table in tables for name in table}
    return {
        tuple((name, id(params[name])) for name in table)
        for table in [*tables, *([name] for name in of_fixtures)]
    }


def mark_the_others(items: Iterable[Any]) -> None:
    """Mark those cases `long` whose values others of their matrix show."""
    matrices: dict[Hashable, list[Any]] = defaultdict(list)
    for item in items:
        is_case = hasattr(item, "callspec") and not item.get_closest_marker("long")
        if is_case and item.get_closest_marker("matrix"):
            matrices[item.parent, item.originalname].append(item)
    for matrix in matrices.values():
        chosen = choose([values_of(item) for item in matrix])
        for index, item in enumerate(matrix):
            if index not in chosen:
                item.add_marker("long")
