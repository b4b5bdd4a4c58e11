"""Dates that are shifted: by the same weeks for all data of a patient."""

from __future__ import annotations

import hmac
from collections.abc import Iterable, Iterator
from datetime import date, timedelta
from typing import Any

from rehab.people.server_keys import Purpose, stable_key

MAX_WEEKS = 520
SINCE_1970_S = 1e8  # clocks beyond three years count from 1970, and would reveal the date


def shift_of(pseudonym: str) -> timedelta:
    """Return by how much a patient's dates are moved: 1 to 520 whole weeks back.

    It follows from the pseudonym and the server's own key (HMAC-SHA-256): the same at each export,
    and unknown to anyone who has only the files. Whole weeks keep the day of the week.
    """
    digest = hmac.digest(stable_key(Purpose.DATES), pseudonym.encode(), "sha256")
    return -timedelta(weeks=1 + int.from_bytes(digest[:8], "big") % MAX_WEEKS)


def shift_rows(rows: Iterable[Any], shift: timedelta | None) -> Iterator[Any]:
    """Yield rows of a table with every date moved, and without times since 1970 within JSON."""
    if shift is None:
        yield from rows
        return
    for row in rows:
        yield row._make(_shift(cell, shift) for cell in row)


def _shift(cell: Any, shift: timedelta) -> Any:
    if isinstance(cell, date):  # or a moment
        return cell + shift
    return without_clocks(cell) if isinstance(cell, (dict, list)) else cell


def without_clocks(data: Any) -> Any:
    """Return JSON without its numbers that may be times since 1970; null stands for them."""
    if isinstance(data, dict):
        return {name: without_clocks(value) for name, value in data.items()}
    if isinstance(data, list):
        return [without_clocks(value) for value in data]
    is_number = isinstance(data, (int, float)) and not isinstance(data, bool)
    return None if is_number and abs(data) >= SINCE_1970_S else data
