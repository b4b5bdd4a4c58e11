"""False A2 shown and strides lost, for each fault in each recording."""

import pytest

from tests.gait.faults.bench import FAULTS, RECORDINGS, try_fault
from tests.gait.faults.hidden import HIDDEN, find_hidden

pytestmark = pytest.mark.bench


def test_table():
    """No fault shows an A2 that is off by more than a tenth, but for the five that are hidden."""
    print(
        f"\nfalse A2 shown / strides lost / strides, worst error shown\n{'':28}"
        + "".join(f"{name:>18}" for name in RECORDINGS)
    )
    shown = {}
    for fault in FAULTS:
        tallies = [try_fault(name, fault) for name in RECORDINGS]
        shown[fault] = sum(t.wrong for t in tallies)
        cells = "".join(f"{t.wrong:>5}/{t.lost:>3}/{t.strides:>3} {t.worst:>5.0%}" for t in tallies)
        mark = find_hidden(fault) if shown[fault] else None
        print(f"{fault:28}{cells}" + (f"  hidden {mark}" if mark else ""))
    print("\nHidden from every channel, at most five:")
    for number, one in HIDDEN.items():
        print(f"  {number}: {one.proof}.\n     Found by: {one.found_by}.")
    assert len(HIDDEN) <= 5
    assert {fault for fault, wrong in shown.items() if wrong and not find_hidden(fault)} == set()
