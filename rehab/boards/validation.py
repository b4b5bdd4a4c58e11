"""What a board may be: combinations that would mislead or expose somebody, each with its cure."""

from __future__ import annotations

from collections.abc import Iterator
from datetime import date
from typing import TYPE_CHECKING

from django.utils.formats import date_format
from django.utils.translation import gettext as _

from rehab.training.valences import VALENCES

if TYPE_CHECKING:
    from rehab.boards.models import Leaderboard

# Metrics whose range depends on the feedback type: one board must not mix types by them.
TYPED = frozenset({"score", "points_per_100_steps"})
# What can be added up over sessions; a sum of shares would mean nothing.
SUMMABLE = frozenset({"score", "steps", "active_minutes", "attended", "target_met"})
# What says nothing of a single session.
COUNTED = frozenset({"attended", "target_met"})
# Days that every time zone and both databases can reckon with.
FIRST_DAY, LAST_DAY = date(1970, 1, 1), date(2199, 12, 31)


def find_faults(board: Leaderboard) -> Iterator[tuple[str, str]]:
    """Give what is wrong with a board: the field, and what to do."""
    yield from _faults_of_types(board)
    yield from _faults_of_days(board)
    yield from _faults_of_rows(board)
    yield from _faults_of_places(board)


def _faults_of_types(board: Leaderboard) -> Iterator[tuple[str, str]]:
    chosen = board.valences
    if not isinstance(chosen, list) or not all(slug in VALENCES for slug in chosen):
        yield (
            "valences",
            _("Give a list of these types: %(types)s.") % {"types": ", ".join(VALENCES)},
        )
        return
    if board.types == board.Types.CHOSEN and not chosen:
        yield "valences", _("Choose at least one type.")
    if board.types == board.Types.SAME:
        return
    mixed = board.types == board.Types.ALL or len(set(chosen)) > 1
    for field in ("metric", "tie_breaker"):
        if getattr(board, field) not in TYPED:
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


def _faults_of_days(board: Leaderboard) -> Iterator[tuple[str, str]]:
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


def _faults_of_rows(board: Leaderboard) -> Iterator[tuple[str, str]]:
    if board.is_own:
        if board.entry != board.Entry.EACH:
            yield "entry", _("A board of own sessions shows each of them. Choose “Each session”.")
        if board.metric in COUNTED:
            yield "metric", _("This says nothing of a single session. Compare with other patients.")
        if board.display == board.Display.TOTAL:
            yield "display", _("A total is reached together. Compare with other patients.")
        return
    if board.entry == board.Entry.EACH:
        yield "entry", _("A board of several patients shows one row for each of them.")
    elif board.entry == board.Entry.SUM:
        if board.metric not in SUMMABLE:
            yield "entry", _("This cannot be added up. Choose best, latest or mean.")
    elif board.metric in COUNTED:
        yield "entry", _("This is counted over the period. Choose the sum.")
    elif board.display == board.Display.TOTAL:
        yield "entry", _("A total adds up what all have reached. Choose the sum.")


def _faults_of_places(board: Leaderboard) -> Iterator[tuple[str, str]]:
    if board.among == board.Among.ACROSS and board.names != board.Names.PSEUDONYM:
        yield "names", _("Across clinics there are animal names only.")
    if board.moment == board.Moment.WAITING:
        if board.is_own or board.display not in {board.Display.TOP, board.Display.TOTAL}:
            yield (
                "display",
                _(
                    "A waiting tablet belongs to nobody yet. Show the best of several patients, or "
                    "their total."
                ),
            )
        elif board.types == board.Types.SAME:
            yield "types", _("A waiting tablet has no session at hand. Choose types, or all.")
