"""How far people stand out in an export: k-anonymity."""

from __future__ import annotations

import io
from collections import Counter
from collections.abc import Sequence
from typing import Any

from rehab.exports.session_table import PARTICIPANT
from rehab.people.web.csv_tables import CsvWriter

SMALL = 5  # people alike below which a group is named: the usual limit of statistics offices
# What somebody who knows a person may know of the columns about participants.
QUASI = tuple(column.name for column in PARTICIPANT)


def write_anonymity(people: Sequence[dict[str, Any]]) -> str:
    """Return as CSV how many people are alike in what others may know of them.

    k-anonymity (Sweeney 2002, Int J Uncertainty Fuzziness 10:557-570): the smallest number of
    people with the same values; by all columns together, and by each alone.

    Parameters
    ----------
    people
        One row for each person, with the columns of `PARTICIPANT`.
    """
    rows: list[list[Any]] = [["columns", "people", "k", f"people in groups below {SMALL}"]]
    for columns in (QUASI, *((name,) for name in QUASI)):
        groups = Counter(tuple(str(one.get(name)) for name in columns) for one in people)
        small = sum(count for count in groups.values() if count < SMALL)
        k = min(groups.values(), default=0)
        rows.append([" ".join(columns), len(people), k, small])
    text = io.StringIO()
    CsvWriter(text).write(rows)
    return text.getvalue()
