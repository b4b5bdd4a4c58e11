"""The cases of a matrix that a change is tested with show each of its values."""

from collections.abc import Hashable
from itertools import product
from types import SimpleNamespace

import pytest

from tests.support import matrix


class Case:
    """A test's case as pytest collects it."""

    parent, originalname = "tests/test_x.py", "test_x"

    def __init__(self, names: str, values: tuple[object, ...], **of_fixtures: object) -> None:
        self.marks = {"matrix"}
        self.table = pytest.mark.parametrize(names, [values]).mark
        params = dict(zip(names.split(", "), values, strict=True)) | of_fixtures
        self.callspec = SimpleNamespace(params=params)

    def iter_markers(self, _name):
        return [self.table]

    def get_closest_marker(self, name):
        return name in self.marks

    def add_marker(self, name):
        self.marks.add(name)


@pytest.mark.parametrize("sizes", [(1,), (5, 14), (4, 3, 2), (7, 7)])
def test_as_many_cases_as_the_longest_side_show_each_value(sizes):
    cases: list[set[Hashable]] = [set(enumerate(case)) for case in product(*map(range, sizes))]
    chosen = matrix.choose(cases)
    assert set().union(*(cases[index] for index in chosen)) == set().union(*cases)
    assert len(chosen) == max(sizes)


def test_the_other_cases_are_left_to_the_whole_run():
    cases = [Case("fault", (fault,), walk=walk) for fault in "abc" for walk in "xyz"]
    cases[0].marks.add("long")
    matrix.mark_the_others(cases)
    left = [case for case in cases if "long" not in case.marks]
    assert len(left) == 3
    for name, values in (("fault", "abc"), ("walk", "xyz")):
        assert {case.callspec.params[name] for case in left} == set(values)


def test_values_that_stand_together_are_one():
    rows = [(1.0, "low"), (1.0, "high"), (2.0, "low")]
    cases = [Case("value, name", row) for row in rows]
    matrix.mark_the_others(cases)
    assert not any("long" in case.marks for case in cases)


def test_what_is_no_matrix_runs_whole():
    cases = [Case("fault", (fault,), walk=walk) for fault in "ab" for walk in "xy"]
    for case in cases:
        case.marks.clear()
    matrix.mark_the_others(cases)
    assert not any(case.marks for case in cases)
