"""Which days a board looks at, by the clinic's own calendar."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import UTC, date, datetime, time, timedelta, tzinfo
from zoneinfo import ZoneInfo

from rehab.boards.models import Leaderboard

LAST_DAYS = 30


@dataclass(frozen=True, slots=True)
class Period:
    """From the first day to the last one, both included; None where it has no bound."""

    first: date | None
    last: date | None
    zone: tzinfo
    rolls_on: date | None = None  # the day on which a new week or month begins
    lasts: timedelta | None = None  # how long a session stays in a period that glides

    @property
    def began(self) -> datetime | None:
        """The first moment."""
        return None if self.first is None else datetime.combine(self.first, time(), self.zone)

    @property
    def ended(self) -> datetime | None:
        """The first moment after it."""
        if self.last is None:
            return None
        return datetime.combine(self.last + timedelta(days=1), time(), self.zone)

    def day_of(self, moment: datetime) -> date:
        """Give the day that a moment falls on."""
        return moment.astimezone(self.zone).date()

    def leaves(self, day: date) -> date | None:
        """Say when a session of this day no longer counts; None for never."""
        return self.rolls_on if self.lasts is None else day + self.lasts


def period_of(board: Leaderboard, now: datetime) -> Period:
    """Give the days that count now; on a frozen board, those that counted on its last day."""
    zone, as_of = zone_of(board), last_day_of(board, now)
    period = _reach(board, as_of, zone)
    if not is_over(board, now):
        return period
    last = as_of if period.last is None else min(period.last, as_of)
    return Period(period.first, last, zone)


def zone_of(board: Leaderboard) -> tzinfo:
    """Give the clock that a board goes by."""
    return UTC if board.clinic is None else ZoneInfo(board.clinic.time_zone)


def last_day_of(board: Leaderboard, now: datetime) -> date:
    """Give the day as of which a board is: today, or the one on which it was frozen."""
    today = now.astimezone(zone_of(board)).date()
    return today if board.frozen_on is None else min(board.frozen_on, today)


def is_over(board: Leaderboard, now: datetime) -> bool:
    """Whether a frozen board's last day has passed."""
    return (
        board.frozen_on is not None
        and last_day_of(board, now) < now.astimezone(zone_of(board)).date()
    )


def _reach(board: Leaderboard, today: date, zone: tzinfo) -> Period:
    match board.period:
        case Leaderboard.Period.DAYS_30:
            days = timedelta(days=LAST_DAYS)
            return Period(today - days + timedelta(days=1), None, zone, lasts=days)
        case Leaderboard.Period.WEEK:
            first = today - timedelta(days=today.weekday())
            return Period(first, None, zone, rolls_on=first + timedelta(days=7))
        case Leaderboard.Period.MONTH:
            first = today.replace(day=1)
            after = (first + timedelta(days=32)).replace(day=1)
            return Period(first, None, zone, rolls_on=after)
        case Leaderboard.Period.DATES:
            return Period(board.period_from, board.period_to, zone)
    return Period(None, None, zone)
