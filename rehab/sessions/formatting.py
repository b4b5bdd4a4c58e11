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

MISSING = "–"
NBSP = "\N{NO-BREAK NBSP}"


def format_rate(rate: float | None) -> str:
    """Write a ratio as whole percent."""
    return MISSING if rate is None else f"{format_number(100 * rate, 0)}{NBSP}%"


def format_number(value: float | None, places: int = 2) -> str:
    """Write a number with a true minus sign."""
    if value is None:
        return MISSING
    written = number_format(round(value, places) + 0.0, places, force_grouping=True)
    return written.replace("-", "−")


def format_quantity(value: float | None, unit: str) -> str:
    """Write a value with its unit."""
    return MISSING if value is None else f"{format_number(value)}{NBSP}{unit}"


def format_duration(seconds: float) -> str:
    """Write a time span, to the second below a minute, else to the minute."""
    return f"{seconds:.0f}{NBSP}s" if seconds < 59.5 else f"{seconds / 60:.0f}{NBSP}min"


def format_day(day: date, today: date) -> str:
    """Write a day as it is spoken of today."""
    if day == today:
        return gettext("today")
    return format_date(day, gettext("M j") if day.year == today.year else gettext("M j, Y"))


# How lively a robot is (`training.plans.ROBOT_LEVELS`).
ROBOT_LEVEL_LABELS: dict[str, Any] = {"normal": _("normal"), "gentle": _("gentle"), "off": _("off"), "": ""}
# What `list_sources` gives and a session keeps, in English.
SOURCE_LABELS = (
    gettext_noop("Live sensor"),
    gettext_noop("Simulated patient, good"),
    gettext_noop("Simulated patient, poor"),
    gettext_noop("Simulated patient, fatiguing"),
    gettext_noop("Simulated patient, dropout"),
)
SIMULATED_PREFIX, RECORDING_PREFIX = "Simulated patient, ", "Recording "


def format_source(source: str) -> str:
    """Say where steps come from."""
    if source.startswith(RECORDING_PREFIX):
        return gettext("Recording %(name)s") % {"name": source.removeprefix(RECORDING_PREFIX)}
    return gettext(source) if source else ""


def clinic_time(moment: datetime, clinic: Clinic) -> datetime:
    """Give a moment by the clinic's own clock."""
    return moment.astimezone(ZoneInfo(clinic.time_zone))
