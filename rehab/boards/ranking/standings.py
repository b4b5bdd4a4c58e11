"""Places on a board, read from rows that are stored or from some that were just made.

Both give the same; a test holds them to it. Stored ones are found by index: rows by their key,
places as sums over the board's distinct figures. Nothing reads or counts all rows.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Protocol

from django.db import connection
from django.db.models import F, QuerySet, Sum

from rehab.boards.figures import Figure
from rehab.boards.models import BoardCount, BoardEntry, Leaderboard
from rehab.people.models import Patient

Ties = Leaderboard.Ties
Columns = tuple[int, int, int | None, str]
COLUMNS = ("patient_id", "figure", "stake", "key")
MERIT, KEY = 10, 44  # digits of a key that say the figure, and all (figures.py, make_key)

# A patient's row; how many rows, and how many figures, are better; how many are equal, with the
# first and the last key among them. By hand: Django takes longer to write it than it takes to find.
_COUNTS = "FROM rehab_boardcount c WHERE c.board_id = e.board_id AND c.valence = e.valence"
_EQUALS = f"""FROM rehab_boardentry o WHERE o.board_id = e.board_id AND o.valence = e.valence
    AND o."key" > SUBSTR(e."key", 1, {MERIT})
    AND o."key" <= SUBSTR(e."key", 1, {MERIT}) || '{"9" * (KEY - MERIT)}'"""
PLACE = f"""
SELECT {", ".join(f'e."{column}"' for column in COLUMNS)},
    (SELECT COALESCE(SUM(c."rows"), 0) {_COUNTS} AND c.figure {{better}} e.figure),
    (SELECT COUNT(*) {_COUNTS} AND c.figure {{better}} e.figure),
    (SELECT COALESCE(SUM(c."rows"), 1) {_COUNTS} AND c.figure = e.figure),
    (SELECT MAX(o."key") {_EQUALS}), (SELECT MIN(o."key") {_EQUALS})
FROM rehab_boardentry e WHERE e.board_id = %s AND e.valence = %s AND e.patient_id = %s
"""  # noqa: S608 (names of ours)


@dataclass(frozen=True, slots=True)
class Placed:
    """A row and its place. ``shared``: the place that equals share, whatever way it is told."""

    patient_id: int
    session_id: int | None
    figure: int
    stake: int | None
    key: str
    shared: int
    rank: int


class Standings(Protocol):
    """All rows of one list, from the best on."""

    count: int
    total: int

    def count_people(self, most: int) -> int:
        """Count the rows that are no simulated patient's, up to so many."""

    def find(self, patient_id: int) -> Placed | None:
        """Give a patient's row."""

    def top(self, n: int) -> list[Placed]:
        """Give the best."""

    def around(self, me: Placed, n: int) -> list[Placed]:
        """Give so many rows on each side of one, and that one."""


def number(board: Leaderboard, figures: Iterable[int]) -> list[tuple[int, int]]:
    """Give figures, best first, the place that equals share and the one that is told."""
    places: list[tuple[int, int]] = []
    shared = distinct = 0
    before: int | None = None
    for place, figure in enumerate(figures, start=1):
        if figure != before:
            shared, distinct, before = place, distinct + 1, figure
        told = {Ties.DENSE: distinct, Ties.EARLIER: place}.get(Ties(board.ties), shared)
        places.append((shared, told))
    return places


class Listed:
    """Standings of rows at hand: of own sessions, or of a board that is not saved yet."""

    def __init__(self, board: Leaderboard, figures: Iterable[Figure]) -> None:
        self._board = board
        rows = sorted(figures, key=lambda row: row.key, reverse=True)
        self.count = len(rows)
        self.total = sum(row.value for row in rows)
        places = number(board, [row.value for row in rows])
        self._rows = [
            Placed(row.patient_id, row.session_id, row.value, row.stake, row.key, shared, rank)
            for row, (shared, rank) in zip(rows, places, strict=True)
        ]

    def count_people(self, most: int) -> int:
        """Count the rows that are no simulated patient's, up to so many."""
        simulated = Patient.everywhere.filter(simulated=True, clinic=self._board.clinic_id)
        others = set(simulated.values_list("pk", flat=True))
        return min(most, sum(row.patient_id not in others for row in self._rows))

    def find(self, patient_id: int) -> Placed | None:
        """Give a patient's row."""
        return next((row for row in self._rows if row.patient_id == patient_id), None)

    def find_session(self, session_id: int) -> Placed | None:
        """Give a session's row."""
        return next((row for row in self._rows if row.session_id == session_id), None)

    def top(self, n: int) -> list[Placed]:
        """Give the best."""
        return self._rows[:n]

    def around(self, me: Placed, n: int) -> list[Placed]:
        """Give so many rows on each side of one, and that one."""
        at = self._rows.index(me)
        return self._rows[max(0, at - n) : at + n + 1]


class Stored:
    """Standings of a board as it is stored."""

    def __init__(self, board: Leaderboard, valence: str) -> None:
        self._board, self._valence = board, valence
        self._counts = BoardCount.everywhere.filter(board=board, valence=valence)
        sums = self._counts.aggregate(count=Sum("rows"), total=Sum(F("rows") * F("figure")))
        self.count: int = sums["count"] or 0
        self.total: int = sums["total"] or 0

    def find_rows(self) -> QuerySet[BoardEntry]:
        """Give the rows of this list."""
        return BoardEntry.everywhere.filter(board=self._board, valence=self._valence)

    def count_people(self, most: int) -> int:
        """Count the rows that are no simulated patient's, up to so many."""
        return self.find_rows().filter(patient__simulated=False)[:most].count()

    def find(self, patient_id: int) -> Placed | None:
        """Give a patient's row. Its place: all whose figures are better, and one."""
        better = ">" if self._board.higher_is_better else "<"
        with connection.cursor() as cursor:
            cursor.execute(PLACE.format(better=better), [self._board.pk, self._valence, patient_id])
            found = cursor.fetchone()
        if found is None:
            return None
        ahead, figures, equals = (int(number) for number in found[4:7])
        row, shared = found[:4], 1 + ahead
        match self._board.ties:
            case Ties.DENSE:
                return make_placed(row, shared, 1 + figures)
            case Ties.EARLIER:
                before = self._count_equals_before(row[3], found[7:], equals)
                return make_placed(row, shared, shared + before)
        return make_placed(row, shared, shared)

    def top(self, n: int) -> list[Placed]:
        """Give the best: their places follow from their order alone."""
        best = list(self.find_rows().order_by("-key").values_list(*COLUMNS)[:n])
        places = number(self._board, [row[1] for row in best])
        return [make_placed(row, *place) for row, place in zip(best, places, strict=True)]

    def around(self, me: Placed, n: int) -> list[Placed]:
        """Give so many rows on each side of one, and that one. Places follow from that one's."""
        rows = self.find_rows().values_list(*COLUMNS)
        above = list(rows.filter(key__gt=me.key).order_by("key")[:n])
        below = list(rows.filter(key__lt=me.key).order_by("-key")[:n])
        figures = {me.figure, *(row[1] for row in (*above, *below))}
        sizes: dict[int, int] = {}
        if len(figures) > 1:  # on a large board neighbors are mostly equals
            alike = self._counts.filter(figure__in=figures)
            sizes = dict(alike.values_list("figure", "rows"))
        up: list[Placed] = [me]
        for row in above:
            up.append(self._next(row, up[-1], -sizes.get(row[1], 1), -1))
        down: list[Placed] = [me]
        for row in below:
            down.append(self._next(row, down[-1], sizes.get(down[-1].figure, 1), 1))
        return [*reversed(up), *down[1:]]

    def _next(self, row: Columns, beside: Placed, size: int, step: int) -> Placed:
        """Give the row beside one that has its place; another figure is so many places off."""
        other = row[1] != beside.figure
        shared = beside.shared + size if other else beside.shared
        match self._board.ties:
            case Ties.DENSE:
                return make_placed(row, shared, beside.rank + step if other else beside.rank)
            case Ties.EARLIER:
                return make_placed(row, shared, beside.rank + step)
        return make_placed(row, shared, shared)

    def _count_equals_before(self, key: str, ends: tuple[str, ...], size: int) -> int:
        """Count the rows of the same figure that stand before one, from the nearer end.

        A figure may have some ten thousand rows; which end is nearer is guessed from the keys.
        """
        rows, (first, last) = self.find_rows(), ends
        highest, mine, lowest = (int(one[MERIT:]) for one in (first, key, last))
        if 2 * mine >= highest + lowest:
            return rows.filter(key__gt=key, key__lte=first).count()
        return size - 1 - rows.filter(key__gte=last, key__lt=key).count()


def make_placed(row: Columns, shared: int, rank: int) -> Placed:
    """Give a stored row its places."""
    patient_id, figure, stake, key = row
    return Placed(patient_id, None, figure, stake, key, shared, rank)
