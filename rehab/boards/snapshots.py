"""Frozen boards: their results as they were at the end of the last day, stored as JSON.

Patients never enter a snapshot, and who leaves it does not come back. Only a correction of the
sessions behind a row alters it.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable
from datetime import datetime

from django.db import models, transaction
from django.db.models import Q, QuerySet

from rehab.boards.cache_invalidation import draw_token
from rehab.boards.choices import Participants
from rehab.boards.models import Leaderboard
from rehab.boards.ranking.eligibility import eligible_patients, find_group
from rehab.boards.ranking.periods import is_over
from rehab.boards.ranking.results import Result, read_results
from rehab.people.models import Patient
from rehab.people.scope import Scope, ScopedModel


class BoardSnapshot(ScopedModel):
    """The results on a frozen board.

    ``definition`` is what they were computed by; ``version`` is another number after each change.
    """

    scope = Scope(clinic="board__clinic")

    board = models.OneToOneField(Leaderboard, on_delete=models.CASCADE, related_name="snapshot")
    definition = models.TextField()
    results = models.JSONField()
    version = models.BigIntegerField(default=draw_token)

    def __str__(self) -> str:
        return f"{self.board}"

    def to_results(self) -> list[Result]:
        """Return the stored results."""
        return [Result._make([*row, tuple(key)]) for *row, key in self.results]


def shared_boards(clinics: Iterable[int]) -> QuerySet[Leaderboard]:
    """Return the boards that patients of some clinics can be on together.

    Always in the same order: writers lock boards in it, so that no two of them deadlock.
    """
    boards = Leaderboard.everywhere.filter(Q(clinic__in=clinics) | Q(clinic=None))
    return boards.exclude(among=Participants.SELF).order_by("pk")


def freeze_boards(clinics: Iterable[int], now: datetime) -> None:
    """Store the snapshots that are due, before anything changes that they depend on."""
    for board in shared_boards(clinics).filter(frozen_on__isnull=False).select_related("snapshot"):
        if is_over(board, now) and not _has_snapshot(board):
            freeze(board, now)


def freeze(board: Leaderboard, now: datetime) -> BoardSnapshot | None:
    """Return the snapshot of a board whose last day is over; take it where there is none.

    None for a form with other settings than those stored, which has no snapshot.
    """
    with transaction.atomic():
        stored = Leaderboard.everywhere.select_for_update().filter(pk=board.pk).first()
        if stored is None or not _is_same(stored, board):
            return None
        if not _has_snapshot(stored):
            BoardSnapshot.everywhere.update_or_create(
                board=stored,
                defaults={
                    "definition": stored.definition,
                    "results": list(read_results(stored, now)),
                    "version": draw_token(),
                },
            )
            stored = Leaderboard.everywhere.get(pk=board.pk)
    return stored.snapshot


def find_version(board: Leaderboard, now: datetime) -> int | None:
    """Return the version of the snapshot that a board shows; None where it shows no snapshot."""
    if not is_over(board, now):
        return None
    found = BoardSnapshot.everywhere.filter(board=board.pk, definition=board.definition)
    version = found.values_list("version", flat=True).first()
    if version is not None and getattr(board, "chosen", None) is None:
        return version
    snapshot = freeze(board, now)
    return None if snapshot is None else snapshot.version


def read_snapshot(version: int) -> list[Result]:
    """Return the results of a snapshot; none where it has changed meanwhile."""
    found = BoardSnapshot.everywhere.filter(version=version).first()
    return [] if found is None else found.to_results()


def update_snapshots(patients: Collection[int], now: datetime, *, corrected: bool = False) -> None:
    """Remove patients who are no longer eligible; recompute the rest after a correction."""
    clinics = Patient.everywhere.filter(pk__in=patients).values_list("clinic_id", flat=True)
    for board in shared_boards(set(clinics)).filter(snapshot__isnull=False):
        update_snapshot(board, set(patients), now, corrected=corrected)


def update_snapshot(
    board: Leaderboard, patients: Collection[int] | None, now: datetime, *, corrected: bool = False
) -> None:
    """Bring the rows of some patients, or (None) of all, up to date in a board's snapshot."""
    with transaction.atomic():
        snapshots = BoardSnapshot.everywhere.select_for_update(of=("self",))
        snapshot = snapshots.filter(board=board).first()
        if snapshot is None:
            return
        before = snapshot.to_results()
        affected = {row.patient_id for row in before}
        if patients is not None:
            affected &= set(patients)
        if not affected:
            return
        if corrected:
            listed = {(row.patient_id, row.valence) for row in before}
            fresh = read_results(board, now, affected)
            stay = [row for row in fresh if (row.patient_id, row.valence) in listed]
        else:
            eligible = eligible_patients(board).filter(pk__in=affected)
            pks = set(eligible.values_list("pk", flat=True))
            stay = [row for row in before if row.patient_id in pks]
        after = [row for row in before if row.patient_id not in affected] + stay
        if after != before:
            snapshot.results, snapshot.version = after, draw_token()
            snapshot.save(update_fields=["results", "version"])


def _has_snapshot(board: Leaderboard) -> bool:
    found: BoardSnapshot | None = getattr(board, "snapshot", None)
    return found is not None and found.definition == board.definition


def _is_same(stored: Leaderboard, board: Leaderboard) -> bool:
    """Return whether a board, which may be a form's, ranks the same patients as the stored one."""
    return stored.definition == board.definition and (
        not board.has_group or set(find_group(stored)) == set(find_group(board))
    )
