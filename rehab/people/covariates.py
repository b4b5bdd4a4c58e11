"""What studies adjust by, of a person: in bands and months, never as a date of birth."""

from __future__ import annotations

from datetime import date

BAND_YEARS = 10
OLDEST_BAND = 90  # years; whoever is older is in one band with them


def age_band(birth_year: int | None, on: date) -> str:
    """Return the ten years of age on a day, such as ``60-69``; empty where the year is unknown.

    By calendar years, so a person may be counted as up to one year older.
    """
    if birth_year is None:
        return ""
    age = max(0, on.year - birth_year)
    if age >= OLDEST_BAND:
        return f"{OLDEST_BAND}+"
    first = age // BAND_YEARS * BAND_YEARS
    return f"{first}-{first + BAND_YEARS - 1}"


def months_since(month: date | None, on: date) -> int | None:
    """Return the whole calendar months from one day's month to another's; None if unknown."""
    if month is None:
        return None
    return max(0, (on.year - month.year) * 12 + on.month - month.month)
