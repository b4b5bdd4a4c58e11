"""Clinical tests as outcomes: each result's change since the first baseline, in its window.

Whoever takes a test must not know the arm, and so cannot choose what it is of: the day decides.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from datetime import date, datetime

from rehab.questionnaires.standard_tests import ClinicalTest
from robot.marking import gettext_noop

# Ours: a result tells of a visit for so many days after it, a baseline for so many before.
DAYS_AFTER, DAYS_BEFORE = 7, 14
AFTER, FOLLOW_UP = gettext_noop("after training"), gettext_noop("at the follow-up")
VISITS = {AFTER: "the last training visit of an arm", FOLLOW_UP: "the follow-up"}
SLUGS = {AFTER: "after", FOLLOW_UP: "follow_up"}


def slug_of(test: str, window: str) -> str:
    """Return the outcome's slug of a test's in a window."""
    return f"{test}_{SLUGS[window]}"


def is_of_test(slug: str) -> bool:
    """Return whether an outcome's slug is of a clinical test; a further channel's has a colon."""
    return ":" not in slug and slug.endswith(tuple(f"_{end}" for end in SLUGS.values()))


def meaning_of(test: ClinicalTest, window: str) -> str:
    """Return how a test's outcome is computed, and which way is better."""
    better = "higher" if test.higher_is_better else "lower"
    items = "; ".join(item.text for item in test.items if not item.is_text)
    return (
        f"Last result of an assessor of the study from the day of {VISITS[window]} to "
        f"{DAYS_AFTER} days later (at the first visit, from the session's begin), before the "
        f"next visit's day, less the last one of the {DAYS_BEFORE} days before the first "
        f"session began; {better} is better." + (items and f" The result is the sum of: {items}.")
    )


@dataclass(frozen=True, slots=True)
class ClinicalResult:
    """A result: of which test, when, on which day by the clinic's clock."""

    test: str
    at: datetime
    day: date
    value: float


@dataclass(frozen=True, slots=True)
class Day:
    """A visit's day; ``window`` is None of a visit after which its arm's training goes on."""

    day: date
    window: str | None


def clinical_baselines(results: Iterable[ClinicalResult], first: datetime) -> dict[str, float]:
    """Return the first baselines by the outcomes' slugs.

    Parameters
    ----------
    results
        Of one participant, oldest first.
    first
        When the first session began.
    """
    before = {
        one.test: one.value
        for one in results
        if one.at < first and (first - one.at).days < DAYS_BEFORE
    }
    return {slug_of(test, window): value for test, value in before.items() for window in SLUGS}


def clinical_changes(
    results: Sequence[ClinicalResult], first: datetime, days: Sequence[Day]
) -> list[dict[str, float]]:
    """Return the changes at each visit by the outcomes' slugs.

    Parameters
    ----------
    results, first
        As for `clinical_baselines`.
    days
        Of the visits, in their order.
    """
    baselines = clinical_baselines(results, first)
    found: list[dict[str, float]] = []
    for number, visit in enumerate(days):
        ends = days[number + 1].day if number + 1 < len(days) else date.max
        last = {
            slug_of(one.test, visit.window): one.value
            for one in results
            if visit.window is not None
            and one.at >= first
            and visit.day <= one.day < ends
            and (one.day - visit.day).days <= DAYS_AFTER
        }
        found.append({slug: last[slug] - baselines[slug] for slug in last if slug in baselines})
    return found
