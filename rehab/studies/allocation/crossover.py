"""Orders of arms in a crossover, and the days of its visits."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import date, timedelta

from rehab.studies.allocation.groups_and_strata import Group
from rehab.training.measures import InvalidSetting

MAX_VISITS = 60
MAX_GAP_DAYS = 365


def williams_orders(arms: Sequence[str]) -> tuple[tuple[str, ...], ...]:
    """Return orders in which each arm stands once at each place and equally often after each other.

    E. J. Williams, Aust. J. Sci. Res. A 2 (1949) 149-168: for n arms n orders, and for odd n also
    their reversals. The first order is 0, n-1, 1, n-2, …; the others are it, shifted.
    """
    count = len(arms)
    first = [place // 2 if place % 2 == 0 else count - (place + 1) // 2 for place in range(count)]
    orders = [tuple((index + shift) % count for index in first) for shift in range(count)]
    if count % 2:
        orders += [tuple(reversed(order)) for order in orders]
    return tuple(tuple(arms[index] for index in order) for order in orders)


def crossover_groups(arms: Sequence[str]) -> tuple[Group, ...]:
    """Return the groups of a crossover: every order, equally often."""
    return tuple(Group(order) for order in williams_orders(arms))


@dataclass(frozen=True, slots=True)
class PlannedVisit:
    """A visit that a study plans: its number from 1, its period from 0, the day.

    ``follow_up``: whether it only measures what is left, without feedback.
    """

    number: int
    period: int
    day: date
    follow_up: bool = False


@dataclass(frozen=True, slots=True)
class VisitPlan:
    """When participants come.

    Attributes
    ----------
    visits
        Of each period.
    days_between
        From one visit to the next of a period.
    washout_days
        From the last visit of a period to the first of the next, so that the one arm's effect has
        passed when the next begins.
    follow_up_days
        From the last visit to a follow-up; None where there is none.

    Raises
    ------
    InvalidSetting
        For numbers out of bounds.
    """

    visits: int = 1
    days_between: int = 1
    washout_days: int = 7
    follow_up_days: int | None = None

    def __post_init__(self) -> None:
        if not 1 <= self.visits <= MAX_VISITS:
            raise InvalidSetting("Plan 1 to {most} visits in each period.", most=MAX_VISITS)
        if not (1 <= self.days_between <= MAX_GAP_DAYS and 1 <= self.washout_days <= MAX_GAP_DAYS):
            raise InvalidSetting(
                "Between two visits lie 1 to {most} days; so does the washout.", most=MAX_GAP_DAYS
            )
        if self.follow_up_days is not None and not 1 <= self.follow_up_days <= MAX_GAP_DAYS:
            raise InvalidSetting(
                "The follow-up comes 1 to {most} days after the last visit.", most=MAX_GAP_DAYS
            )

    def plan(self, periods: int, first_day: date) -> tuple[PlannedVisit, ...]:
        """Return the visits of a participant.

        Parameters
        ----------
        periods
            How many: one for each arm of the participant's group.
        first_day
            The day of the first visit.
        """
        planned: list[PlannedVisit] = []
        day = first_day
        for period in range(periods):
            for visit in range(self.visits):
                if planned:
                    gap = self.days_between if visit else self.washout_days
                    day += timedelta(days=gap)
                planned.append(PlannedVisit(len(planned) + 1, period, day))
        if self.follow_up_days is not None:
            day += timedelta(days=self.follow_up_days)
            planned.append(PlannedVisit(len(planned) + 1, periods - 1, day, follow_up=True))
        return tuple(planned)
