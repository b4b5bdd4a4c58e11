"""The ranked rows of a board: read from stored rows, or computed from results.

Both must agree; a test compares them. Stored rows are found by index: rows by their key, ranks as
sums over the board's distinct figures. No query reads or counts all rows.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Protocol

from django.db import connection
from django.db.models import F, QuerySet, Sum

from rehab.boards.choices import TieRule
from rehab.boards.models import Leaderboard
from rehab.boards.ranking.results import Result
from rehab.boards.rows import BoardCount, BoardEntry
from rehab.people.models import Patient

Columns = tuple[int, int, int | None, str]
COLUMNS = ("patient_id", "figure", "points_at_stake", "key")
MERIT_DIGITS, KEY_DIGITS = 10, 44  # of a key, see `results.make_key`

# Selects a patient's row; how many rows, and how many figures, are better; how many rows are equal,
# and the first and last key among them. Raw SQL, since Django takes longer to compile this query
# than a database to run it.
_COUNTS = "FROM rehab_boardcount c WHERE c.board_id = e.board_id AND c.valence = e.valence"
_EQUALS = f"""FROM rehab_boardentry o WHERE o.board_id = e.board_id AND o.valence = e.valence
    AND o."key" > SUBSTR(e."key", 1, {MERIT_DIGITS})
    AND o."key" <= SUBSTR(e."key", 1, {MERIT_DIGITS}) || '{"9" * (KEY_DIGITS - MERIT_DIGITS)}'"""
FIND_ROW = f"""
SELECT {", ".join(f'e."{column}"' for column in COLUMNS)},
    (SELECT COALESCE(SUM(c."rows"), 0) {_COUNTS} AND c.figure {{better}} e.figure),
    (SELECT COUNT(*) {_COUNTS} AND c.figure {{better}} e.figure),
    (SELECT COALESCE(SUM(c."rows"), 1) {_COUNTS} AND c.figure = e.figure),
    (SELECT MAX(o."key") {_EQUALS}), (SELECT MIN(o."key") {_EQUALS})
FROM rehab_boardentry e WHERE e.board_id = %s AND e.valence = %s AND e.patient_id = %s
"""  # noqa: S608 (constants of this module)


@dataclass(frozen=True, slots=True)
class RankedRow:
    """A row and its rank.

    ``rank`` follows the board's rule for equal figures; ``shared_rank`` is the one that equals
    share under the standard rule. ``session_id`` is known of computed rows only.
    """

    patient_id: int
    session_id: int | None
    figure: int
    points_at_stake: int | None
    key: str
    shared_rank: int
    rank: int


class Standings(Protocol):
    """All rows of one list, the best first."""

    count: int
    total: int

    def count_people(self, limit: int) -> int:
        """Return how many rows are of people, not of simulated patients; ``limit`` at most."""

    def find(self, patient_id: int) -> RankedRow | None:
        """Return a patient's row; None where there is none."""

    def top(self, n: int) -> list[RankedRow]:
        """Return the ``n`` best rows."""

    def around(self, me: RankedRow, n: int) -> list[RankedRow]:
        """Return a row and ``n`` rows on each side of it."""


def number_ranks(board: Leaderboard, figures: Iterable[int]) -> list[tuple[int, int]]:
    """Return the shared rank, and the rank by the board's rule, of figures in order."""
    ranks: list[tuple[int, int]] = []
    shared = distinct = 0
    before: int | None = None
    for place, figure in enumerate(figures, start=1):
        if figure != before:
            shared, distinct, before = place, distinct + 1, figure
        by_rule = {TieRule.DENSE: distinct, TieRule.EARLIER: place}
        ranks.append((shared, by_rule.get(TieRule(board.ties), shared)))
    return ranks


class ComputedStandings:
    """Standings of computed results: of own sessions, or of a board that is not saved yet."""

    def __init__(self, board: Leaderboard, results: Iterable[Result]) -> None:
        self._board = board
        rows = sorted(results, key=lambda row: row.key, reverse=True)
        self.count = len(rows)
        self.total = sum(row.figure for row in rows)
        ranks = number_ranks(board, [row.figure for row in rows])
        self._rows = [
            RankedRow(
                row.patient_id,
                row.session_id,
                row.figure,
                row.points_at_stake,
                row.key,
                shared,
                rank,
            )
            for row, (shared, rank) in zip(rows, ranks, strict=True)
        ]

    def count_people(self, limit: int) -> int:
        """Return how many rows are of people, not of simulated patients; ``limit`` at most."""
        simulated = Patient.everywhere.filter(simulated=True, clinic=self._board.clinic_id)
        others = set(simulated.values_list("pk", flat=True))
        return min(limit, sum(row.patient_id not in others for row in self._rows))

    def find(self, patient_id: int) -> RankedRow | None:
        """Return a patient's row; None where there is none."""
        return next((row for row in self._rows if row.patient_id == patient_id), None)

    def find_session(self, session_id: int) -> RankedRow | None:
        """Return a session's row; None where there is none."""
        return next((row for row in self._rows if row.session_id == session_id), None)

    def top(self, n: int) -> list[RankedRow]:
        """Return the ``n`` best rows."""
        return self._rows[:n]

    def around(self, me: RankedRow, n: int) -> list[RankedRow]:
        """Return a row and ``n`` rows on each side of it."""
        at = self._rows.index(me)
        return self._rows[max(0, at - n) : at + n + 1]


class StoredStandings:
    """Standings of a board as it is stored."""

    def __init__(self, board: Leaderboard, valence: str) -> None:
        self._board, self._valence = board, valence
        self._counts = BoardCount.everywhere.filter(board=board, valence=valence)
        sums = self._counts.aggregate(count=Sum("rows"), total=Sum(F("rows") * F("figure")))
        self.count: int = sums["count"] or 0
        self.total: int = sums["total"] or 0

    def find_rows(self) -> QuerySet[BoardEntry]:
        """Return the stored rows of this list."""
        return BoardEntry.everywhere.filter(board=self._board, valence=self._valence)

    def count_people(self, limit: int) -> int:
        """Return how many rows are of people, not of simulated patients; ``limit`` at most."""
        return self.find_rows().filter(patient__simulated=False)[:limit].count()

    def find(self, patient_id: int) -> RankedRow | None:
        """Return a patient's row. Its rank is the number of rows with better figures, and one."""
        better = ">" if self._board.higher_is_better else "<"
        with connection.cursor() as cursor:
            cursor.execute(
                FIND_ROW.format(better=better), [self._board.pk, self._valence, patient_id]
            )
            found = cursor.fetchone()
        if found is None:
            return None
        ahead, figures, equals = (int(number) for number in found[4:7])
        row, shared = found[:4], 1 + ahead
        match self._board.ties:
            case TieRule.DENSE:
                return make_row(row, shared, 1 + figures)
            case TieRule.EARLIER:
                before = self._count_equals_before(row[3], found[7:], equals)
                return make_row(row, shared, shared + before)
        return make_row(row, shared, shared)

    def top(self, n: int) -> list[RankedRow]:
        """Return the ``n`` best rows; their ranks follow from their order."""
        best = list(self.find_rows().order_by("-key").values_list(*COLUMNS)[:n])
        ranks = number_ranks(self._board, [row[1] for row in best])
        return [make_row(row, *rank) for row, rank in zip(best, ranks, strict=True)]

    def around(self, me: RankedRow, n: int) -> list[RankedRow]:
        """Return a row and ``n`` rows on each side of it, with ranks that follow from its own."""
        rows = self.find_rows().values_list(*COLUMNS)
        above = list(rows.filter(key__gt=me.key).order_by("key")[:n])
        below = list(rows.filter(key__lt=me.key).order_by("-key")[:n])
        figures = {me.figure, *(row[1] for row in (*above, *below))}
        sizes: dict[int, int] = {}
        if len(figures) > 1:  # on a large board neighbors are mostly equals
            counts = self._counts.filter(figure__in=figures)
            sizes = dict(counts.values_list("figure", "rows"))
        up: list[RankedRow] = [me]
        for row in above:
            up.append(self._rank_neighbor(row, up[-1], -sizes.get(row[1], 1), -1))
        down: list[RankedRow] = [me]
        for row in below:
            down.append(self._rank_neighbor(row, down[-1], sizes.get(down[-1].figure, 1), 1))
        return [*reversed(up), *down[1:]]

    def _rank_neighbor(self, row: Columns, neighbor: RankedRow, size: int, step: int) -> RankedRow:
        """Return the row next to a ranked one; a different figure is ``size`` ranks off."""
        other = row[1] != neighbor.figure
        shared = neighbor.shared_rank + size if other else neighbor.shared_rank
        match self._board.ties:
            case TieRule.DENSE:
                return make_row(row, shared, neighbor.rank + step if other else neighbor.rank)
            case TieRule.EARLIER:
                return make_row(row, shared, neighbor.rank + step)
        return make_row(row, shared, shared)

    def _count_equals_before(self, key: str, ends: tuple[str, ...], size: int) -> int:
        """Return how many rows of the same figure stand before a key, counted from the nearer end.

        A figure may have some ten thousand rows; which end is nearer is estimated from the keys.
        """
        rows, (first, last) = self.find_rows(), ends
        highest, mine, lowest = (int(one[MERIT_DIGITS:]) for one in (first, key, last))
        if 2 * mine >= highest + lowest:
            return rows.filter(key__gt=key, key__lte=first).count()
        return size - 1 - rows.filter(key__gte=last, key__lt=key).count()


def make_row(row: Columns, shared: int, rank: int) -> RankedRow:
    """Return a stored row with its ranks."""
    patient_id, figure, points_at_stake, key = row
    return RankedRow(patient_id, None, figure, points_at_stake, key, shared, rank)
