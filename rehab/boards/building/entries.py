"""Keeps the stored rows of boards in step with the sessions that they follow from.

Rows are written here only, each together with the count of its figure. What alters them: a session
that ends or is taken away, a patient who agrees or no longer does, a board that is built, and the
calendar. The same rows come out whether they were kept up or are made anew; a test compares.

Once its last day is over, a frozen board is a snapshot: nobody enters it, and rows only leave, or
follow a correction of what they are made of.

A board of many is built by `building.py`, some patients at a time; what happens to a patient
meanwhile is kept up as ever.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterable
from datetime import datetime

from django.db import connection, transaction
from django.db.models import Count, Q, QuerySet

from rehab.boards.figures import Figure, read_figures, standing_on
from rehab.boards.models import BoardCount, BoardEntry, Leaderboard
from rehab.boards.periods import is_over, last_day_of
from rehab.people.models import Patient

AT_ONCE = 2_000  # patients a transaction, where nobody waits beside it


def boards_of(clinics: Iterable[int]) -> QuerySet[Leaderboard]:
    """Give the boards that patients of some clinics can have rows on, each once.

    In one order for everyone: who writes rows locks boards in it, so that no two wait crosswise.
    """
    boards = Leaderboard.everywhere.filter(Q(clinic__in=clinics) | Q(clinic=None), active=True)
    return boards.exclude(among=Leaderboard.Among.SELF).order_by("pk")


def clinics_of(patients: Collection[int]) -> set[int]:
    """Give the clinics of some patients."""
    return set(Patient.everywhere.filter(pk__in=patients).values_list("clinic_id", flat=True))


def refresh_patients(patients: Collection[int], *, now: datetime, corrected: bool = False) -> None:
    """Bring the rows of some patients up to date, on every board that they can be on."""
    for board in boards_of(clinics_of(patients)):
        refresh(board, patients, now=now, corrected=corrected)


def refresh(
    board: Leaderboard,
    patients: Collection[int] | None = None,
    *,
    now: datetime,
    corrected: bool = False,
) -> None:
    """Bring a board's rows up to date: those of some patients, or (None) all.

    One at a time for each board, so that no two writers count the same row. ``corrected``: what
    the rows are made of was wrong, so that those of a snapshot follow.
    """
    if patients is None:
        begin(board)
        while advance(board.pk, AT_ONCE, now):
            pass
        board.built_to = None
        return
    with transaction.atomic():
        locked = _lock(board.pk)
        if locked is None:
            return
        before, after = _replace(locked, patients, now, corrected=corrected)
        if locked.built_to is not None:  # those beyond are counted when building comes there
            before = [row for row in before if row.patient_id <= locked.built_to]
            after = [row for row in after if row.patient_id <= locked.built_to]
        changed = _tally(after)
        changed.subtract(_tally(before))
        _count(locked, changed)


def is_snapshot(board: Leaderboard, now: datetime) -> bool:
    """Whether a board's rows are what they were when it was frozen, and stay so."""
    return board.built_to is None and board.active and not board.is_own and is_over(board, now)


def thin_out(board: Leaderboard) -> None:
    """Take off a snapshot who may no longer stand on it, and count its rows anew."""
    with transaction.atomic():
        locked = _lock(board.pk)
        if locked is None or locked.built_to is not None:
            return  # building does as much
        rows = BoardEntry.everywhere.filter(board=locked)
        rows.exclude(patient__in=standing_on(locked)).delete()
        BoardCount.everywhere.filter(board=locked).delete()
        alike = rows.order_by().values_list("valence", "figure").annotate(rows=Count("pk"))
        _count(locked, Counter({(valence, figure): number for valence, figure, number in alike}))


def begin(board: Leaderboard) -> None:
    """Forget the counts; rows stay until building comes to their patients."""
    with transaction.atomic():
        if _lock(board.pk) is not None:
            board.built_to = 0
            Leaderboard.everywhere.filter(pk=board.pk).update(built_to=0)
            BoardCount.everywhere.filter(board=board).delete()


def advance(board_id: int, most: int, now: datetime) -> bool:
    """Build the rows of the next patients, so many at most; give whether there are more.

    How far it has come is stored with them, so that anyone can go on after a crash.
    """
    with transaction.atomic():
        board = _lock(board_id)
        if board is None or board.built_to is None:
            return False
        patients = next_patients(board, board.built_to, most)
        _, after = _replace(board, patients, now)
        _count(board, _tally(after))
        built_to = patients[-1] if len(patients) == most else None
        Leaderboard.everywhere.filter(pk=board_id).update(built_to=built_to)
    return built_to is not None


def find_unbuilt() -> int | None:
    """Give a board that is to be built."""
    unbuilt = Leaderboard.everywhere.filter(built_to__isnull=False).order_by("pk")
    return unbuilt.values_list("pk", flat=True).first()


def find_outdated(now: datetime, few: int) -> int | None:
    """Give a board of which time has altered more than a few rows."""
    boards = Leaderboard.everywhere.filter(active=True).select_related("clinic").order_by("pk")
    return next((board.pk for board in boards if len(find_stale(board, now, few + 1)) > few), None)


def measure_progress(board: Leaderboard) -> int | None:
    """Give how much of a board is built, in percent; None where all is."""
    if board.built_to is None:
        return None
    standing = standing_on(board)
    return 100 * standing.filter(pk__lte=board.built_to).count() // max(1, standing.count())


def _lock(board_id: int) -> Leaderboard | None:
    """Give a board as it is now, if it is still there; nobody else writes its rows meanwhile.

    Its clinic is read afterwards: both are what they were when the lock was had, not before.
    """
    return Leaderboard.everywhere.select_for_update().filter(pk=board_id).first()


def next_patients(board: Leaderboard, after: int, most: int) -> list[int]:
    """Give the next patients who have a row or may have one, so many at most."""
    rows = BoardEntry.everywhere.filter(board=board, patient__gt=after).order_by("patient_id")
    found = set(rows.values_list("patient_id", flat=True).distinct()[:most])
    if _has_rows(board):
        standing = standing_on(board).filter(pk__gt=after).order_by("pk")
        found.update(standing.values_list("pk", flat=True)[:most])
    return sorted(found)[:most]


def _has_rows(board: Leaderboard) -> bool:
    return board.active and not board.is_own


def find_stale(board: Leaderboard, now: datetime, most: int) -> set[int]:
    """Give patients whose rows time has altered: a session has left the period. So many rows."""
    today = last_day_of(board, now)
    stale = BoardEntry.everywhere.filter(board=board, stale_on__lte=today)
    return set(stale.values_list("patient_id", flat=True)[:most])


def refresh_stale(board_id: int, most: int, now: datetime) -> bool:
    """Bring so many of those rows up to date; give whether there may be more."""
    board = Leaderboard.everywhere.filter(pk=board_id).first()
    patients = find_stale(board, now, most) if board else set()
    if board and patients:
        refresh(board, patients, now=now, corrected=True)
    return bool(patients)


def _replace(
    board: Leaderboard, patients: Collection[int], now: datetime, *, corrected: bool = False
) -> tuple[list[BoardEntry], list[BoardEntry]]:
    """Make the rows of some patients anew; give those that were there and those that are."""
    rows = BoardEntry.everywhere.filter(board=board, patient__in=patients)
    before = {(row.patient_id, row.valence): row for row in rows}
    snapshot = is_snapshot(board, now)
    after: dict[tuple[int, str], BoardEntry] = {}
    if snapshot and not corrected:
        known = {patient for patient, _valence in before}
        stay = set(standing_on(board).filter(pk__in=known).values_list("pk", flat=True))
        after = {key: row for key, row in before.items() if key[0] in stay}
    elif _has_rows(board):
        figures = read_figures(board, now, patients)
        after = {(row.patient_id, row.valence): make_entry(board, row) for row in figures}
        if snapshot:
            after = {key: row for key, row in after.items() if key in before}
    gone = [row.pk for key, row in before.items() if _alters(row, after.get(key))]
    new = [row for key, row in after.items() if _alters(row, before.get(key))]
    if gone:
        BoardEntry.everywhere.filter(pk__in=gone).delete()
    BoardEntry.everywhere.bulk_create(new)
    return list(before.values()), list(after.values())


def _alters(row: BoardEntry, other: BoardEntry | None) -> bool:
    """Whether two rows of a patient differ in anything that is told or ordered by."""
    return other is None or (row.figure, row.stake, row.key, row.stale_on) != (
        other.figure,
        other.stake,
        other.key,
        other.stale_on,
    )


def _tally(rows: Iterable[BoardEntry]) -> Counter[tuple[str, int]]:
    return Counter((row.valence, row.figure) for row in rows)


def _count(board: Leaderboard, changed: Counter[tuple[str, int]]) -> None:
    """Add to the counts of some figures; one that nobody has any more goes."""
    altered = {key: number for key, number in changed.items() if number}
    if not altered:
        return
    counts = BoardCount.everywhere.filter(board=board, figure__in={key[1] for key in altered})
    there = {(one.valence, one.figure): one for one in counts}
    known = [there[key].pk for key in altered if key in there]
    if known:
        BoardCount.everywhere.filter(pk__in=known).delete()
    for key, one in there.items():
        if key in altered:
            altered[key] += one.rows
    BoardCount.everywhere.bulk_create(
        BoardCount(board=board, valence=valence, figure=figure, rows=rows)
        for (valence, figure), rows in sorted(altered.items())
        if rows
    )


def tidy() -> None:
    """Tell the database what there is now, once a board of many has been built.

    Without it PostgreSQL sorts whole boards, and looks every row of an index up in the table.
    """
    tables = ", ".join(model._meta.db_table for model in (BoardEntry, BoardCount))
    if connection.vendor == "postgresql":
        how = "ANALYZE" if connection.in_atomic_block else "VACUUM (ANALYZE)"
        with connection.cursor() as cursor:
            cursor.execute(f"{how} {tables}")


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
