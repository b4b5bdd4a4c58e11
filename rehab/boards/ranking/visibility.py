"""Which rows of a board somebody sees: near or best ones, never anybody in the last half."""

from __future__ import annotations

from dataclasses import dataclass

from rehab.boards.models import Leaderboard
from rehab.boards.standings import Placed, Standings

AROUND = 2  # neighbors on each side
MOST_TIED = 10  # rows that may share the last place shown, beyond the number of the best


@dataclass(frozen=True, slots=True)
class Chosen:
    """A row to be shown. ``skips``: others stand before it that are not shown."""

    row: Placed
    skips: bool
    ranked: bool  # whether its place may be told


def choose(board: Leaderboard, standings: Standings, me: Placed | None) -> list[Chosen]:
    """Give the rows that are shown to one patient, or (me is None) to whoever comes by.

    Of several patients only the first half is shown, and no place in the last half is told: who
    stands there and would see the neighbors gets nothing, and is shown the own sessions instead.
    """
    last = standings.count if board.is_own else (standings.count + 1) // 2
    if board.display == Leaderboard.Display.NEIGHBORS:
        return _near(board, standings, me, last)
    most = min(last, board.top_n)
    best = [row for row in standings.top(board.top_n + MOST_TIED) if place(board, row) <= most]
    chosen = [Chosen(row, False, True) for row in best]
    if board.display == Leaderboard.Display.TOP_AND_ME and me is not None and me not in best:
        follows = standings.around(me, 1)[0] in best[-1:]
        chosen.append(Chosen(me, not follows, place(board, me) <= last))
    return chosen


def _near(board: Leaderboard, standings: Standings, me: Placed | None, last: int) -> list[Chosen]:
    if me is None:
        rows = standings.top(1 + 2 * AROUND) if board.is_own else []
    else:
        rows = standings.around(me, AROUND) if place(board, me) <= last else []
    seen = [row for row in rows if place(board, row) <= last]
    first = standings.top(1)[:1]
    return [
        Chosen(row, skips=index == 0 and row not in first, ranked=True)
        for index, row in enumerate(seen)
    ]


def place(board: Leaderboard, row: Placed) -> int:
    """Give the place that cuts go by: equals share theirs unless the earlier one goes first."""
    return row.rank if board.ties == Leaderboard.Ties.EARLIER else row.shared
