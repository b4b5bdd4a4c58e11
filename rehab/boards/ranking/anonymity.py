"""What a board shows so that patients stay anonymous: never the last half, never too few people."""

from __future__ import annotations

from dataclasses import dataclass

from rehab.boards.choices import DisplayMode, TieRule
from rehab.boards.models import Leaderboard
from rehab.boards.ranking.standings import RankedRow, Standings

NEIGHBORS = 2  # on each side
MAX_TIED = 10  # rows that may share the last rank shown, beyond the number of the best
# A patient's own sessions: with more than these, the best ones and those around the one at hand.
MAX_OWN = 50
OWN_BEST = 10
OWN_NEIGHBORS = 15


def count_participants(board: Leaderboard, standings: Standings) -> int:
    """Return how many patients a board compares.

    Among fewer people than ``min_participants`` simulated patients do not count, since they make
    nobody anonymous. Where there are no people they do, as in a clinic that tries GARRY.
    """
    few_people = 0 < standings.people < board.min_participants
    return standings.people if few_people else standings.count


def has_too_few(board: Leaderboard, standings: Standings) -> bool:
    """Return whether a board compares fewer than ``min_participants``: then it is not shown."""
    return count_participants(board, standings) < board.min_participants


@dataclass(frozen=True, slots=True)
class VisibleRow:
    """A row to be shown.

    Attributes
    ----------
    follows_gap
        Whether rows that are not shown stand directly before it.
    has_rank
        Whether its rank may be shown.
    """

    row: RankedRow
    follows_gap: bool
    has_rank: bool


def find_visible_rows(
    board: Leaderboard, standings: Standings, me: RankedRow | None, *, staff: bool = False
) -> list[VisibleRow]:
    """Return the rows that are shown to a patient or, without ``me``, to anybody.

    A PT (``staff``) is no row's neighbor, and sees the first rows of a board of neighbors.

    Of several patients only the first half is shown, and no rank in the last half. Where
    neighbors are shown, a patient in the last half gets an empty list, and pages show own sessions.
    """
    last = standings.count if board.is_own else (standings.count + 1) // 2
    if board.display == DisplayMode.NEIGHBORS:
        return _find_neighbors(board, standings, me, last, staff=staff)
    most = min(last, board.top_n)
    best = [row for row in standings.top(board.top_n + MAX_TIED) if cutoff_rank(board, row) <= most]
    visible = [VisibleRow(row, False, True) for row in best]
    if board.display == DisplayMode.TOP_AND_ME and me is not None and me not in best:
        follows = standings.around(me, 1)[0] in best[-1:]
        visible.append(VisibleRow(me, not follows, cutoff_rank(board, me) <= last))
    return visible


def _find_neighbors(
    board: Leaderboard, standings: Standings, me: RankedRow | None, last: int, *, staff: bool
) -> list[VisibleRow]:
    if me is None:
        rows = standings.top(1 + 2 * NEIGHBORS) if board.is_own or staff else []
    else:
        rows = standings.around(me, NEIGHBORS) if cutoff_rank(board, me) <= last else []
    seen = [row for row in rows if cutoff_rank(board, row) <= last]
    first = standings.top(1)[:1]
    return [
        VisibleRow(row, follows_gap=index == 0 and row not in first, has_rank=True)
        for index, row in enumerate(seen)
    ]


def find_visible_own_rows(standings: Standings, me: RankedRow | None) -> list[VisibleRow]:
    """Return all own sessions; of more than ``MAX_OWN`` the best and those around ``me``."""
    rows = standings.top(standings.count)
    at = 0 if me is None else rows.index(me)
    near = range(at - OWN_NEIGHBORS, at + OWN_NEIGHBORS + 1)
    shown = [
        index
        for index in range(len(rows))
        if len(rows) <= MAX_OWN or index < OWN_BEST or index in near
    ]
    return [
        VisibleRow(rows[index], follows_gap=index > 0 and index - 1 not in shown, has_rank=True)
        for index in shown
    ]


def cutoff_rank(board: Leaderboard, row: RankedRow) -> int:
    """Return the rank that cuts go by: shared by equals unless the earlier one goes first."""
    return row.rank if board.ties == TieRule.EARLIER else row.shared_rank
