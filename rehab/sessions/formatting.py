"""Figures, dates and sources as text, the same on every page and in its language."""

from __future__ import annotations

from datetime import date, datetime
from zoneinfo import ZoneInfo

from django.utils.formats import date_format, number_format
from django.utils.translation import gettext, gettext_noop, ngettext

from rehab.people.models import Clinic
from rehab.training.changes import STATE_LABELS, State
from rehab.training.schedules import Schedule, ScheduleKind

MISSING = "–"
NBSP = "\N{NO-BREAK SPACE}"


def format_rate(rate: float | None) -> str:
    """Return a ratio as whole percent."""
    return MISSING if rate is None else f"{format_number(100 * rate, 0)}{NBSP}%"


def format_change(ratio: float | None) -> str:
    """Return a change as whole percent with its sign."""
    return ("+" if ratio and ratio > 0 else "") + format_rate(ratio)


def format_number(value: float | None, places: int = 2) -> str:
    """Return a number with a minus sign (not a hyphen) and grouped thousands."""
    if value is None:
        return MISSING
    written = number_format(round(value, places) + 0.0, places, force_grouping=True)
    return written.replace("-", "−")


def format_significant(value: float) -> str:
    """Return a number of unknown unit, with about three figures that say something."""
    size = abs(value)
    return format_number(value, 0 if size >= 100 else 1 if size >= 10 else 2 if size >= 1 else 3)


def format_quantity(value: float | None, unit: str) -> str:
    """Return a value with its unit."""
    return MISSING if value is None else f"{format_number(value)}{NBSP}{unit}"


def yes_or_no(value: bool) -> str:
    """Return yes or no in the active language."""
    return gettext("yes") if value else gettext("no")


def format_duration(seconds: float) -> str:
    """Return a time span, in seconds below a minute, else in minutes."""
    return f"{seconds:.0f}{NBSP}s" if seconds < 59.5 else f"{seconds / 60:.0f}{NBSP}min"


def format_day(day: date, today: date) -> str:
    """Return a day as text: `today`, without its year in this year, else with it."""
    if day == today:
        return gettext("today")
    return date_format(day, "MONTH_DAY_FORMAT" if day.year == today.year else "DATE_FORMAT")


# What `source_choices` returns and a session stores, in English.
SOURCE_LABELS = (
    gettext_noop("Live sensor"),
    gettext_noop("Simulated patient, good"),
    gettext_noop("Simulated patient, poor"),
    gettext_noop("Simulated patient, demo"),
    gettext_noop("Simulated patient, fatiguing"),
    gettext_noop("Simulated patient, dropout"),
)
SIMULATED_PREFIX, RECORDING_PREFIX = "Simulated patient, ", "Recording "


def format_source(source: str) -> str:
    """Return where steps come from, as text."""
    if source.startswith(RECORDING_PREFIX):
        return gettext("Recording %(name)s") % {"name": source.removeprefix(RECORDING_PREFIX)}
    return gettext(source) if source else ""


def format_schedule(schedule: Schedule) -> str:
    """Return when feedback comes, in a few words."""
    values = {"steps": schedule.interval, "band": round(100 * schedule.band)}
    match schedule.kind:
        case ScheduleKind.EVERY if schedule.answers_all:
            return gettext("every step")
        case ScheduleKind.EVERY:
            return gettext("every %(steps)d steps") % values
        case ScheduleKind.BANDWIDTH:
            return gettext("beyond ± %(band)d %%") % values
        case ScheduleKind.FADED:
            return (
                ngettext("fading to every step", "fading to every %(steps)d steps", values["steps"])
                % values
            )
        case ScheduleKind.SUMMARY:
            return gettext("summary of %(steps)d steps") % values


def format_state(state: str) -> str:
    """Return a session's state as text; empty for a finished one, whose result says it."""
    return "" if state == State.FINISHED else gettext(STATE_LABELS[State(state)])


def clinic_time(moment: datetime, clinic: Clinic) -> datetime:
    """Return a moment in the clinic's time zone."""
    return moment.astimezone(ZoneInfo(clinic.time_zone))


def midnight_of(moment: datetime) -> datetime:
    """Return the moment at which a local moment's day began.

    Where clocks go back at midnight (Havana), there are two midnights: the first counts.
    """
    return moment.replace(hour=0, minute=0, second=0, microsecond=0, fold=0)
