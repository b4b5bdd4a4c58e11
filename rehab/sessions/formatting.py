"""How pages write figures, dates and sources: the same everywhere, in the page's language."""

from __future__ import annotations

from datetime import date, datetime
from typing import Any
from zoneinfo import ZoneInfo

from django.utils.dateformat import format as format_date
from django.utils.formats import number_format
from django.utils.translation import gettext, gettext_noop
from django.utils.translation import gettext_lazy as _

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
    written = number_format(round(value, places) + 0.0, places, force_grouping=True)
    return written.replace("-", "−")


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
    return format_date(day, gettext("M j") if day.year == today.year else gettext("M j, Y"))


# How lively a robot is (`training.plans.ROBOT_LEVELS`).
LEVELS: dict[str, Any] = {"normal": _("normal"), "gentle": _("gentle"), "off": _("off"), "": ""}
# What `list_sources` gives and a session keeps, in English.
SOURCES = (
    gettext_noop("Live sensor"),
    gettext_noop("Simulated patient, good"),
    gettext_noop("Simulated patient, poor"),
    gettext_noop("Simulated patient, fatiguing"),
    gettext_noop("Simulated patient, dropout"),
)
SIMULATED, RECORDING = "Simulated patient, ", "Recording "


def say_source(source: str) -> str:
    """Say where steps come from."""
    if source.startswith(RECORDING):
        return gettext("Recording %(name)s") % {"name": source.removeprefix(RECORDING)}
    return gettext(source) if source else ""


def at_clinic(moment: datetime, clinic: Clinic) -> datetime:
    """Give a moment by the clinic's own clock."""
    return moment.astimezone(ZoneInfo(clinic.time_zone))


def midnight_of(moment: datetime) -> datetime:
    """Return the moment at which a local moment's day began.

    Where clocks go back at midnight's hour (Havana), there are two midnights: the first counts.
    """
    return moment.replace(hour=0, minute=0, second=0, microsecond=0, fold=0)
