"""Validation of a board's settings: what would mislead or expose somebody is refused."""

from __future__ import annotations

from collections.abc import Iterator
from datetime import date
from typing import Any

from django.utils.formats import date_format
from django.utils.translation import gettext as _

from rehab.boards.choices import (
    Aggregation,
    CountedTypes,
    DisplayMode,
    NameStyle,
    Occasion,
    Participants,
)
from rehab.training.valences import VALENCES

# Metrics whose range depends on the valence: boards that mix valences must not rank by them.
POINT_METRICS = frozenset({"score", "points_per_100_steps"})
# Metrics that add up over sessions; a sum of shares would mean nothing.
SUMMABLE_METRICS = frozenset({"score", "steps", "active_minutes", "attended", "target_met"})
# Metrics that count sessions and say nothing of a single one.
COUNTING_METRICS = frozenset({"attended", "target_met"})
# Days that every time zone and both databases can represent.
FIRST_DAY, LAST_DAY = date(1970, 1, 1), date(2199, 12, 31)


def find_invalid_settings(board: Any) -> Iterator[tuple[str, str]]:
    """Yield the fields of a `Leaderboard` that are refused, each with what to do about it."""
    yield from _check_valences(board)
    yield from _check_days(board)
    yield from _check_rows(board)
    yield from _check_display(board)


def _check_valences(board: Any) -> Iterator[tuple[str, str]]:
    chosen = board.valences
    if not isinstance(chosen, list) or not all(slug in VALENCES for slug in chosen):
        yield (
            "valences",
            _("Give a list of these types: %(types)s.") % {"types": ", ".join(VALENCES)},
        )
        return
    if board.types == CountedTypes.CHOSEN and not chosen:
        yield "valences", _("Choose at least one type.")
    if board.types == CountedTypes.SAME:
        return
    mixed = board.types == CountedTypes.ALL or len(set(chosen)) > 1
    for field in ("metric", "tie_breaker"):
        if getattr(board, field) not in POINT_METRICS:
            continue
        if mixed:
            yield (
                field,
                _(
                    "Points of different feedback types cannot be compared: negative ones are "
                    "never above 0. Choose the steps at the goal, or a single type."
                ),
            )
        elif chosen == ["explicit"]:
            yield field, _("Explicit feedback has no points. Choose the steps at the goal.")


def _check_days(board: Any) -> Iterator[tuple[str, str]]:
    for field in ("period_from", "period_to", "frozen_on"):
        day = getattr(board, field)
        if isinstance(day, date) and not FIRST_DAY <= day <= LAST_DAY:
            yield (
                field,
                _(
                    "Give a day from %(first)s to %(last)s. A board without an end ends on the "
                    "last one."
                )
                % {"first": date_format(FIRST_DAY), "last": date_format(LAST_DAY)},
            )


def _check_rows(board: Any) -> Iterator[tuple[str, str]]:
    if board.is_own:
        if board.aggregation != Aggregation.EACH:
            yield (
                "aggregation",
                _("A board of own sessions shows each of them. Choose “Each session”."),
            )
        if board.metric in COUNTING_METRICS:
            yield "metric", _("This says nothing of a single session. Compare with other patients.")
        if board.display == DisplayMode.TOTAL:
            yield "display", _("A total is reached together. Compare with other patients.")
        return
    if board.aggregation == Aggregation.EACH:
        yield "aggregation", _("A board of several patients shows one row for each of them.")
    elif board.aggregation == Aggregation.SUM:
        if board.metric not in SUMMABLE_METRICS:
            yield "aggregation", _("This cannot be added up. Choose best, latest or mean.")
    elif board.metric in COUNTING_METRICS:
        yield "aggregation", _("This is counted over the period. Choose the sum.")
    elif board.display == DisplayMode.TOTAL:
        yield "aggregation", _("A total adds up what all have reached. Choose the sum.")


def _check_display(board: Any) -> Iterator[tuple[str, str]]:
    if board.among == Participants.ACROSS and board.names != NameStyle.PSEUDONYM:
        yield "names", _("Across clinics there are animal names only.")
    if board.occasion == Occasion.WAITING:
        if board.is_own or board.display not in {DisplayMode.TOP, DisplayMode.TOTAL}:
            yield (
                "display",
                _(
                    "A waiting tablet belongs to nobody yet. Show the best of several patients, or "
                    "their total."
                ),
            )
        elif board.types == CountedTypes.SAME:
            yield "types", _("A waiting tablet has no session at hand. Choose types, or all.")
