"""The days whose sessions count on a board, by the clinic's calendar."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import UTC, date, datetime, time, timedelta, tzinfo
from zoneinfo import ZoneInfo

from rehab.boards.choices import PeriodKind
from rehab.boards.models import Leaderboard

LAST_DAYS = 30


@dataclass(frozen=True, slots=True)
class Period:
    """From the first day to the last one, both included; None where it has no bound.

    On a board that is frozen, sessions have also ended before ``frozen_at``.
    """

    first: date | None
    last: date | None
    zone: tzinfo
    frozen_at: datetime | None = None

    @property
    def began(self) -> datetime | None:
        """The first moment."""
        return None if self.first is None else datetime.combine(self.first, time(), self.zone)

    @property
    def ended(self) -> datetime | None:
        """The first moment after it."""
        return None if self.last is None else _end_of(self.last, self.zone)

    def day_of(self, moment: datetime) -> date:
        """Return the day that a moment falls on."""
        return moment.astimezone(self.zone).date()


def period_of(board: Leaderboard, now: datetime) -> Period:
    """Return the period that counts now; of a frozen board, the one that did on its last day."""
    zone, as_of = zone_of(board), last_day_of(board, now)
    period = _unfrozen_period(board, as_of, zone)
    if not is_over(board, now):
        return period
    last = as_of if period.last is None else min(period.last, as_of)
    return Period(period.first, last, zone, frozen_at=_end_of(as_of, zone))


def _end_of(day: date, zone: tzinfo) -> datetime:
    return datetime.combine(day + timedelta(days=1), time(), zone)


def zone_of(board: Leaderboard) -> tzinfo:
    """Return the time zone of a board: its clinic's, or UTC across clinics."""
    return UTC if board.clinic is None else ZoneInfo(board.clinic.time_zone)


def last_day_of(board: Leaderboard, now: datetime) -> date:
    """Return the day as of which a board is shown: today, or the one on which it was frozen."""
    today = now.astimezone(zone_of(board)).date()
    return today if board.frozen_on is None else min(board.frozen_on, today)


def is_over(board: Leaderboard, now: datetime) -> bool:
    """Return whether a frozen board's last day has passed."""
    return (
        board.frozen_on is not None
        and last_day_of(board, now) < now.astimezone(zone_of(board)).date()
    )


def _unfrozen_period(board: Leaderboard, today: date, zone: tzinfo) -> Period:
    match board.period:
        case PeriodKind.DAYS_30:
            return Period(today - timedelta(days=LAST_DAYS - 1), None, zone)
        case PeriodKind.WEEK:
            return Period(today - timedelta(days=today.weekday()), None, zone)
        case PeriodKind.MONTH:
            return Period(today.replace(day=1), None, zone)
        case PeriodKind.DATES:
            return Period(board.period_from, board.period_to, zone)
    return Period(None, None, zone)
