"""Keeps the stored rows of boards in step with the sessions that they follow from.

Rows are written here only, each together with the count of its figure. What alters them: a session
that ends or is taken away, a patient who agrees or no longer does, a board that is built, and the
calendar. The same rows come out whether they were kept up or are made anew; a test compares.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterator
from datetime import datetime
from itertools import islice

from django.db import connection, transaction
from django.db.models import F, Q, QuerySet
from django.utils import timezone

from rehab.boards.figures import Figure, read_figures
from rehab.boards.models import BoardCount, BoardEntry, Leaderboard
from rehab.boards.periods import period_of
from rehab.people.models import Patient

AT_ONCE = 2_000  # rows a statement, and patients a look


def boards_of(clinic_id: int | None) -> QuerySet[Leaderboard]:
    """Give the boards that patients of a clinic can have rows on."""
    boards = Leaderboard.everywhere.filter(Q(clinic=clinic_id) | Q(clinic=None), active=True)
    return boards.exclude(among=Leaderboard.Among.SELF).select_related("clinic")


def refresh_patients(patients: Collection[int], now: datetime | None = None) -> None:
    """Bring the rows of some patients up to date, on every board that they can be on."""
    clinics = set(Patient.everywhere.filter(pk__in=patients).values_list("clinic_id", flat=True))
    for clinic_id in clinics:
        for board in boards_of(clinic_id):
            refresh(board, patients, now)


def refresh(
    board: Leaderboard, patients: Collection[int] | None = None, now: datetime | None = None
) -> None:
    """Bring a board's rows up to date: those of some patients, or (None) all.

    One at a time for each board, so that no two writers count the same row.
    """
    now = now or timezone.now()
    with transaction.atomic():
        if not Leaderboard.everywhere.select_for_update().filter(pk=board.pk).exists():
            return
        if patients is None:
            _rebuild(board, now)
        else:
            _replace(board, patients, now)


def refresh_stale(board: Leaderboard, now: datetime) -> None:
    """Bring the rows up to date that time has altered: a session has left the period."""
    today = period_of(board, now).day_of(now)
    stale = BoardEntry.everywhere.filter(board=board, stale_on__lte=today)
    while patients := set(stale.values_list("patient_id", flat=True)[:AT_ONCE]):
        refresh(board, patients, now)


def _replace(board: Leaderboard, patients: Collection[int], now: datetime) -> None:
    rows = BoardEntry.everywhere.filter(board=board, patient__in=patients)
    before = {(row.patient_id, row.valence): row for row in rows}
    after = {(row.patient_id, row.valence): row for row in read_figures(board, now, patients)}
    gone = [row for key, row in before.items() if _alters(row, after.get(key))]
    new = [row for key, row in after.items() if key not in before or before[key] in gone]
    if gone:
        BoardEntry.everywhere.filter(pk__in=[row.pk for row in gone]).delete()
    BoardEntry.everywhere.bulk_create(make_entry(board, row) for row in new)
    changed = Counter((row.valence, row.value) for row in new)
    changed.subtract((row.valence, row.figure) for row in gone)
    for (valence, figure), count in sorted(changed.items()):
        _count(board, valence, figure, count)


def _alters(row: BoardEntry, figure: Figure | None) -> bool:
    """Whether a stored row is no longer what it should be."""
    return figure is None or (row.figure, row.stake, row.key, row.stale_on) != (
        figure.value,
        figure.stake,
        figure.key,
        figure.stale_on,
    )


def _count(board: Leaderboard, valence: str, figure: int, count: int) -> None:
    """Add to the count of a figure; one that nobody has any more goes."""
    if not count:
        return
    counts = BoardCount.everywhere.filter(board=board, valence=valence, figure=figure)
    if not counts.update(rows=F("rows") + count):
        BoardCount.everywhere.create(board=board, valence=valence, figure=figure, rows=count)
    elif count < 0:
        counts.filter(rows=0).delete()


def _rebuild(board: Leaderboard, now: datetime) -> None:
    BoardEntry.everywhere.filter(board=board).delete()
    BoardCount.everywhere.filter(board=board).delete()
    if board.is_own or not board.active:
        return
    counted: Counter[tuple[str, int]] = Counter()
    for rows in _batches(read_figures(board, now)):
        counted.update((row.valence, row.value) for row in rows)
        BoardEntry.everywhere.bulk_create(make_entry(board, row) for row in rows)
    BoardCount.everywhere.bulk_create(
        (
            BoardCount(board=board, valence=valence, figure=figure, rows=count)
            for (valence, figure), count in counted.items()
        ),
        AT_ONCE,
    )
    if counted.total() > AT_ONCE:
        _analyze()


def _analyze() -> None:
    """Tell the database how much there is now; PostgreSQL would go on sorting whole boards."""
    with connection.cursor() as cursor:
        for model in (BoardEntry, BoardCount):
            cursor.execute(f"ANALYZE {model._meta.db_table}")


def _batches(figures: Iterator[Figure]) -> Iterator[list[Figure]]:
    while batch := list(islice(figures, AT_ONCE)):
        yield batch


def make_entry(board: Leaderboard, row: Figure) -> BoardEntry:
    """Give a figure as it is stored."""
    return BoardEntry(
        board_id=board.pk,
        patient_id=row.patient_id,
        valence=row.valence,
        figure=row.value,
        stake=row.stake,
        key=row.key,
        stale_on=row.stale_on,
    )
