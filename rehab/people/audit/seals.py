"""Seals on the logs: a chain of digests for each clinic and log, checked by `manage.py doctor`.

Rows are sealed in batches some minutes after they were added, in transactions of their own, so that
no training waits. Who changes, adds or removes a sealed row afterwards breaks the chain from there
on; a copy of the seals elsewhere (`manage.py shiplogs`) shows it also of who writes a new chain.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Iterator
from datetime import UTC, datetime, timedelta
from itertools import takewhile
from typing import Any, ClassVar

from django.apps import apps
from django.db import IntegrityError, connection, models, transaction
from django.db.models import F, Q
from django.utils import timezone
from django.utils.translation import gettext_lazy as _

from rehab.people.append_only import Allowed, AppendOnlyModel
from rehab.people.audit.moves import Translate, moves_of, original_keys, same_key
from rehab.people.audit.row_digests import SealableModel
from rehab.people.models import Clinic
from rehab.people.scope import Scope

# Until then repeats of an entry are counted in it, and rows with a lower key may be committed.
SEALED_AFTER = timedelta(minutes=10)
BATCH_ROWS = 1_000


class LogSeal(AppendOnlyModel):
    """A batch of a log's rows with their common digest, which includes that of the batch before.

    ``cut_at``: when its rows were deleted because they were too old. It stays, as an anchor.
    """

    scope = Scope(clinic="clinic")
    allowed_changes = (Allowed(("cut_at",), "OLD.cut_at IS NULL AND NEW.cut_at IS NOT NULL"),)

    log = models.CharField(max_length=16)
    clinic = models.ForeignKey(Clinic, on_delete=models.PROTECT, related_name="+", null=True)
    number = models.PositiveIntegerField()
    moves = models.PositiveIntegerField(default=0)  # that the clinic had made when it was sealed
    first_id = models.BigIntegerField()
    last_id = models.BigIntegerField()
    last_at = models.DateTimeField()
    previous = models.CharField(max_length=64, blank=True)
    digest = models.CharField(max_length=64)
    sealed_at = models.DateTimeField(default=timezone.now)
    cut_at = models.DateTimeField(null=True)

    class Meta(AppendOnlyModel.Meta):
        verbose_name = _("seal of a log")
        ordering: ClassVar = ["log", "clinic", "number"]
        constraints: ClassVar = [
            models.UniqueConstraint(fields=["log", "clinic", "number"], name="log_sealed_in_order"),
            models.UniqueConstraint(
                fields=["log", "number"],
                condition=Q(clinic__isnull=True),
                name="log_of_hosts_sealed_in_order",
            ),
        ]

    def __str__(self) -> str:
        return f"{self.log} {self.first_id}–{self.last_id}"

    def rows(self) -> models.QuerySet[Any]:
        """Return the rows that it covers, in their order."""
        rows = rows_of(self.log, self.clinic_id)
        return rows.filter(pk__range=(self.first_id, self.last_id))

    def compute_digest(self, rows: Iterable[Any], original: Translate = same_key) -> str:
        """Return the digest of these rows behind the previous seal."""
        clinic = None if self.clinic_id is None else original(Clinic, self.clinic_id)
        head = f"{self.previous}\n{self.log}\n{clinic}\n{self.number}\n"
        lines = (
            f"{original(type(row), row.pk)} {getattr(row, 'count', 1)} {row.digest}\n"
            for row in rows
        )
        return hashlib.sha256((head + "".join(lines)).encode()).hexdigest()


def sealed_models() -> dict[str, type[Any]]:
    """Return the models whose rows are sealed, by their names."""
    models_ = (model for model in apps.get_models() if issubclass(model, SealableModel))
    return {model.__name__: model for model in models_}


def rows_of(log: str, clinic_id: int | None) -> models.QuerySet[Any]:
    """Return a clinic's rows of a log, in their order; None for those of no clinic."""
    model = sealed_models()[log]
    rows: models.QuerySet[Any] = model.everywhere.filter(**_of(clinic_id, model.scope.clinic))
    return rows.order_by("pk")


def _of(clinic_id: int | None, lookup: str = "clinic") -> dict[str, Any]:
    return {f"{lookup}__isnull": True} if clinic_id is None else {lookup: clinic_id}


def seals_of(log: str, clinic_id: int | None) -> models.QuerySet[LogSeal]:
    """Return the seals of a clinic's log, in their order."""
    return LogSeal.everywhere.filter(log=log, **_of(clinic_id)).order_by("number")


def unsealed_rows(log: str, clinic_id: int | None) -> models.QuerySet[Any]:
    """Return a clinic's rows of a log that have no seal yet."""
    last = seals_of(log, clinic_id).last()
    return rows_of(log, clinic_id).filter(pk__gt=last.last_id if last else 0)


def _chains() -> Iterator[tuple[str, int | None]]:
    """Yield the logs of each clinic, and those of no clinic."""
    keys = [None, *Clinic.everywhere.order_by("pk").values_list("pk", flat=True)]
    yield from ((log, key) for log in sealed_models() for key in keys)


def seal_logs(now: datetime) -> int:
    """Seal all rows that are old enough. Return how many."""
    sealed, until = 0, now - SEALED_AFTER
    for log, clinic_id in _chains():
        try:
            while count := _seal_batch(log, clinic_id, until, now):
                sealed += count
        except IntegrityError:  # another process seals this chain at this moment
            continue
    return sealed


def seal_at_once(clinic_id: int, now: datetime) -> None:
    """Seal all rows of a clinic's logs, also the newest; who adds one meanwhile waits."""
    with transaction.atomic(), connection.cursor() as cursor:
        if connection.vendor == "postgresql":
            logs: list[type[Any]] = [*sealed_models().values(), LogSeal]
            tables = [model._meta.db_table for model in logs]
            cursor.execute(f"LOCK TABLE {', '.join(tables)} IN SHARE ROW EXCLUSIVE MODE")
        for log in sealed_models():
            while _seal_batch(log, clinic_id, datetime.max.replace(tzinfo=UTC), now):
                pass


def _seal_batch(log: str, clinic_id: int | None, until: datetime, now: datetime) -> int:
    """Seal a chain's next rows from before a moment, of one day at most. Return how many.

    A row that stands before one of that time was added earlier, whatever the clock said.
    """
    last = seals_of(log, clinic_id).last()
    unsealed = unsealed_rows(log, clinic_id)
    newest = unsealed.filter(at__lt=until).last()
    if newest is None:
        return 0
    rows = unsealed.filter(pk__lte=newest.pk)[:BATCH_ROWS]
    batch = list(takewhile(lambda row: row.at.date() == rows[0].at.date(), rows))
    seal = LogSeal(
        log=log,
        clinic_id=clinic_id,
        number=last.number + 1 if last else 1,
        moves=len(moves_of(clinic_id)),
        first_id=batch[0].pk,
        last_id=batch[-1].pk,
        last_at=max(row.at for row in batch),
        previous=last.digest if last else "",
        sealed_at=now,
    )
    seal.digest = seal.compute_digest(batch)
    with transaction.atomic():  # this alone: rows are read while trainings go on
        seal.save()
    return len(batch)


def cut_before(log: str, clinic_id: int, moment: datetime, now: datetime) -> int:
    """Delete a clinic's rows of a log from before a moment, by whole batches. Return how many."""
    seal_logs(now)
    old = LogSeal.everywhere.filter(
        log=log, clinic=clinic_id, last_at__lt=moment, cut_at__isnull=True
    )
    model, deleted = sealed_models()[log], 0
    for seal in old:
        LogSeal.everywhere.filter(pk=seal.pk).update(cut_at=now)
        deleted += model.everywhere.filter(pk__in=seal.rows().values("pk")).delete()[0]
    return deleted


def find_broken() -> Iterator[str]:
    """Yield what is wrong with the logs: where a chain or a row is not what was sealed or added."""
    for log, clinic_id in _chains():
        yield from find_broken_of(log, clinic_id)


def find_broken_of(log: str, clinic_id: int | None) -> Iterator[str]:
    """Yield what is wrong with a clinic's log."""
    of = f"{log}, clinic {clinic_id or 'none'}"
    previous, number, moves = "", 0, moves_of(clinic_id)
    for seal in seals_of(log, clinic_id):
        where = f"{of}, rows {seal.first_id} to {seal.last_id}"
        if (seal.previous, seal.number) != (previous, number + 1):
            yield f"{where}: the seal before is another one"
        previous, number = seal.digest, seal.number
        if seal.cut_at is not None:
            continue
        rows, original = list(seal.rows()), original_keys(moves, seal.moves)
        if seal.compute_digest(rows, original) != seal.digest:
            yield f"{where}: rows were added, removed or counted anew"
        yield from _find_changed(where, rows, original)
    unsealed = unsealed_rows(log, clinic_id).iterator()
    yield from _find_changed(f"{of}, not sealed yet", unsealed, same_key)


def _find_changed(where: str, rows: Iterable[Any], original: Translate) -> Iterator[str]:
    changed = (row for row in rows if not row.is_genuine(original))
    yield from (f"{where}: row {row.pk} was changed" for row in changed)


def count_unsealed(before: datetime) -> int:
    """Return how many rows from before a moment have no seal."""
    return sum(unsealed_rows(*chain).filter(at__lt=before).count() for chain in _chains())


def shipped_lines(after: int) -> Iterator[dict[str, Any]]:
    """Yield each seal after a key with its rows, as plain data, oldest first."""
    for seal in LogSeal.everywhere.filter(pk__gt=after, cut_at__isnull=True).order_by("pk"):
        model = sealed_models()[seal.log]
        names = ("id", *model.sealed_fields, "salt", "digest", "erased")
        extra = {"count": F("count")} if hasattr(model, "count") else {}
        yield {
            "seal": seal.pk,
            "log": seal.log,
            "clinic": seal.clinic_id,
            "number": seal.number,
            "previous": seal.previous,
            "digest": seal.digest,
            "sealed_at": seal.sealed_at,
            "rows": list(seal.rows().values(*names, *extra)),
        }
