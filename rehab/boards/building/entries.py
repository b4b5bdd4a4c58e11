"""Keeping the stored rows of boards in step with the sessions that they are computed from.

Rows are written here only, each together with the count of its figure. They change when a session
ends or is removed, a patient agrees or withdraws, a board is created or edited, and with the
calendar. Rows that were updated and rows that are rebuilt are the same; a test compares them.

Once its last day is over, a frozen board is a snapshot: nobody enters it, and rows only leave, or
follow a correction of the sessions behind them.

A board of many patients is built by `scheduler.py`, some patients at a time; rows of patients whose
sessions change meanwhile are updated as always.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterable
from datetime import datetime

from django.db import connection, transaction
from django.db.models import Count, Q, QuerySet

from rehab.boards.choices import Participants
from rehab.boards.models import Leaderboard
from rehab.boards.ranking.eligibility import eligible_patients
from rehab.boards.ranking.periods import is_over, last_day_of
from rehab.boards.ranking.results import Result, read_results
from rehab.boards.rows import BoardCount, BoardEntry
from rehab.people.models import Patient

BATCH = 2_000  # patients a transaction, where nothing else waits for the database


def boards_of(clinics: Iterable[int]) -> QuerySet[Leaderboard]:
    """Return the boards that patients of some clinics can have rows on, each once.

    Always in the same order: writers lock boards in it, so that no two of them deadlock.
    """
    boards = Leaderboard.everywhere.filter(Q(clinic__in=clinics) | Q(clinic=None), active=True)
    return boards.exclude(among=Participants.SELF).order_by("pk")


def clinics_of(patients: Collection[int]) -> set[int]:
    """Return the clinics of some patients."""
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

    One writer at a time for each board, so that no two count the same row. ``corrected``: the
    sessions behind the rows were wrong, so that even the rows of a snapshot follow.
    """
    if patients is None:
        start_rebuild(board)
        while build_next(board.pk, BATCH, now):
            pass
        board.built_to = None
        return
    with transaction.atomic():
        locked = _lock(board.pk)
        if locked is None:
            return
        before, after = _recompute_rows(locked, patients, now, corrected=corrected)
        if locked.built_to is not None:  # later ones are counted when they are built
            before = [row for row in before if row.patient_id <= locked.built_to]
            after = [row for row in after if row.patient_id <= locked.built_to]
        changed = _tally(after)
        changed.subtract(_tally(before))
        _add_to_counts(locked, changed)


def is_snapshot(board: Leaderboard, now: datetime) -> bool:
    """Return whether a board's rows stay as they were when it was frozen."""
    return board.built_to is None and board.active and not board.is_own and is_over(board, now)


def drop_ineligible(board: Leaderboard) -> None:
    """Delete the rows of patients who are no longer eligible from a snapshot; recount the rest."""
    with transaction.atomic():
        locked = _lock(board.pk)
        if locked is None or locked.built_to is not None:
            return  # a board that is being built drops them itself
        rows = BoardEntry.everywhere.filter(board=locked)
        rows.exclude(patient__in=eligible_patients(locked)).delete()
        BoardCount.everywhere.filter(board=locked).delete()
        by_figure = rows.order_by().values_list("valence", "figure").annotate(rows=Count("pk"))
        _add_to_counts(
            locked, Counter({(valence, figure): number for valence, figure, number in by_figure})
        )


def start_rebuild(board: Leaderboard) -> None:
    """Delete the counts and mark the board as unbuilt; rows stay until they are rebuilt."""
    with transaction.atomic():
        if _lock(board.pk) is not None:
            board.built_to = 0
            Leaderboard.everywhere.filter(pk=board.pk).update(built_to=0)
            BoardCount.everywhere.filter(board=board).delete()


def build_next(board_id: int, limit: int, now: datetime) -> bool:
    """Build the rows of the next patients, ``limit`` at most; return whether there are more.

    The progress is stored with them, so that any process can go on after a crash.
    """
    with transaction.atomic():
        board = _lock(board_id)
        if board is None or board.built_to is None:
            return False
        patients = next_patients(board, board.built_to, limit)
        _, after = _recompute_rows(board, patients, now)
        _add_to_counts(board, _tally(after))
        built_to = patients[-1] if len(patients) == limit else None
        Leaderboard.everywhere.filter(pk=board_id).update(built_to=built_to)
    return built_to is not None


def find_unbuilt() -> int | None:
    """Return a board that is to be built; None where there is none."""
    unbuilt = Leaderboard.everywhere.filter(built_to__isnull=False).order_by("pk")
    return unbuilt.values_list("pk", flat=True).first()


def find_outdated(now: datetime, limit: int) -> int | None:
    """Return a board that has more than ``limit`` rows of an earlier day, or None."""
    boards = Leaderboard.everywhere.filter(active=True).select_related("clinic").order_by("pk")
    return next(
        (board.pk for board in boards if len(find_stale(board, now, limit + 1)) > limit), None
    )


def measure_progress(board: Leaderboard) -> int | None:
    """Return how much of a board is built, in percent; None where all is."""
    if board.built_to is None:
        return None
    eligible = eligible_patients(board)
    return 100 * eligible.filter(pk__lte=board.built_to).count() // max(1, eligible.count())


def _lock(board_id: int) -> Leaderboard | None:
    """Lock a board against other writers and return it as it is now; None if it was deleted.

    Its clinic is read after it has the lock, so that both are up to date.
    """
    return Leaderboard.everywhere.select_for_update().filter(pk=board_id).first()


def next_patients(board: Leaderboard, after: int, limit: int) -> list[int]:
    """Return the next patients who have a row or are eligible, ``limit`` at most."""
    rows = BoardEntry.everywhere.filter(board=board, patient__gt=after).order_by("patient_id")
    found = set(rows.values_list("patient_id", flat=True).distinct()[:limit])
    if _has_rows(board):
        eligible = eligible_patients(board).filter(pk__gt=after).order_by("pk")
        found.update(eligible.values_list("pk", flat=True)[:limit])
    return sorted(found)[:limit]


def _has_rows(board: Leaderboard) -> bool:
    return board.active and not board.is_own


def find_stale(board: Leaderboard, now: datetime, limit: int) -> set[int]:
    """Return the patients of up to ``limit`` rows with a session that has left the period."""
    today = last_day_of(board, now)
    stale = BoardEntry.everywhere.filter(board=board, stale_on__lte=today)
    return set(stale.values_list("patient_id", flat=True)[:limit])


def refresh_stale(board_id: int, limit: int, now: datetime) -> bool:
    """Bring up to ``limit`` stale rows up to date; return whether there may be more."""
    board = Leaderboard.everywhere.filter(pk=board_id).first()
    patients = find_stale(board, now, limit) if board else set()
    if board and patients:
        refresh(board, patients, now=now, corrected=True)
    return bool(patients)


def _recompute_rows(
    board: Leaderboard, patients: Collection[int], now: datetime, *, corrected: bool = False
) -> tuple[list[BoardEntry], list[BoardEntry]]:
    """Recompute the rows of some patients; return those before and those after."""
    rows = BoardEntry.everywhere.filter(board=board, patient__in=patients)
    before = {(row.patient_id, row.valence): row for row in rows}
    snapshot = is_snapshot(board, now)
    after: dict[tuple[int, str], BoardEntry] = {}
    if snapshot and not corrected:
        known = {patient for patient, _valence in before}
        stay = set(eligible_patients(board).filter(pk__in=known).values_list("pk", flat=True))
        after = {key: row for key, row in before.items() if key[0] in stay}
    elif _has_rows(board):
        results = read_results(board, now, patients)
        after = {(row.patient_id, row.valence): make_entry(board, row) for row in results}
        if snapshot:
            after = {key: row for key, row in after.items() if key in before}
    gone = [row.pk for key, row in before.items() if _differs(row, after.get(key))]
    new = [row for key, row in after.items() if _differs(row, before.get(key))]
    if gone:
        BoardEntry.everywhere.filter(pk__in=gone).delete()
    BoardEntry.everywhere.bulk_create(new)
    return list(before.values()), list(after.values())


def _differs(row: BoardEntry, other: BoardEntry | None) -> bool:
    """Return whether two rows of a patient differ in anything that is shown or ordered by."""
    return other is None or (
        row.figure,
        row.points_at_stake,
        row.key,
        row.stale_on,
    ) != (
        other.figure,
        other.points_at_stake,
        other.key,
        other.stale_on,
    )


def _tally(rows: Iterable[BoardEntry]) -> Counter[tuple[str, int]]:
    return Counter((row.valence, row.figure) for row in rows)


def _add_to_counts(board: Leaderboard, changed: Counter[tuple[str, int]]) -> None:
    """Add to the counts of some figures; delete those that come to 0."""
    altered = {key: number for key, number in changed.items() if number}
    if not altered:
        return
    counts = BoardCount.everywhere.filter(board=board, figure__in={key[1] for key in altered})
    stored = {(count.valence, count.figure): count for count in counts}
    known = [stored[key].pk for key in altered if key in stored]
    if known:
        BoardCount.everywhere.filter(pk__in=known).delete()
    for key, count in stored.items():
        if key in altered:
            altered[key] += count.rows
    BoardCount.everywhere.bulk_create(
        BoardCount(board=board, valence=valence, figure=figure, rows=rows)
        for (valence, figure), rows in sorted(altered.items())
        if rows
    )


def analyze_tables() -> None:
    """Update PostgreSQL's statistics of the tables, once a board of many patients is built.

    Without them it sorts whole boards, and looks up every row of an index in the table.
    """
    tables = ", ".join(model._meta.db_table for model in (BoardEntry, BoardCount))
    if connection.vendor == "postgresql":
        how = "ANALYZE" if connection.in_atomic_block else "VACUUM (ANALYZE)"
        with connection.cursor() as cursor:
            cursor.execute(f"{how} {tables}")


def make_entry(board: Leaderboard, result: Result) -> BoardEntry:
    """Return a result as the row that is stored."""
    return BoardEntry(
        board_id=board.pk,
        patient_id=result.patient_id,
        valence=result.valence,
        figure=result.figure,
        points_at_stake=result.points_at_stake,
        key=result.key,
        stale_on=result.stale_on,
    )
