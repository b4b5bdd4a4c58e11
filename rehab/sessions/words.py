"""How pages write figures and dates: the same everywhere, readable aloud."""

from __future__ import annotations

from datetime import date, datetime
from zoneinfo import ZoneInfo

from django.utils.dateformat import format as format_date
from django.utils.translation import gettext

from rehab.people.models import Clinic

NOTHING = "–"
SPACE = "\N{NO-BREAK SPACE}"


def say_rate(rate: float | None) -> str:
    """Write a ratio as whole percent."""
    return NOTHING if rate is None else f"{say_number(100 * rate, 0)}{SPACE}%"


def say_number(value: float | None, places: int = 2) -> str:
    """Write a number with a true minus sign."""
    if value is None:
        return NOTHING
    return f"{round(value, places) + 0.0:,.{places}f}".replace("-", "−")


def say_quantity(value: float | None, unit: str) -> str:
    """Write a value with its unit."""
    return NOTHING if value is None else f"{say_number(value)}{SPACE}{unit}"


def say_duration(seconds: float) -> str:
    """Write a time span, to the second below a minute, else to the minute."""
    return f"{seconds:.0f}{SPACE}s" if seconds < 59.5 else f"{seconds / 60:.0f}{SPACE}min"


def say_day(day: date, today: date) -> str:
    """Write a day as it is spoken of today."""
    if day == today:
        return gettext("today")
    return format_date(day, "M j" if day.year == today.year else "M j, Y")


def at_clinic(moment: datetime, clinic: Clinic) -> datetime:
    """Give a moment by the clinic's own clock."""
    return moment.astimezone(ZoneInfo(clinic.time_zone))
