"""Changes by which servers' caches learn that a patient's rows on boards are out of date."""

from __future__ import annotations

from collections.abc import Collection
from datetime import UTC, date, datetime, time, timedelta
from secrets import randbits
from typing import ClassVar

from django.db import models
from django.utils import timezone

from rehab.boards.models import Leaderboard
from rehab.people.models import Clinic, Patient
from rehab.people.scope import Scope, ScopedModel


def draw_token() -> int:
    """Return a random number that fits a signed 64-bit column."""
    return randbits(63)


class BoardChange(ScopedModel):
    """A change to what boards show of a patient: figures, a correction, consent, or a study.

    Rows are added in the transaction of the change and never altered, so that no commit waits for
    another. Tokens are random: an identifier that was rolled back is never issued again. No
    constraint ties a row to its clinic or patient, whose rows may be locked.
    """

    scope = Scope(clinic="clinic")

    token = models.BigIntegerField(primary_key=True, default=draw_token)
    clinic = models.ForeignKey(
        Clinic, on_delete=models.CASCADE, related_name="+", db_constraint=False, db_index=False
    )
    patient_key = models.BigIntegerField()
    at = models.DateTimeField(default=timezone.now)

    class Meta(ScopedModel.Meta):
        indexes: ClassVar = [models.Index(fields=["clinic", "at"], name="board_change_by_clinic")]

    def __str__(self) -> str:
        return f"{self.patient_key}"


def record_changes(patients: Collection[int]) -> None:
    """Record, in the transaction of the change, that what boards show of patients has changed."""
    clinics = Patient.everywhere.filter(pk__in=patients).values_list("pk", "clinic_id")
    BoardChange.everywhere.bulk_create(
        BoardChange(patient_key=patient, clinic_id=clinic) for patient, clinic in clinics
    )


def read_changes(board: Leaderboard, today: date) -> dict[int, int]:
    """Return the changes in a board's clinics since the day before ``today``: patients by token.

    Cached standings are used for one day at most, so that they need no earlier ones.
    """
    changes = BoardChange.everywhere.filter(at__gte=_first_moment(today))
    if board.clinic_id is None:
        changes = changes.filter(clinic__boards_across=True)
    else:
        changes = changes.filter(clinic=board.clinic_id)
    return dict(changes.values_list("token", "patient_key"))


def delete_old_changes(now: datetime) -> None:
    """Delete the changes that no cache reads any more."""
    BoardChange.everywhere.filter(at__lt=_first_moment(now.astimezone(UTC).date())).delete()


def _first_moment(today: date) -> datetime:
    return datetime.combine(today - timedelta(days=1), time(), UTC)
